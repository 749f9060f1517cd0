"""The adaptive filter against the algorithm as its authors print it, and on noise of another variance."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.active_model import ActiveModel
from twin.estimation.adaptive import ITERATIONS, AdaptiveActiveModel
from twin.estimation.estimator import Sensor
from twin.hysteresis import ColemanHodgdon

A, B, C, T = 1.15, 22.38, 5.0, 0.1
MODEL = ColemanHodgdon(A, B, C)
PLAIN = ActiveModel(MODEL, T, measurement_variance=1.0)
PULL = 3 + np.sin(2 * np.pi * np.arange(1200) * T / 12)
TRUTH = MODEL.response(PULL, 60.0)


def run(filter_: AdaptiveActiveModel, measurement: np.ndarray, initial: float = 60.0):
    """(N, B) found R after each sample, and the last state."""
    count = len(measurement)
    state = filter_.start(np.full(count, PULL[0]), np.full(count, initial))
    found = [state.measurement_variance]
    for k in range(1, measurement.shape[1]):
        pull, previous = np.full(count, PULL[k]), np.full(count, PULL[k - 1])
        state = filter_.step(state, pull, previous, measurement[:, k])
        found.append(state.measurement_variance)
    return np.array(found), state


def printed_algorithm(measurement, forgetting, shape, variance, initial):
    """Table I of Sarkka and Nummenmaa 2009, one filter with plain matrices; returns angles and R."""
    H, Q = np.array([[1.0, 0.0]]), np.diag(PLAIN.process_variance)
    m, P = np.array([initial, 0.0]), np.diag(PLAIN.initial_variance)
    scale, angles, found = shape * variance, [initial], [variance]
    for k in range(1, len(measurement)):
        move = PULL[k] - PULL[k - 1]
        F = np.array([[1 - A * abs(move), T], [0.0, 1.0]])
        m = F @ m + np.array([A * abs(move) * B * PULL[k] + C * move, 0.0])
        P = F @ P @ F.T + Q
        shape, kept = forgetting * shape + 0.5, forgetting * scale
        scale = kept
        for _ in range(ITERATIONS):
            S = H @ P @ H.T + scale / shape
            K = P @ H.T / S
            m_new, P_new = m + K @ (measurement[k] - H @ m), P - K @ S @ K.T
            scale = kept + 0.5 * (measurement[k] - (H @ m_new)[0]) ** 2 + 0.5 * (H @ P_new @ H.T)[0, 0]
        m, P = m_new, P_new
        angles.append(m[0])
        found.append(scale / shape)
    return np.array(angles), np.array(found)


@settings(max_examples=10)
@given(
    forgetting=st.floats(0.8, 1.0),
    shape=st.floats(0.5, 50),
    variance=st.floats(0.01, 100),
    seed=st.integers(0, 99),
)
def test_filter_equals_the_printed_algorithm(forgetting, shape, variance, seed):
    measurement = (TRUTH + np.random.default_rng(seed).normal(size=TRUTH.shape))[:150]
    stated = dataclasses.replace(PLAIN, measurement_variance=variance)
    filter_ = AdaptiveActiveModel(stated, forgetting, shape)
    angles, found = printed_algorithm(measurement, forgetting, shape, variance, 63.0)
    np.testing.assert_allclose(filter_.estimate(PULL[:150], measurement, 63.0)[0], angles, rtol=1e-9)
    np.testing.assert_allclose(run(filter_, measurement[None], 63.0)[0][:, 0], found, rtol=1e-8)


@pytest.mark.parametrize("stated", [0.02, 50.0])
def test_filter_finds_the_variance_from_a_wrong_one(stated):
    measurement = TRUTH + 1.5 * np.random.default_rng(0).normal(size=(100, len(TRUTH)))
    found, _ = run(AdaptiveActiveModel(PLAIN).with_sensor(Sensor(stated)), measurement)
    assert found[0] == pytest.approx(stated)
    assert np.median(found[-1]) == pytest.approx(1.5**2, rel=0.1)


def test_forgetting_follows_a_change_of_the_noise_within_its_memory():
    spread = np.where(np.arange(len(TRUTH)) < 600, 0.5, 2.0)
    measurement = TRUTH + spread * np.random.default_rng(2).normal(size=(100, len(TRUTH)))
    found, _ = run(AdaptiveActiveModel(PLAIN, forgetting=0.98), measurement)
    never, _ = run(AdaptiveActiveModel(PLAIN, forgetting=1.0), measurement)
    assert np.median(found[599]) == pytest.approx(0.25, rel=0.15)
    assert np.median(found[600 + 150]) == pytest.approx(4.0, rel=0.15)  # 150 samples: three memories
    assert np.median(never[600 + 150]) < 2.0


@pytest.mark.parametrize("wrong", [{"forgetting": 0.0}, {"forgetting": 1.1}, {"first_shape": 0.0}])
def test_parameters_out_of_range_are_refused(wrong):
    with pytest.raises(ValueError, match=str(next(iter(wrong.values())))):
        AdaptiveActiveModel(PLAIN, **wrong)
