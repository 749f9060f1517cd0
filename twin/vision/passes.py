"""Passes of an instrument before the cameras: when, where, and how it hides what they look at."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.vision.rig import StereoRig

Array = NDArray[np.float64]

_SECONDS = (0.4, 2.5)  # that a pass takes
_NEARNESS = (0.1, 0.5)  # of the rod, from what it hides to the cameras
_SWEEP = 0.8  # half of its way, in lengths of the section
_OFF_TARGET = 0.12  # by which it misses the middle of what it hides, likewise


@dataclasses.dataclass(frozen=True)
class Pass:
    """Pass of the rod.

    Attributes:
        start: when it comes into sight [s].
        end: when it is gone [s].
        entry: (3,) place of its middle at the start [m].
        exit: (3,) place of its middle at the end [m].
        along: (3,) unit vector along it.
    """

    start: float
    end: float
    entry: Array
    exit: Array
    along: Array

    def middle(self, time: float) -> Array | None:
        """Return the place of its middle at a time [s]; None where it is not in sight."""
        if not self.start <= time <= self.end:
            return None
        share = (time - self.start) / (self.end - self.start)
        place: Array = self.entry + share * (self.exit - self.entry)
        return place


def draw_passes(
    rig: StereoRig, time: Array, tip: Array, section_length: float, rng: np.random.Generator
) -> list[Pass]:
    """Draw the passes of a record, as a Poisson process; each crosses before the tip or before the shaft.

    Args:
        rig: how many a minute, and where the cameras are.
        time: (N,) of the record [s].
        tip: (N, 3) place of the tip [m].
        section_length: of the bending section [m].
        rng: source of random numbers.
    """
    seconds = float(time[-1] - time[0])
    count = int(rng.poisson(rig.occlusions_per_minute * seconds / 60))
    passes = []
    for start in np.sort(rng.uniform(0, seconds, count)) + time[0]:
        end = start + rng.uniform(*_SECONDS)
        at = int(np.clip(np.searchsorted(time, (start + end) / 2), 0, len(time) - 1))
        hidden = tip[at] if rng.uniform() < 0.7 else np.array([-0.2 * section_length, 0.0, 0.0])
        hidden = hidden + _OFF_TARGET * section_length * rng.standard_normal(3)
        towards = np.array([0.0, -rig.distance * section_length, 0.0])
        centre = hidden + rng.uniform(*_NEARNESS) * towards
        angle = rng.uniform(0, 2 * np.pi)
        along = np.array([np.cos(angle), 0.0, np.sin(angle)])
        way = _SWEEP * section_length * np.array([-along[2], 0.0, along[0]])
        passes.append(Pass(float(start), float(end), centre - way, centre + way, along))
    return passes
