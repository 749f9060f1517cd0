"""Weights of channels: each costs the same by what is left of it, and noisy ones then count for less."""

import dataclasses

import numpy as np
import pytest
from calibrating import TRUTH, loops, noisy

from twin.calibration.objective import MOST, channels, residuals, scales_of, weighed


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
        factor = after.scales / scales_of(before)
        np.testing.assert_allclose(factor[1:] / factor[0], 1 / MOST, rtol=0.5)
    left, now = (residuals([TRUTH], some)[0] for some in (logs, weighed(logs, residuals([TRUTH], logs)[0])))
    assert now @ now == pytest.approx(left @ left)


def test_logs_that_leave_nothing_keep_their_scales():
    logs = loops(0.0)
    nothing = np.zeros(residuals([TRUTH], logs).shape[1])
    np.testing.assert_array_equal(scales_of(weighed(logs, nothing)[0]), scales_of(logs[0]))


def test_samples_of_a_short_log_weigh_as_those_of_a_long_one():
    long, short = noisy(2e-3, 5e-2)
    short = dataclasses.replace(short, fitted=short.fitted & (np.arange(len(short.fitted)) < 20))
    unfitted = long.only_predicted()
    logs = [long, short, unfitted]
    again = weighed(logs, residuals([TRUTH], logs)[0])
    now = residuals([TRUTH], again)[0]
    each = [float(np.mean(now[place] ** 2)) for of_log in channels(again)[:2] for place in of_log]
    np.testing.assert_allclose(each, each[0])
