"""Command signals: pulling distance over time; sinusoids, decaying ones, triangles, multi-sines and steps.

Every signal starts at the middle of its stroke interval or on its way through it, stays inside the interval
and is a pure function of its arguments and of the random generator.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

Array = NDArray[np.float64]
SETTLE_SECONDS = 1.0


def command(
    kind: str, stroke: tuple[float, float], seconds: float, sample_time: float, rng: np.random.Generator
) -> Array:
    """Draw a random command signal (N,) [m] of a kind of `SIGNALS` over a stroke interval [m].

    The generator draws period, phase and levels; N = seconds / sample_time.
    """
    if kind not in SIGNALS:
        raise InputError(f"unknown signal {kind!r}; valid: {', '.join(SIGNALS)}")
    low, high = stroke
    if not (np.isfinite([low, high]).all() and low < high):
        raise InputError(f"stroke [{low * 1e3:g}, {high * 1e3:g}] mm: the first must be below the second")
    if not (np.isfinite([seconds, sample_time]).all() and sample_time > 0 and seconds >= 2 * sample_time):
        raise InputError(f"{seconds:g} s at a sample time of {sample_time:g} s: needs at least two samples")
    time = np.arange(round(seconds / sample_time), dtype=float) * sample_time
    unit = SIGNALS[kind](time, rng)  # in [-1, 1]
    return (low + high) / 2 + (high - low) / 2 * unit


def approach(start: float, sample_time: float, speed: float = 2e-3) -> Array:
    """Return the path (M,) [m] from the straight endoscope at rest to the first sample of a record.

    A record that starts inside a stroke needs it: the memory of the friction is part of the state. The path
    rises with a smooth (cosine) speed profile of mean `speed` [m / s], then rests for a second.
    """
    ramp = start * _rise(max(round(abs(start) / speed / sample_time), 1))
    return np.concatenate([ramp, np.full(round(SETTLE_SECONDS / sample_time), start)])


def paths_to(turns: Array, pull: Array, sample_time: float, speed: float = 4e-3) -> Array:
    """Return paths (M, N) [m] from the straight endoscope by way of turning points (M, K) to pulls (M,) [m].

    They are as long as the longest needs at a mean `speed` [m / s], and have a smooth (cosine) profile.
    """
    ends = np.column_stack([np.zeros(len(turns)), turns, pull])
    legs = []
    for begin, end in zip(ends.T[:-1], ends.T[1:], strict=True):
        count = max(int(np.ceil(np.abs(end - begin).max() / speed / sample_time)), 1)
        legs.append(begin[:, None] + (end - begin)[:, None] * _rise(count))
    return np.concatenate(legs, axis=1)


def _rise(count: int) -> Array:
    """Return samples (count,) that rise from above 0 to 1 with a smooth (cosine) speed profile."""
    share: Array = (1 - np.cos(np.pi * np.arange(1, count + 1) / count)) / 2
    return share


def check_finite(pull: Array) -> None:
    """Check that every sample of a command is finite."""
    bad = np.flatnonzero(~np.isfinite(pull))
    if bad.size:
        first = bad[0]
        raise InputError(f"the command is {pull[first]} at sample {first}: every sample must be finite")


def _sine(time: Array, rng: np.random.Generator) -> Array:
    wave: Array = np.sin(2 * np.pi * time / rng.uniform(10.0, 20.0))
    return wave


def _decaying_sine(time: Array, rng: np.random.Generator) -> Array:
    period = rng.uniform(8.0, 15.0)
    wave: Array = np.exp(-rng.uniform(1.0, 2.0) * time / time[-1]) * np.sin(2 * np.pi * time / period)
    return wave


def _triangle(time: Array, rng: np.random.Generator) -> Array:
    phase = time / rng.uniform(10.0, 20.0)
    return 1 - 4 * np.abs((phase + 0.75) % 1 - 0.5)


def _multi_sine(time: Array, rng: np.random.Generator) -> Array:
    periods = rng.uniform(8.0, 30.0, size=4)
    phases = rng.uniform(0, 2 * np.pi, size=4)
    wave = np.sin(2 * np.pi * time[:, None] / periods + phases).sum(axis=1)
    scaled: Array = wave / max(np.abs(wave).max(), 1.0)  # a short record need not span the stroke
    return scaled


def _random_steps(time: Array, rng: np.random.Generator) -> Array:
    """Return random levels, reached at a bounded speed and held: steps as a motor makes them."""
    hold, rise = 3.0, 2.0
    count = int(np.ceil(time[-1] / (hold + rise))) + 1
    levels = np.concatenate([[0.0], rng.uniform(-1, 1, size=count)])
    index = np.minimum((time // (hold + rise)).astype(int), count - 1)
    progress = np.clip((time - index * (hold + rise)) / rise, 0, 1)
    blend = (1 - np.cos(np.pi * progress)) / 2
    wave: Array = levels[index] * (1 - blend) + levels[index + 1] * blend
    return wave


SIGNALS: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "sine": _sine,
    "decaying-sine": _decaying_sine,
    "triangle": _triangle,
    "multi-sine": _multi_sine,
    "random-steps": _random_steps,
}
