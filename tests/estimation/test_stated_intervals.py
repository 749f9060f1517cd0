"""95 % intervals that filters state: they hold what they say where the world is as the filter believes."""

import numpy as np
import pytest
from models import COLEMAN_HODGDON

from twin.estimation.active_model import ActiveModel, KalmanActiveModel, UnscentedActiveModel
from twin.estimation.adaptive import AdaptiveActiveModel, BiasedActiveModel, RobustActiveModel
from twin.estimation.koopman import KoopmanFilter
from twin.evaluation.method import with_innovations
from twin.evaluation.metrics import interval_indices

T, Q, R, P = 0.1, (4e-3, 9e-2), 0.5, (25.0, 1.0)
RUNS, SAMPLES = 400, 200
STATED = {"model": COLEMAN_HODGDON, "sample_time": T, "process_variance": Q, "initial_variance": P}


def world():
    """Angles that move as eq. 4 says, with process noise Q and a wrong start of variance P; measured."""
    rng = np.random.default_rng(7)
    pull = 3 + np.sin(2 * np.pi * np.arange(SAMPLES) * T / 8)
    first = 60.0
    bend, error = first + np.sqrt(P[0]) * rng.standard_normal(RUNS), np.sqrt(P[1]) * rng.standard_normal(RUNS)
    bends = [bend]
    for k in range(1, SAMPLES):
        moved, _ = COLEMAN_HODGDON.step(bend, np.empty((0, RUNS)), np.full(RUNS, pull[k]), pull[k - 1])
        bend = moved + error * T + np.sqrt(Q[0]) * rng.standard_normal(RUNS)
        error = error + np.sqrt(Q[1]) * rng.standard_normal(RUNS)
        bends.append(bend)
    truth = np.array(bends).T
    measured = truth + np.sqrt(R) * rng.standard_normal(truth.shape)
    measured[:, 50:70] = np.nan  # the interval widens while nothing is seen
    return np.broadcast_to(pull, truth.shape), measured, first, truth


@pytest.mark.parametrize("filter_", [ActiveModel, KalmanActiveModel, UnscentedActiveModel])
def test_a_kalman_filter_is_as_sure_as_it_may_be(filter_):
    pull, measured, first, truth = world()
    estimate, half = filter_(**STATED, measurement_variance=R).estimate_with_interval(pull, measured, first)
    found = interval_indices((estimate - truth)[:, 1:], half[:, 1:])
    assert found["coverage95"] == pytest.approx(0.95, abs=0.01)
    assert found["nees"] == pytest.approx(1.0, abs=0.06)
    stated = filter_(**STATED, measurement_variance=R)
    variance, start = np.full(RUNS, R), np.full(RUNS, first)
    squares = with_innovations(stated, pull.T, measured.T, start, variance, range(20, SAMPLES))[2]
    assert squares.shape == (SAMPLES - 20, RUNS)
    assert np.isnan(squares[30:50]).all()  # a missing measurement has no innovation
    assert np.nanmean(squares) == pytest.approx(1.0, abs=0.04)


def test_one_stream_and_many_state_the_same_interval():
    pull, measured, first, _ = world()
    filter_ = ActiveModel(**STATED, measurement_variance=R)
    assert filter_.single().plain
    _, many = filter_.estimate_with_interval(pull[:2], measured[:2], first)
    _, one = filter_.estimate_with_interval(pull[0], measured[0], first)
    np.testing.assert_allclose(one[0], many[0], rtol=1e-9)


@pytest.mark.parametrize(
    "filter_",
    [
        BiasedActiveModel(**STATED, measurement_variance=R),
        RobustActiveModel(**STATED, measurement_variance=R),
        AdaptiveActiveModel(ActiveModel(**STATED, measurement_variance=R)),
        KoopmanFilter(np.zeros((2, 3)), np.zeros((2, 3)), 0.1, R),
    ],
    ids=lambda filter_: type(filter_).__name__,
)
def test_an_interval_narrows_with_measurements_and_widens_without(filter_):
    pull, measured, first, _ = world()
    _, half = filter_.estimate_with_interval(pull[:3], measured[:3], first)
    assert half.shape == (3, SAMPLES)
    assert (half > 0).all()
    assert (half[:, 49] < half[:, 0]).all()
    assert (half[:, 69] >= half[:, 49]).all()
