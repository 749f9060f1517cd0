"""The filter with a bias against filterpy's with three states, and on biased noise of its own model."""

import dataclasses

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.active_model import ActiveModel
from twin.estimation.adaptive import BiasedActiveModel
from twin.hysteresis import ColemanHodgdon

A, B, C, T = 1.15, 22.38, 5.0, 0.1
MODEL = ColemanHodgdon(A, B, C)
PLAIN = ActiveModel(MODEL, T, (1e-4, 1e-6), 1.0, (4.0, 1e-4))
BIASED = BiasedActiveModel(**vars(PLAIN))
PULL = 3 + np.sin(2 * np.pi * np.arange(900) * T / 12)

variances = st.floats(1e-6, 1e2)


def run(filter_: BiasedActiveModel, measurement: np.ndarray, initial: np.ndarray):
    belief = filter_.start(np.full(len(measurement), PULL[0]), initial)
    for k in range(1, measurement.shape[1]):
        now, before = np.full(len(measurement), PULL[k]), np.full(len(measurement), PULL[k - 1])
        belief = filter_.step(belief, now, before, measurement[:, k])
    return belief


def simulate(count: int, bias: np.ndarray, seed: int):
    """Draw truth and biased measurements from the filter's own model, and first estimates from its prior."""
    rng = np.random.default_rng(seed)
    bend = 60 + 2 * rng.normal(size=count)
    error = 1e-2 * rng.normal(size=count)
    truth = [bend]
    for k in range(1, len(PULL)):
        bend = MODEL.step(bend, np.empty((0, count)), PULL[k], PULL[k - 1])[0] + T * error
        bend = bend + 1e-2 * rng.normal(size=count)
        error = error + 1e-3 * rng.normal(size=count)
        truth.append(bend)
    truth = np.array(truth).T
    return truth, truth + bias + rng.normal(size=truth.shape)


@settings(max_examples=15)
@given(
    q=st.tuples(variances, variances, variances),
    p=st.tuples(variances, variances, variances),
    r=variances,
    seed=st.integers(0, 99),
)
def test_filter_equals_filterpy_with_three_states(q, p, r, seed):
    filter_ = BiasedActiveModel(MODEL, T, q[:2], r, p[:2], p[2], q[2])
    measurement = MODEL.response(PULL[:200], 60.0) + np.random.default_rng(seed).normal(size=200)
    peer = KalmanFilter(dim_x=3, dim_z=1, dim_u=3)
    peer.x, peer.P, peer.Q, peer.R = np.array([80.0, 0, 0]), np.diag(p), np.diag(q), np.array([[r]])
    peer.H = np.array([[1.0, 0.0, 1.0]])
    for k in range(1, 200):
        move = PULL[k] - PULL[k - 1]
        F = np.array([[1 - A * abs(move), T, 0], [0, 1, 0], [0, 0, 1]])
        peer.predict(u=np.array([A * abs(move) * B * PULL[k] + C * move, 0, 0]), B=np.eye(3), F=F)
        peer.update(measurement[k])
    belief = run(filter_, measurement[None], np.array([80.0]))
    np.testing.assert_allclose(belief.mean[:, 0], peer.x, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(belief.covariance[:, :, 0], peer.P, rtol=1e-4, atol=1e-7 * max(*p, *q))


@pytest.mark.parametrize("bias", [-1.5, 0.8])
def test_bias_is_found_where_the_model_pins_the_angle(bias):
    truth, measurement = simulate(50, np.array(bias), 0)
    filter_ = dataclasses.replace(BIASED, bias_process_variance=0.0)
    belief = run(filter_, measurement, np.full(50, 60.0))
    assert belief.mean[2].mean() == pytest.approx(bias, abs=0.1)
    assert belief.covariance[2, 2].max() < 0.05
    assert abs(np.mean(belief.mean[0] - truth[:, -1])) < 0.15
    plain = PLAIN.estimate(PULL, measurement, 60.0)[:, -1]
    assert abs(np.mean(plain - truth[:, -1])) > 0.5 * abs(bias)


def test_errors_of_the_bias_are_as_large_as_the_filter_says():
    """Consistency: biases drawn from the prior are missed by the predicted variance (one chi-square each)."""
    count = 400
    bias = np.random.default_rng(3).normal(size=(count, 1))
    _, measurement = simulate(count, bias, 4)
    filter_ = dataclasses.replace(BIASED, bias_process_variance=0.0)
    belief = run(filter_, measurement, np.full(count, 60.0))
    normalised = (belief.mean[2] - bias[:, 0]) ** 2 / belief.covariance[2, 2]
    assert normalised.mean() == pytest.approx(1, abs=5 * np.sqrt(2 / count))


def test_bias_stays_unknown_where_the_tendon_rests():
    """Nothing pins the angle there: angle and bias share what the measurements say by their variances."""
    filter_ = BiasedActiveModel(MODEL, T, (1e-9, 1e-9), 1.0, (1.0, 1e-9), 1.0, 0.0)
    belief = filter_.start(np.array([3.0]), np.array([60.0]))
    for _ in range(500):
        belief = filter_.step(belief, np.array([3.0]), np.array([3.0]), np.array([62.0]))
    np.testing.assert_allclose(belief.mean[[0, 2], 0], [61.0, 1.0], atol=0.01)
    assert belief.covariance[2, 2, 0] == pytest.approx(0.5, abs=0.01)


def test_filter_that_excludes_a_bias_is_the_active_model():
    _, measurement = simulate(3, np.array(0.7), 6)
    never = dataclasses.replace(BIASED, bias_variance=0.0, bias_process_variance=0.0)
    expected = PLAIN.estimate(PULL, measurement, 60.0)
    np.testing.assert_allclose(never.estimate(PULL, measurement, 60.0), expected, rtol=1e-12)
