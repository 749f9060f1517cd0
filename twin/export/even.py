"""Records at even samples: how many per second they are, and cutting a record where samples are missing."""

import dataclasses
import itertools

import numpy as np

from twin.episode import Episode
from twin.errors import InputError

EVEN = 0.01
"""A sample may be off its place by this share of the sample time."""
HOLE = 1.5
"""A step of more than this many sample times is a hole in the record."""

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


def whole_pieces_in_time(episode: Episode, shortest: float = 0.0) -> list[Episode]:
    """Cut a record where samples are missing, so that nothing is made up in between.

    Args:
        episode: a simulated record, or what could be recovered of one.
        shortest: a piece that lasts less than this is left out [s].

    Returns:
        Its pieces, each of at least 2 samples; a record without holes, as it is.
    """
    holes = np.flatnonzero(np.diff(episode.time) > HOLE * episode.sample_time) + 1
    if len(holes) == 0:
        return [episode]
    edges = [0, *holes.tolist(), len(episode.time)]
    fields = [
        field.name for field in dataclasses.fields(episode) if field.name not in ("metadata", "attachments")
    ]
    return [
        dataclasses.replace(episode, **{field: getattr(episode, field)[begin:end] for field in fields})
        for begin, end in itertools.pairwise(edges)
        if end - begin >= 2 and episode.time[end - 1] - episode.time[begin] >= shortest * (1 - 1e-6)
    ]
