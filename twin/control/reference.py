"""Reference signals of the bend: what a controller is to follow."""

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.signals.excitation import command

Array = NDArray[np.float64]
SHARE = 0.65
"""Share of what the nominal endoscope reaches on a stroke."""
HOLD_S = 3.0
"""Time at the start for which the reference stands still; it is not scored [s]."""
FAST_PERIOD_S = 4.0
SIGNALS = ("sine", "multi-sine", "random-steps", "fast-sine")
"""Kinds of reference; the first three are slow, as those of datasets."""


def reference(
    kind: str,
    reached_deg: tuple[float, float],
    seconds: float,
    sample_time: float,
    rng: np.random.Generator,
) -> Array:
    """Return a reference (N,) [deg]: `HOLD_S` at its start, then `seconds` of a signal.

    Args:
        kind: one of `SIGNALS`.
        reached_deg: lowest and highest bend that the stroke brings; its middle `SHARE` is used [deg].
        seconds: length of the signal [s].
        sample_time: T [s].
        rng: draws period, phase and levels.
    """
    if kind not in SIGNALS:
        raise InputError(f"unknown reference {kind!r:.40}; valid: {', '.join(SIGNALS)}")
    middle, half = sum(reached_deg) / 2, SHARE * (reached_deg[1] - reached_deg[0]) / 2
    if kind == "fast-sine":
        if not seconds >= 2 * sample_time:
            raise InputError(
                f"{seconds:g} s at a sample time of {sample_time:g} s: needs at least two samples"
            )
        time = np.arange(round(seconds / sample_time)) * sample_time
        moving = middle + half * np.sin(2 * np.pi * time / FAST_PERIOD_S)
    else:
        moving = command(kind, (middle - half, middle + half), seconds, sample_time, rng)
    return np.concatenate([np.full(round(HOLD_S / sample_time), moving[0]), moving])
