"""Record that estimators are tested on: the command, the true angle, and where that is known at all."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class EvaluationRecord:
    """One record at even samples; the true angle is known at its first one.

    Attributes:
        pull_mm: (N,) commanded pulling distance, finite [mm].
        bend_deg: (N,) true bending angle, finite; linear between its neighbours where it is not known [deg].
        seen: (N,) whether the true angle is known: elsewhere nothing is measured, and nothing scored.
        stroke_mm: range of the pulling distance, as asked for or as found [mm].
        twin: what left the record: the kind of twin, `measured`, or the name of a preset.
        name: of the record.
        measured_deg: (N,) angle as the sensor of the record measured it, NaN where it is missing [deg].
        preset: name of the preset that simulated it; empty, if none did or it does not tell.
    """

    pull_mm: Array
    bend_deg: Array
    seen: NDArray[np.bool_]
    stroke_mm: tuple[float, float]
    twin: str
    name: str
    measured_deg: Array | None = None
    preset: str = ""
