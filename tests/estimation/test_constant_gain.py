"""The constant gain against eq. 10 written out by hand."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.active_model import ActiveModel
from twin.estimation.tuning import ConstantGain
from twin.hysteresis import ColemanHodgdon

A, B, C, T = 1.15, 22.38, 5.0, 0.1
MODEL = ColemanHodgdon(A, B, C)
PLAIN = ActiveModel(MODEL, T, measurement_variance=1.0)
GAINED = ConstantGain(**vars(PLAIN), gain=(0.3, 0.2))
PULL = 3 + np.sin(2 * np.pi * np.arange(200) * T / 12)
MEASUREMENT = MODEL.response(PULL, 60.0) + np.random.default_rng(0).normal(size=(4, len(PULL)))

gains = st.floats(0, 1)


@settings(max_examples=20)
@given(gain=st.tuples(gains, gains))
def test_filter_equals_equation_ten_after_a_textbook_filter(gain):
    H, K_ram = np.array([[1.0, 0.0]]), np.array(gain)
    x, P = np.array([75.0, 0.0]), np.diag(PLAIN.initial_variance)
    expected = [75.0]
    for k in range(1, len(PULL)):
        move = PULL[k] - PULL[k - 1]
        F = np.array([[1 - A * abs(move), T], [0.0, 1.0]])
        x = F @ x + np.array([A * abs(move) * B * PULL[k] + C * move, 0.0])
        P = F @ P @ F.T + np.diag(PLAIN.process_variance)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + 1.0)
        x, P = x + K @ (MEASUREMENT[0, k : k + 1] - H @ x), (np.eye(2) - K @ H) @ P
        x = x + K_ram * (MEASUREMENT[0, k] - x[0])
        expected.append(x[0])
    found = dataclasses.replace(GAINED, gain=gain).estimate(PULL, MEASUREMENT[:1], 75.0)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_no_gain_is_the_active_model_and_full_gain_believes_the_measurement():
    none, full = (dataclasses.replace(GAINED, gain=gain) for gain in ((0.0, 0.0), (1.0, 0.0)))
    expected = PLAIN.estimate(PULL, MEASUREMENT, 75.0)
    np.testing.assert_array_equal(none.estimate(PULL, MEASUREMENT, 75.0), expected)
    np.testing.assert_allclose(full.estimate(PULL, MEASUREMENT, 75.0)[:, 1:], MEASUREMENT[:, 1:], rtol=1e-12)
