"""The cost of a preset: nothing for the truth, mean squares in units of the bars; weights of channels."""

import dataclasses

import numpy as np
import pytest
from calibrating import TRUTH, changed, loops, noisy

from twin.calibration import objective
from twin.calibration.objective import (
    BEND_SCALE,
    OFFSET_SPREAD,
    TENSION_SHARE,
    channels,
    predict,
    residuals,
    weighed,
)


def test_truth_costs_nothing_and_residuals_are_in_units_of_the_bars():
    logs = loops(0.5)
    assert (residuals([TRUTH], logs) ** 2).sum() < 1e-12
    off = TRUTH.replace(initial_bend=0.2)
    (episode,), values = predict([off], logs)[0], residuals([off], logs)[0]
    bend = np.mean((episode.bend - logs[0].episode.bend) ** 2) / BEND_SCALE**2
    share = TENSION_SHARE * np.ptp(logs[0].tension)
    tension = np.mean((episode.tension - logs[0].tension) ** 2) / share**2
    assert (values**2).sum() == pytest.approx(bend + tension)


def measured_higher(origins, degrees):
    """Return logs of the true endoscope by sensors whose zeros are unknown, that read so much too high."""
    (log,) = loops(0.5)
    return [
        dataclasses.replace(
            changed(log, bend=log.episode.bend + np.radians(high)), offset=True, origin=origin
        )
        for origin, high in zip(origins, degrees, strict=True)
    ]


def cost(logs, weight=0.0):
    return (residuals([TRUTH], logs, weight=weight) ** 2).sum()


def test_windows_of_a_file_share_the_zero_of_its_sensor_and_other_logs_have_their_own():
    assert cost(measured_higher([None, None], [3, 1])) < 1e-12
    assert cost(measured_higher(["a", "b"], [2, 2])) < 1e-12  # one window does not determine the zero
    assert cost(measured_higher(["a", "a", "b", "b"], [2, 2, -2, -2])) == pytest.approx(4 * 2**2)
    assert cost(measured_higher(["a", "a"], [3, 1])) == pytest.approx(2 * 2**2)
    assert cost(measured_higher(["a", "a"], [1, -1])) < 1e-12
    apart = 0.1**2 * 2 * (np.radians(1) / OFFSET_SPREAD) ** 2
    assert cost(measured_higher(["a", "a"], [1, -1]), weight=0.1) == pytest.approx(apart)


def test_a_window_that_could_not_be_simulated_leaves_the_zero_to_the_others(monkeypatch):
    logs = measured_higher(["a", "a", "a"], [2, 2, 2])
    whole = residuals([TRUTH], logs)
    simulated = predict([TRUTH], logs)[0]
    monkeypatch.setattr(objective, "predict", lambda *_: [[None, *simulated[1:]]])
    failed = residuals([TRUTH], logs)
    assert failed.shape == whole.shape
    one = whole.shape[1] // 3
    np.testing.assert_allclose(failed[0, one:], whole[0, one:])
    assert failed[0, :one].min() > 1


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
