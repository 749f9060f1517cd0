"""The bootstrap particle filter: on a linear model the Kalman filter, on others it finds the parameters."""

import dataclasses

import numpy as np
import pytest
from briefly import tune_filters
from models import COLEMAN_HODGDON

from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import Knowledge
from twin.estimation.particle_filter import BootstrapFilter, Cloud, log_likelihood, systematic
from twin.estimation.registry import find_method
from twin.estimation.tuning import innovation_log_likelihood
from twin.hysteresis import ColemanHodgdon

T, R = 0.1, 0.5
Q, P = (0.09, 0.04), (4.0, 1.0)
TIME = np.arange(120) * T
PULL = np.stack([3 + np.sin(TIME), np.sin(2 * TIME), 2 * np.sin(0.7 * TIME), np.cos(TIME)])
LINEAR = BootstrapFilter(
    COLEMAN_HODGDON,
    T,
    process_deviation=(Q[0] ** 0.5, Q[1] ** 0.5, 0.0),
    initial_deviation=(P[0] ** 0.5, P[1] ** 0.5, 0.0),
    measurement_variance=R,
)
KALMAN = ActiveModel(COLEMAN_HODGDON, T, Q, R, P)


def measured(model=COLEMAN_HODGDON, first=2.0):
    """Truth and measurements of a model along the pulls, with a gap, and first estimates that are off."""
    truth = np.array([model.response(pull, 20 * pull[0]) for pull in PULL])
    measurement = truth + np.sqrt(R) * np.random.default_rng(1).normal(size=truth.shape)
    measurement[:, 50:60] = np.nan
    return truth, measurement, truth[:, 0] + first


def test_with_more_particles_it_comes_nearer_to_the_kalman_filter():
    """Where the parameters stay, the model is linear and normal: mean, interval and likelihood are known."""
    _, *given = measured()
    mean, half_width = KALMAN.estimate_with_interval(PULL, *given)
    away = []
    for count in (100, 1600, 25_600):
        found, width = dataclasses.replace(LINEAR, count=count).estimate_with_interval(PULL, *given)
        away.append([np.sqrt(np.mean((found - mean) ** 2)), np.abs(width / half_width - 1)[:, 1:].mean()])
    few, more, many = np.array(away)
    assert (more < 0.5 * few).all()  # errors of Monte Carlo are of the root of the number: a fourth each time
    assert (many < 0.5 * more).all()
    assert many[0] < 0.02
    assert many[1] < 0.02
    likelihood = log_likelihood(dataclasses.replace(LINEAR, count=25_600), PULL, *given)
    assert likelihood == pytest.approx(innovation_log_likelihood(KALMAN, PULL, *given), abs=1.0)


def test_each_particle_is_drawn_by_its_weight():
    """At least the whole part of P w, and one more at most: systematic resampling has the least variance."""
    rng = np.random.default_rng(0)
    weights = rng.dirichlet(np.full(40, 0.3), size=7)
    for offset in (0.0, 0.3, 0.999):
        places = systematic(weights, offset).reshape(7, 40)
        for row in range(7):
            times = np.bincount(places[row] - 40 * row, minlength=40)
            assert (np.floor(40 * weights[row] - 1e-9) <= times).all()
            assert (times <= np.ceil(40 * weights[row] + 1e-9)).all()


def test_resampling_keeps_mean_and_variance_of_the_parameters_and_no_two_alike():
    filter_ = dataclasses.replace(LINEAR, count=20_000, initial_deviation=(1.0, 1.0, 0.2))
    cloud = filter_.start(np.zeros(1), np.zeros(1))
    weights = np.exp(-((cloud.particles[2] - 1.3) ** 2) / 0.02)
    cloud = Cloud(0, cloud.particles, weights / weights.sum(), np.zeros(1))
    own = cloud.particles[2, 0]
    mean = np.average(own, weights=weights[0])
    deviation = np.sqrt(np.average((own - mean) ** 2, weights=weights[0]))
    drawn = filter_.predict(cloud, np.zeros(1), np.zeros(1)).particles[2, 0]
    assert drawn.mean() == pytest.approx(mean, rel=2e-3)
    assert drawn.std() == pytest.approx(deviation, rel=0.012)
    assert len(np.unique(drawn)) == 20_000


def test_it_learns_the_parameters_of_another_endoscope():
    """Of one that is a third softer it has half of the error of the Kalman filter with the wrong model."""
    a, b, c = dataclasses.astuple(COLEMAN_HODGDON)
    truth, *given = measured(ColemanHodgdon(a, 0.7 * b, 1.3 * c), 10.0)
    own = BootstrapFilter(COLEMAN_HODGDON, T, (0.05, 0.05, 0.02), (10.0, 0.1, 0.3), R)
    errors = [
        np.sqrt(np.mean((filter_.estimate(PULL, *given) - truth)[:, 60:] ** 2))
        for filter_ in (own, dataclasses.replace(KALMAN, process_variance=(0.05**2, 0.05**2)))
    ]
    assert errors[0] < 0.5 * errors[1]


def test_the_same_seed_gives_the_same_estimates_and_another_one_others():
    _, *given = measured()
    again = dataclasses.replace(LINEAR)
    np.testing.assert_array_equal(LINEAR.estimate(PULL, *given), again.estimate(PULL, *given))
    other = dataclasses.replace(LINEAR, seed=1).estimate(PULL, *given)
    assert np.abs(LINEAR.estimate(PULL, *given) - other).max() > 1e-3


def test_a_measurement_beyond_all_particles_leaves_numbers():
    state = LINEAR.start(PULL[:, 0], np.zeros(4))
    state = LINEAR.step(state, PULL[:, 1], PULL[:, 0], np.full(4, 1e4))
    assert np.isfinite(LINEAR.bend_deg(state)).all()
    assert np.isfinite(LINEAR.half_width_deg(state)).all()
    np.testing.assert_allclose(state.weights.sum(axis=1), 1.0)


def test_it_is_tuned_on_training_records_and_knows_the_sensor(records, model, monkeypatch):
    """The tuned deviations make the measurements likelier than those where the search begins."""
    tune_filters(monkeypatch)
    records = [(pull[:60], bend[:60]) for pull, bend in records]
    known = Knowledge(T, {ColemanHodgdon.name: model}, records=records, seed=3)
    tuned = find_method("PF-tuned").build(known).with_sensor(Sensor(0.1))
    start = BootstrapFilter(model, T, measurement_variance=0.1, seed=3)
    pull, bend = (np.array(of) for of in zip(*records, strict=True))
    measurement = bend + np.sqrt(0.1) * np.random.default_rng(0).normal(size=bend.shape)
    given = pull, measurement, bend[:, 0] + [-15.0, 5.0, 12.0]
    assert log_likelihood(tuned, *given) > log_likelihood(start, *given)
    assert find_method("PF-tuned").given == ("R",)
