"""Logs beside their simulation, and beside models without physics that were fitted to the same part."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import bend_errors, offset_of, offsets_taken_off, predict
from twin.calibration.rivals import rival_errors
from twin.episode import Episode
from twin.preset.preset import Preset

Array = NDArray[np.float64]

TWIN = "twin"
"""Name of the twin among those that are compared."""


@dataclasses.dataclass(frozen=True)
class Compared:
    """Log beside what the twin and its rivals make of it.

    Attributes:
        loop: the log.
        episode: its simulation; None where it diverged.
        errors: for each bending plane, how far each is above the measured angle, by name, (N,) [rad]; None
            where there is nothing to compare. Offsets of a fitted log's angle are taken off, of the twin's
            those that the fit allows; a log that is only predicted is compared as it is.
        offsets: of the twin in each plane [rad], less what windows of a file share; zero where none was
            fitted.
    """

    loop: MeasuredLoop
    episode: Episode | None
    errors: tuple[Mapping[str, Array | None], ...]
    offsets: tuple[float, ...]


def compare(
    preset: Preset, loops: Sequence[MeasuredLoop], seed: int = 0, rivals: Sequence[str] = ()
) -> list[Compared]:
    """Simulate a calibrated preset along every log, and fit its rivals to the same samples.

    Args:
        preset: as calibrated.
        loops: the logs; their fitted samples are those that the rivals are fitted to.
        seed: of the rivals' fits.
        rivals: names of models without physics, of `MODELS`.
    """
    episodes = predict([preset], loops)[0]
    planes = range(max(loop.planes for loop in loops))
    pairs = [*zip(loops, episodes, strict=True)]
    own = [[] if episode is None else bend_errors(episode, loop) for loop, episode in pairs]
    taken_off = offsets_taken_off(own, loops)
    theirs = {name: [rival_errors(name, loops, seed, plane) for plane in planes] for name in rivals}
    found = []
    for place, (loop, episode) in enumerate(pairs):
        errors, offsets = [], []
        for plane in planes[: loop.planes]:
            rivals_raw = {name: of_planes[plane][place] for name, of_planes in theirs.items()}
            raw = {TWIN: own[place][plane] if own[place] else None} | rivals_raw
            offset = {TWIN: float(taken_off[place][plane])}
            offset |= {name: _offset(error, loop) for name, error in rivals_raw.items()}
            errors.append(
                {name: None if error is None else error - offset[name] for name, error in raw.items()}
            )
            offsets.append(offset[TWIN])
        found.append(Compared(loop, episode, tuple(errors), tuple(offsets)))
    return found


def _offset(error: Array | None, loop: MeasuredLoop) -> float:
    """Return the offset of a rival along a fitted log [rad], 0 of one that is only predicted."""
    return offset_of(error, loop) if error is not None and loop.fitted.any() else 0.0
