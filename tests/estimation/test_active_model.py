"""The active model against a textbook Kalman filter: eq. 4 is affine in the state, so they agree."""

import dataclasses
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


def affine_system(now: float, before: float) -> tuple[np.ndarray, np.ndarray]:
    """F and u of x_k = F x_{k-1} + u, by writing eq. 4 out by hand."""
    move = now - before
    F = np.array([[1 - A * abs(move), SAMPLE_TIME], [0.0, 1.0]])
    return F, np.array([A * abs(move) * B * now + C * move, 0.0])


def textbook_kalman_filter(active_model: ActiveModel, measurement: np.ndarray, initial: float):
    """One filter, plain matrices, P = (I - K H) P; returns the means and the covariances."""
    H, Q = np.array([[1.0, 0.0]]), np.diag(active_model.process_variance)
    R = np.array([[active_model.measurement_variance]])
    x, P = np.array([initial, 0.0]), np.diag(active_model.initial_variance)
    means, covariances = [x], [P]
    for k in range(1, len(measurement)):
        F, u = affine_system(PULL[k], PULL[k - 1])
        x, P = F @ x + u, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ (measurement[k : k + 1] - H @ x), (np.eye(2) - K @ H) @ P
        means.append(x)
        covariances.append(P)
    return np.array(means), np.array(covariances)


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


variances = st.floats(1e-6, 1e3)


@settings(max_examples=20)
@given(
    q=st.tuples(variances, variances), r=variances, p=st.tuples(variances, variances), seed=st.integers(0, 99)
)
def test_filter_equals_the_textbook_kalman_filter(q, r, p, seed):
    tuned = dataclasses.replace(FILTER, process_variance=q, measurement_variance=r, initial_variance=p)
    measurement = noisy(1, seed)
    means, covariances = run_online(tuned, PULL, measurement, 80.0)
    expected_means, expected_covariances = textbook_kalman_filter(tuned, measurement[0], 80.0)
    np.testing.assert_allclose(means[..., 0], expected_means, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(covariances[..., 0], expected_covariances, rtol=1e-5, atol=1e-8 * max(*q, *p))


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


def test_innovations_of_a_filter_told_the_truth_are_white_and_of_the_predicted_variance():
    """Consistency: where the filter's own assumptions hold, normalised innovations are standard normal."""
    stated = dataclasses.replace(
        FILTER, process_variance=(0.05, 0.02), measurement_variance=2.0, initial_variance=(4.0, 1.0)
    )
    rng = np.random.default_rng(3)
    count = 200
    state = np.array([60.0, 0.0]) + rng.normal(size=(count, 2)) * np.sqrt(stated.initial_variance)
    pulls = np.repeat(PULL[:, None], count, axis=1)
    belief = stated.start(pulls[0], np.full(count, 60.0))
    innovations = []
    for k in range(1, len(PULL)):
        F, u = affine_system(PULL[k], PULL[k - 1])
        state = state @ F.T + u + rng.normal(size=(count, 2)) * np.sqrt(stated.process_variance)
        measured = state[:, 0] + np.sqrt(stated.measurement_variance) * rng.normal(size=count)
        predicted = stated.predict(belief, pulls[k], pulls[k - 1])
        spread = np.sqrt(predicted.covariance[0, 0] + stated.measurement_variance)
        innovations.append((measured - predicted.mean[0]) / spread)
        belief = stated.update(predicted, measured)
    z = np.array(innovations)
    standard_error = 1 / np.sqrt(z.size)
    assert abs(z.mean()) < 5 * standard_error
    assert abs(z.var() - 1) < 5 * np.sqrt(2) * standard_error
    assert abs(np.mean(z[1:] * z[:-1])) < 5 * standard_error
