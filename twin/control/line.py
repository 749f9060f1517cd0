"""Straight line between pull and bend: what control without hysteresis compensation goes by."""

import functools
from typing import NamedTuple

import numpy as np

from twin.preset.preset import Preset
from twin.simulation import simulate

_CYCLES, _PERIOD_S, _SAMPLE_TIME = 2, 10.0, 0.02


class Line(NamedTuple):
    """Bend as a linear function of the pull, on one stroke.

    Attributes:
        slope: [deg / mm].
        offset_deg: at no pull [deg].
        reached_deg: lowest and highest bend of the nominal twin on the stroke [deg].
    """

    slope: float
    offset_deg: float
    reached_deg: tuple[float, float]

    def pull_mm(self, bend_deg: float) -> float:
        """Return the pull that brings a bend, if there were no hysteresis [mm]."""
        return (bend_deg - self.offset_deg) / self.slope


@functools.lru_cache(maxsize=64)  # every trial of a comparison asks for the same few
def fit_line(preset: Preset, stroke_mm: tuple[float, float]) -> Line:
    """Return the line of least squares through the closed loop of an endoscope on a stroke [mm]."""
    low, high = stroke_mm
    time = np.arange(round(_CYCLES * _PERIOD_S / _SAMPLE_TIME)) * _SAMPLE_TIME
    pull_mm = (low + high) / 2 + (high - low) / 2 * np.sin(2 * np.pi * time / _PERIOD_S)
    episode = simulate(preset, pull_mm * 1e-3, _SAMPLE_TIME, physics="reduced")
    closed = slice(len(time) // _CYCLES, None)  # the first loop begins inside
    bend = episode.truth_deg[closed]
    slope, offset = np.polyfit(pull_mm[closed], bend, 1)
    return Line(float(slope), float(offset), (float(bend.min()), float(bend.max())))
