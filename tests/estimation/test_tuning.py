import dataclasses

import numpy as np
import pytest
from scipy import stats

from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.tuning import (
    ConstantGain,
    FixedNoiseActiveModel,
    draw_training_episodes,
    innovation_log_likelihood,
    tune_active_model,
    tune_constant_gain,
)
from twin.hysteresis import ColemanHodgdon

AT_REST = ColemanHodgdon(1.0, 1.0, 1.0)  # without motion theta is a random walk plus the integral of f


def simulate(q_bend, q_error, variance, count, samples, rng):
    """Draw angles and measurements from the filter's own model at rest, T = 0.1 s."""
    error = np.cumsum(np.sqrt(q_error) * rng.standard_normal((count, samples)), axis=1)
    steps = np.sqrt(q_bend) * rng.standard_normal((count, samples))
    steps[:, 1:] += 0.1 * error[:, :-1]
    bend = np.cumsum(steps, axis=1)
    return bend, bend + np.sqrt(variance) * rng.standard_normal((count, samples))


def test_likelihood_equals_the_joint_normal_density_of_the_measurements():
    filter_ = ActiveModel(AT_REST, 0.1, (0.02, 0.05), 0.3, (0.7, 0.2))
    samples = 6
    transition = np.array([[1, 0.1], [0, 1]])
    state, covariances = np.diag([0.7, 0.2]), []
    powers = [np.eye(2)]
    for _ in range(samples):
        powers.append(transition @ powers[-1])
        state = transition @ state @ transition.T + np.diag([0.02, 0.05])
        covariances.append(state)
    joint = np.array(
        [
            [(powers[abs(j - i)] @ covariances[min(i, j)])[0, 0] + 0.3 * (i == j) for j in range(samples)]
            for i in range(samples)
        ]
    )
    measurement = np.random.default_rng(0).standard_normal((3, samples + 1))
    expected = stats.multivariate_normal(np.zeros(samples), joint).logpdf(measurement[:, 1:]).sum()
    found = innovation_log_likelihood(filter_, np.zeros_like(measurement), measurement, np.zeros(3))
    assert found == pytest.approx(expected, rel=1e-10)


@pytest.mark.slow
def test_tuning_recovers_the_variances_that_made_the_data():
    rng = np.random.default_rng(1)
    bend, measurement = simulate(0.05, 0.02, 0.1, 12, 500, rng)
    start = ActiveModel(AT_REST, 0.1, measurement_variance=0.1)
    tuned = tune_active_model(start, np.zeros_like(bend), measurement, bend[:, 0])
    assert tuned.process_variance[0] == pytest.approx(0.05, rel=0.2)
    assert tuned.process_variance[1] == pytest.approx(0.02, rel=0.5)


def test_tuning_does_not_touch_the_noise_and_does_not_lose_likelihood():
    rng = np.random.default_rng(2)
    bend, measurement = simulate(0.5, 0.2, 0.1, 8, 100, rng)
    start = ActiveModel(AT_REST, 0.1, measurement_variance=0.1)
    initial = bend[:, 0] + rng.uniform(-20, 20, 8)
    tuned = tune_active_model(start, np.zeros_like(bend), measurement, initial)
    assert tuned.measurement_variance == start.measurement_variance
    assert dataclasses.replace(
        tuned, process_variance=(1, 1), initial_variance=(1, 1)
    ) == dataclasses.replace(start, process_variance=(1, 1), initial_variance=(1, 1))
    data = (np.zeros_like(bend), measurement, initial)
    assert innovation_log_likelihood(tuned, *data) > innovation_log_likelihood(start, *data) + 100


@pytest.mark.slow
def test_tuning_recovers_the_noise_too_where_it_is_asked_to():
    rng = np.random.default_rng(4)
    bend, measurement = simulate(0.05, 0.02, 0.4, 80, 120, rng)
    start = ActiveModel(AT_REST, 0.1, measurement_variance=0.05)
    data = (np.zeros_like(bend), measurement, bend[:, 0])
    tuned = tune_active_model(start, *data, fit_measurement_variance=True)
    assert tuned.measurement_variance == pytest.approx(0.4, rel=0.1)
    assert tuned.process_variance[0] == pytest.approx(0.05, rel=0.3)
    true_filter = dataclasses.replace(
        start, process_variance=(0.05, 0.02), measurement_variance=0.4, initial_variance=(1e-6, 0.02)
    )
    assert innovation_log_likelihood(tuned, *data) > innovation_log_likelihood(true_filter, *data) - 0.5


def test_filter_with_fitted_noise_keeps_it_and_the_other_takes_the_sensors():
    rng = np.random.default_rng(5)
    bend, measurement = simulate(0.5, 0.2, 0.1, 2, 15, rng)
    data = (np.zeros_like(bend), measurement, bend[:, 0])
    start = ActiveModel(AT_REST, 0.1)
    fitted = tune_active_model(start, *data, fit_measurement_variance=True)
    assert fitted.with_sensor(Sensor(9.0)) == fitted
    assert tune_active_model(start, *data).with_sensor(Sensor(9.0)).measurement_variance == 9.0
    plain = ActiveModel(**vars(fitted))
    np.testing.assert_array_equal(fitted.estimate(*data), plain.estimate(*data))
    assert isinstance(fitted, FixedNoiseActiveModel)


def test_constant_gain_has_the_least_rmse_of_a_grid(model, records):
    task = TrainingTask(*stack_records(records), noise_level=1.0)
    start = ActiveModel(model, 0.1, measurement_variance=1.0)
    episodes = draw_training_episodes(task, 0)

    def rmse(filter_):
        estimate = filter_.estimate(episodes.pull_mm, episodes.measurement_deg, episodes.initial_bend_deg)
        return np.sqrt(np.mean((estimate - episodes.bend_deg)[:, 1:] ** 2))

    tuned = tune_constant_gain(start, task, 0)
    grid = [(bend, error) for bend in np.linspace(0, 1, 11) for error in np.linspace(0, 1, 6)]
    assert rmse(tuned) <= min(rmse(ConstantGain(**vars(start), gain=gain)) for gain in grid) + 1e-4
    assert 0 <= min(tuned.gain) <= max(tuned.gain) <= 1
