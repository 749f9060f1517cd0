"""Weights of channels: each costs the same by what is left of it, and noisy ones then count for less."""

import numpy as np
import pytest
from calibrating import TRUTH, loops, noisy

from twin.calibration.objective import channels, residuals, scales_of
from twin.calibration.weights import MOST, weighed


def test_scales_become_those_of_the_noise_and_the_cost_stays():
    logs = noisy(2e-3, 5e-2)
    left = residuals([TRUTH], logs)[0]
    again = weighed(logs, left)
    for log in again:
        assert log.scales[1] / log.scales[0] == pytest.approx(25, rel=0.2)
        assert log.scales[2] / log.scales[1] == pytest.approx(1, rel=0.2)
    now = residuals([TRUTH], again)[0]
    assert now @ now == pytest.approx(left @ left, rel=1e-6)
    shares = [now[place] @ now[place] for of_log in channels(again) for place in of_log]
    np.testing.assert_allclose(shares, np.mean(shares), rtol=1e-6)


def test_a_channel_that_is_met_exactly_does_not_outweigh_all_others():
    logs = noisy(2e-3, 0.0)
    for before, after in zip(logs, weighed(logs, residuals([TRUTH], logs)[0]), strict=True):
        np.testing.assert_allclose(after.scales[1:], scales_of(before)[1:] / MOST)


def test_logs_that_leave_nothing_keep_their_scales():
    logs = loops(0.0)
    nothing = np.zeros(residuals([TRUTH], logs).shape[1])
    np.testing.assert_array_equal(scales_of(weighed(logs, nothing)[0]), scales_of(logs[0]))
