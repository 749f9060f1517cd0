"""Samples of a record that tell most: the ends of the stroke, and what hysteresis does between them."""

import itertools

import numpy as np

from twin.episode import Episode


def telling_samples(episode: Episode) -> list[int]:
    """Return four samples that show hysteresis: most pulled, two at one pull that differ most, least pulled.

    The two are sought in the middle of the stroke, and the more bent one comes first.
    """
    pull, bend = episode.pull, episode.bend
    strips = np.linspace(pull.min(), pull.max(), 41)
    best = (0, 0)
    for low, high in itertools.pairwise(strips[13:28]):
        inside = np.flatnonzero((pull >= low) & (pull <= high))
        if inside.size == 0:
            continue
        from_centre = np.abs(pull[inside] - (low + high) / 2)
        is_upper = bend[inside] >= (bend[inside].max() + bend[inside].min()) / 2
        upper, lower = (
            int(inside[np.where(half, from_centre, np.inf).argmin()]) for half in (is_upper, ~is_upper)
        )
        best = max(best, (upper, lower), key=lambda pair: bend[pair[0]] - bend[pair[1]])
    return [int(pull.argmax()), *best, int(pull.argmin())]


def farthest_sample(episode: Episode, ghost: Episode) -> int:
    """Return the sample where the bends of two records at the same times differ most."""
    return int(np.abs(episode.bend - ghost.bend).argmax())
