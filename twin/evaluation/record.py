"""A record that estimators are tested on: the command, the true angle, and where that is known at all."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class EvaluationRecord:
    """One record at even samples; the true angle is known at its first one."""

    pull_mm: Array
    """(N,) commanded pulling distance, finite [mm]."""
    bend_deg: Array
    """(N,) true bending angle, finite; linear between its neighbours where it is not known [deg]."""
    seen: NDArray[np.bool_]
    """(N,) whether the true angle is known: elsewhere nothing is measured, and nothing scored."""
    stroke_mm: tuple[float, float]
    """Range of the pulling distance, as asked for or as found."""
    twin: str
    """What left the record: the kind of twin, `measured`, or the name of a preset."""
    name: str
    """Name of the record."""
