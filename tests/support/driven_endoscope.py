"""The ureteroscope, driven by a sine or a ramp."""

import numpy as np
from both_twins import Twin

from twin.preset.file import load_preset
from twin.preset.preset import Preset

AMPLITUDE = 4e-3  # [m]
SAMPLE_TIME = 0.02  # [s]
PRESET = load_preset("ureteroscope")


def sine(period: float, cycles: float) -> np.ndarray:
    """Pull at every sample [m], from mid-stroke; the period in seconds."""
    phase = np.arange(round(cycles * period / SAMPLE_TIME) + 1) * SAMPLE_TIME / period
    return AMPLITUDE * np.sin(2 * np.pi * phase)


def ramp_and_rest(pull: float, seconds: float = 3.0) -> np.ndarray:
    """From rest to `pull` at a steady speed, then a second of rest."""
    return np.concatenate([np.linspace(0, pull, round(seconds / SAMPLE_TIME)), np.full(50, pull)])


def loop_of(twin: Twin, preset: Preset, period: float, **options) -> tuple[np.ndarray, np.ndarray]:
    """Pull [mm] and bend [deg] of the second of two cycles; it starts and ends at mid-stroke, rising."""
    episode = twin.simulate(preset, sine(period, 2), SAMPLE_TIME, **options)
    start = round(period / SAMPLE_TIME)
    return episode.pull_mm[start:], episode.truth_deg[start:]
