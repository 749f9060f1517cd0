"""The active model on records and streams, and its derivative; `test_kalman` compares it with filterpy."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.active_model import ActiveModel
from twin.estimation.gaussian import Belief
from twin.hysteresis import ColemanHodgdon
from twin.hysteresis.bouc_wen import BoucWen

A, B, C = 1.15, 22.38, 5.0
SAMPLE_TIME = 0.1
FILTER = ActiveModel(ColemanHodgdon(A, B, C), SAMPLE_TIME, measurement_variance=1.0)
PULL = 3 + np.sin(2 * np.pi * np.arange(400) * SAMPLE_TIME / 12)


def truth(disturbance: float = 0.0, pull: np.ndarray = PULL) -> np.ndarray:
    """Eq. 4 as a loop, with a constant error f [deg / s]."""
    bend = [60.0]
    for before, now in itertools.pairwise(pull):
        drive = A * abs(now - before) * (B * now - bend[-1]) + C * (now - before)
        bend.append(bend[-1] + drive + disturbance * SAMPLE_TIME)
    return np.array(bend)


def run_online(active_model: ActiveModel, pull: np.ndarray, measurement: np.ndarray, initial: np.ndarray):
    """Means (N, 2, B) and covariances (N, 2, 2, B), one sample at a time; pull (N,) or (B, N)."""
    pulls = np.broadcast_to(pull, measurement.shape).T
    belief = active_model.start(pulls[0], np.broadcast_to(np.asarray(initial, float), len(measurement)))
    beliefs = [belief]
    for k in range(1, len(pulls)):
        belief = active_model.step(belief, pulls[k], pulls[k - 1], measurement[:, k])
        beliefs.append(belief)
    return np.array([b.mean for b in beliefs]), np.array([b.covariance for b in beliefs])


def noisy(count: int, seed: int = 0) -> np.ndarray:
    return truth() + np.random.default_rng(seed).normal(size=(count, len(PULL)))


def test_online_form_equals_whole_records_and_does_not_use_the_first_measurement():
    measurement, initial = noisy(3), np.array([60.0, 70.0, 80.0])
    means, _ = run_online(FILTER, PULL, measurement, initial)
    whole = FILTER.estimate(PULL, measurement, initial)
    np.testing.assert_array_equal(means[:, 0].T, whole)
    assert (whole[:, 0] == initial).all()
    unread = measurement.copy()
    unread[:, 0] = np.nan  # the first estimate is given
    np.testing.assert_array_equal(FILTER.estimate(PULL, unread, initial), whole)


@settings(max_examples=50)
@given(bend=st.floats(-60, 140), error=st.floats(-5, 5), move=st.floats(-0.4, 0.4))
def test_transition_is_the_derivative_of_the_prediction(bend, error, move):
    """On a nonlinear model: P from the identity is F F^T, with F by differences of the mean (eq. 7)."""
    tuned = ActiveModel(BoucWen(22.0, -15.0, 1.2, 1.5, 2.0), SAMPLE_TIME, (0.0, 0.0))
    before, now = np.array([3.0]), np.array([3.0 + move])

    def predicted(*state):
        belief = Belief(np.array(state)[:, None], np.eye(2)[..., None], np.empty((0, 1)))
        return tuned.predict(belief, now, before)

    h = 1e-5
    F = np.stack(
        [
            (predicted(bend + h, error).mean - predicted(bend - h, error).mean)[:, 0] / (2 * h),
            (predicted(bend, error + h).mean - predicted(bend, error - h).mean)[:, 0] / (2 * h),
        ],
        axis=1,
    )
    np.testing.assert_allclose(predicted(bend, error).covariance[..., 0], F @ F.T, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("disturbance", [-3.0, 0.7])
def test_estimated_error_of_the_model_converges_to_a_constant_disturbance(disturbance):
    pull = np.tile(PULL[:360], 4)
    exact = truth(disturbance, pull)
    means, _ = run_online(FILTER, pull, exact[None], 60.0)
    np.testing.assert_allclose(means[-100:, 1, 0], disturbance, rtol=1e-6)
    np.testing.assert_allclose(means[-100:, 0, 0], exact[-100:], atol=1e-6)


def test_with_the_papers_variances_a_wrong_start_is_lost_in_about_five_seconds():
    """As the paper reports of AM, whose Q is small on purpose; ten times Q takes one second."""
    paper = ActiveModel(FILTER.model, SAMPLE_TIME)
    off = np.abs(paper.estimate(PULL, truth()[None], 80.0)[0] - truth())
    lost_s = np.flatnonzero(off > 0.5)[-1] * SAMPLE_TIME
    assert 3 < lost_s < 7
