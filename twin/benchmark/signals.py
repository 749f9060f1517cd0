"""Command signals of the benchmarks: sinusoids for loops, random closed cycles for the second law."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SAMPLE_TIME = 0.02
"""Time between two samples [s]."""


def sinusoid(amplitude: float, period: float, cycles: float) -> Array:
    """Return a sinusoid from the middle of the stroke, (N,) [m], sampled at `SAMPLE_TIME`."""
    time = np.arange(round(cycles * period / SAMPLE_TIME) + 1) * SAMPLE_TIME
    wave: Array = amplitude * np.sin(2 * np.pi * time / period)
    return wave


def random_cycles(count: int, amplitude: float, period: float, rng: np.random.Generator) -> Array:
    """Return closed cycles of four random harmonics, between 1/8 and all of the amplitude, (count, N) [m].

    The first and the last sample of a cycle are the same.
    """
    phase = np.linspace(0, 2 * np.pi, round(period / SAMPLE_TIME) + 1)
    harmonics = np.arange(1, 5)[:, None, None]
    strengths = rng.normal(size=(4, count, 1)) / harmonics
    phases = rng.uniform(0, 2 * np.pi, (4, count, 1))
    waves = (strengths * np.sin(harmonics * phase + phases)).sum(axis=0)
    sizes = rng.uniform(amplitude / 8, amplitude, (count, 1))
    scaled: Array = waves * sizes / np.abs(waves).max(axis=1, keepdims=True)
    return scaled
