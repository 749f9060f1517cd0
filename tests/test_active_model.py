"""The active model against textbook Kalman filters: eq. 4 is affine in the state, so they agree."""

import dataclasses
import itertools

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.active_model import (
    ActiveModel,
    active_model_step,
    estimate_active_model,
    initial_belief,
    predict,
    update,
)
from twin.hysteresis import ColemanHodgdon

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


def run_online(active_model: ActiveModel, pull: np.ndarray, measurement: np.ndarray, initial):
    """Means (N, B, 2) and covariances (N, B, 2, 2), one sample at a time."""
    beliefs = [initial_belief(active_model, initial)]
    for k in range(1, measurement.shape[1]):
        beliefs.append(active_model_step(active_model, beliefs[-1], pull[k], pull[k - 1], measurement[:, k]))
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
    np.testing.assert_allclose(means[:, 0], expected_means, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(covariances[:, 0], expected_covariances, rtol=1e-5, atol=1e-8 * max(*q, *p))


def test_filter_equals_filterpy():
    measurement = noisy(1)
    peer = KalmanFilter(dim_x=2, dim_z=1, dim_u=2)
    peer.x = np.array([80.0, 0.0])
    peer.P = np.diag(FILTER.initial_variance)
    peer.Q = np.diag(FILTER.process_variance)
    peer.H = np.array([[1.0, 0.0]])
    peer.R = np.array([[FILTER.measurement_variance]])
    expected = [80.0]
    for k in range(1, len(PULL)):
        F, u = affine_system(PULL[k], PULL[k - 1])
        peer.predict(u=u, B=np.eye(2), F=F)
        peer.update(measurement[0, k])
        expected.append(peer.x[0])
    estimate = estimate_active_model(FILTER, PULL, measurement, 80.0)
    np.testing.assert_allclose(estimate[0], expected, rtol=1e-11)


def test_batch_of_filters_equals_single_filters():
    measurement, initial = noisy(5), np.array([40.0, 50.0, 60.0, 70.0, 80.0])
    batch = estimate_active_model(FILTER, PULL, measurement, initial)
    for row in range(5):
        single = estimate_active_model(FILTER, PULL, measurement[row], initial[row])
        np.testing.assert_allclose(batch[row], single[0], rtol=1e-12)


def test_filters_of_a_batch_may_follow_their_own_commands():
    pulls = np.stack([PULL, PULL[::-1]])
    measurement = noisy(2)
    belief = initial_belief(FILTER, [60.0, 60.0])
    for k in range(1, len(PULL)):
        belief = active_model_step(FILTER, belief, pulls[:, k], pulls[:, k - 1], measurement[:, k])
    for row in range(2):
        means, covariances = run_online(FILTER, pulls[row], measurement[row : row + 1], 60.0)
        np.testing.assert_allclose(belief.mean[row], means[-1, 0], rtol=1e-12)
        np.testing.assert_allclose(belief.covariance[row], covariances[-1, 0], rtol=1e-12)


def test_online_form_equals_whole_records_and_is_predict_then_update():
    measurement = noisy(3)
    means, _ = run_online(FILTER, PULL, measurement, [60.0, 70.0, 80.0])
    whole = estimate_active_model(FILTER, PULL, measurement, np.array([60.0, 70.0, 80.0]))
    np.testing.assert_array_equal(means[:, :, 0].T, whole)
    assert (whole[:, 0] == [60.0, 70.0, 80.0]).all()
    unread = measurement.copy()
    unread[:, 0] = np.nan  # the first estimate is given, the first measurement not used
    np.testing.assert_array_equal(estimate_active_model(FILTER, PULL, unread, [60.0, 70.0, 80.0]), whole)


@pytest.mark.parametrize(
    "tuned",
    [
        FILTER,
        dataclasses.replace(
            FILTER, process_variance=(1e-9, 1e-9), measurement_variance=1e-6, initial_variance=(1e6, 1e6)
        ),
    ],
    ids=["paper", "badly scaled"],
)
def test_covariance_stays_symmetric_and_positive_definite(tuned):
    pull = 3 + np.sin(2 * np.pi * np.arange(100_001) * SAMPLE_TIME / 12)
    belief = initial_belief(tuned, 60.0)
    covariance = np.empty((len(pull), 2, 2))
    for k in range(1, len(pull)):
        belief = active_model_step(tuned, belief, pull[k], pull[k - 1], 60.0)
        covariance[k] = belief.covariance[0]
    covariance = covariance[1:]
    assert np.array_equal(covariance[:, 0, 1], covariance[:, 1, 0])
    assert (covariance[:, 0, 0] > 0).all()
    assert (np.linalg.det(covariance) > 0).all()


def test_measurement_reduces_variance_and_prediction_raises_the_total():
    belief = initial_belief(FILTER, 60.0)
    for k in range(1, 50):
        predicted = predict(FILTER, belief, PULL[k], PULL[k - 1])
        belief = update(FILTER, predicted, 60.0)
        assert belief.covariance[0, 0, 0] < predicted.covariance[0, 0, 0]
        assert belief.covariance[0, 0, 0] < FILTER.measurement_variance
        assert belief.covariance[0, 1, 1] <= predicted.covariance[0, 1, 1]


def test_wrong_initial_estimate_is_forgotten_without_noise_and_model_error():
    pull = np.tile(PULL[:360], 4)
    exact = truth(pull=pull)
    estimate = estimate_active_model(FILTER, pull, exact[None], 60.0 + 20)[0]
    assert abs(estimate[1] - exact[1]) > 10
    assert np.abs(estimate - exact)[-100:].max() < 1e-6


@pytest.mark.parametrize("disturbance", [-3.0, 0.7])
def test_estimated_error_of_the_model_converges_to_a_constant_disturbance(disturbance):
    pull = np.tile(PULL[:360], 4)
    exact = truth(disturbance, pull)
    means, _ = run_online(FILTER, pull, exact[None], 60.0)
    np.testing.assert_allclose(means[-100:, 0, 1], disturbance, rtol=1e-6)
    np.testing.assert_allclose(means[-100:, 0, 0], exact[-100:], atol=1e-6)


def test_innovations_of_a_filter_told_the_truth_are_white_and_of_the_predicted_variance():
    """Consistency: where the filter's own assumptions hold, normalised innovations are standard normal."""
    told = dataclasses.replace(
        FILTER, process_variance=(0.05, 0.02), measurement_variance=2.0, initial_variance=(4.0, 1.0)
    )
    rng = np.random.default_rng(3)
    count = 200
    state = np.array([60.0, 0.0]) + rng.normal(size=(count, 2)) * np.sqrt(told.initial_variance)
    belief = initial_belief(told, np.full(count, 60.0))
    innovations = []
    for k in range(1, len(PULL)):
        F, u = affine_system(PULL[k], PULL[k - 1])
        state = state @ F.T + u + rng.normal(size=(count, 2)) * np.sqrt(told.process_variance)
        measured = state[:, 0] + np.sqrt(told.measurement_variance) * rng.normal(size=count)
        predicted = predict(told, belief, PULL[k], PULL[k - 1])
        spread = np.sqrt(predicted.covariance[:, 0, 0] + told.measurement_variance)
        innovations.append((measured - predicted.mean[:, 0]) / spread)
        belief = update(told, predicted, measured)
    z = np.array(innovations)
    standard_error = 1 / np.sqrt(z.size)
    assert abs(z.mean()) < 5 * standard_error
    assert abs(z.var() - 1) < 5 * np.sqrt(2) * standard_error
    assert abs(np.mean(z[1:] * z[:-1])) < 5 * standard_error
