"""Records at even samples: how many per second they are."""

import numpy as np

from twin.episode import Episode
from twin.errors import InputError

EVEN = 0.01
"""A sample may be off its place by this share of the sample time."""

_ROUND = [digit * 10**power for power in range(4) for digit in (1, 2, 5)]  # samples per second to propose


def frames_per_second(episode: Episode) -> int:
    """Return how many samples a second has: LeRobot keeps a whole number, and places samples by it alone.

    Raises:
        ValueError: samples are not evenly apart, or are no whole number per second.
    """
    per_second = round(1 / episode.sample_time)
    seconds = episode.time - episode.time[0]
    if per_second >= 1:
        off = np.abs(seconds * per_second - np.arange(len(seconds))).max()
        if off <= EVEN:
            return per_second
    steps = np.diff(episode.time)
    apart = f"{steps.min():.6g} s" + (
        f" to {steps.max():.6g} s" if np.ptp(steps) > EVEN * steps.min() else ""
    )
    near = min(_ROUND, key=lambda rate: abs(np.log(rate * episode.sample_time)))
    raise InputError(
        f"its samples are {apart} apart: must be evenly apart, a whole number per second; "
        f"give a sample time, such as {1 / near:g} s, or choose another format"
    )
