"""Noise of the stereo sensor: as large as was measured, of its own shape, and alike from sample to sample."""

import numpy as np
import pytest

from twin.signals.noise import draw_errors, noise_variance
from twin.signals.sensor_errors import STEREO, stereo_noise

TIME = 0.02


def draw(bend_deg, level=0.0, seed=0):
    return draw_errors(STEREO, level, np.asarray(bend_deg, dtype=float), TIME, np.random.default_rng(seed))


def test_what_was_measured_is_within_the_bars():
    noise = stereo_noise()
    assert len(noise.errors_deg) >= 6
    assert noise.bends_deg[[0, -1]].tolist() == [-90, 90]
    assert np.sqrt(noise.variance) < 0.3
    assert np.abs(noise.errors_deg.mean()) < 0.1


def test_draws_over_the_grid_are_as_large_as_what_was_measured():
    sweep = np.linspace(-90, 90, 9001)
    squares = [np.mean(draw(sweep, seed=seed) ** 2) for seed in range(60)]
    assert np.mean(squares) == pytest.approx(noise_variance(STEREO, 0.0), rel=0.15)


def test_an_error_depends_on_the_angle_so_that_neighbours_are_alike():
    slow = 60 * np.sin(np.linspace(0, 2 * np.pi, 1000))
    alike = []
    for seed in range(20):
        error = draw(slow, seed=seed)
        alike.append(np.corrcoef(error[1:], error[:-1])[0, 1])
    assert np.mean(alike) > 0.5
    white = draw_errors("gaussian", 0.01, slow, TIME, np.random.default_rng(0))
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.15


def test_passes_leave_gaps_of_the_share_that_they_hide():
    noise, minutes, level = stereo_noise(), 60, 12.0
    bends = np.zeros(round(minutes * 60 / TIME))
    missing = np.isnan(draw(bends, level))
    once = level * noise.hides_per_pass * noise.hidden_s.mean() / 60  # gaps that meet count once
    assert missing.mean() == pytest.approx(1 - np.exp(-once), rel=0.15)
    gaps = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], missing.astype(int), [0]]))))[::2]
    assert gaps.min() * TIME > 0.05
    assert not np.isnan(draw(bends)).any()
