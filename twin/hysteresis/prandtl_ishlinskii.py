"""Prandtl-Ishlinskii hysteresis model: a weighted sum of plays (Krasnosel'skii and Pokrovskii 1989).

    theta = sum_i w_i p_i,    p_i(k) = max(l(k) - r_i, min(l(k) + r_i, p_i(k-1)))

with the pulling distance l and the thresholds r_i in mm, the bending angle theta in degrees and weights
w_i >= 0 in deg / mm. A play of threshold 0 is the pull itself: its weight is the reversible slope. Before the
first pull all plays are at zero: the model starts from a straight endoscope at rest.

The plays are the memory, and the command alone moves them. In a filter the angle moves by the increments of
the model, so that what a measurement corrects stays corrected: a deviation of the angle is never forgotten.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.files.shown import shown
from twin.hysteresis.reading import series

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class PrandtlIshlinskii:
    """Prandtl-Ishlinskii model: weights and thresholds of its plays.

    Attributes:
        weights_deg_per_mm: weight of each play, not negative, (m,) [deg / mm].
        thresholds_mm: threshold of each play, half the width of its dead band, not negative, (m,) [mm].
    """

    name: ClassVar[str] = "prandtl-ishlinskii"
    affine: ClassVar[bool] = True

    weights_deg_per_mm: tuple[float, ...]
    thresholds_mm: tuple[float, ...]

    def start(self, pull_mm: ArrayLike) -> Array:
        """Return the plays (m, B) after a monotone pull from rest at zero to (B,) [mm]."""
        pull = np.atleast_1d(np.asarray(pull_mm, dtype=float))
        return moved(np.zeros((len(self.thresholds_mm), *pull.shape)), pull, self.thresholds_mm)

    def step(
        self, bend_deg: Array, memory: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike
    ) -> tuple[Array, Array]:
        """Return angle (..., B) [deg] and plays (m, B) [mm] one sample later; without the previous pull."""
        plays = moved(memory, np.asarray(pull_mm, dtype=float), self.thresholds_mm)
        return bend_deg + np.tensordot(self.weights_deg_per_mm, plays - memory, axes=1), plays

    def slope(self, bend_deg: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike) -> Array:
        """Return the derivative of a step with respect to the angle: 1."""
        return np.ones(np.broadcast_shapes(np.shape(bend_deg), np.shape(pull_mm)))

    def response(self, pull_mm: Array, bend_deg0: ArrayLike) -> Array:
        """Return the angle (..., N) [deg] along commands (..., N) [mm], begun from rest at zero."""
        angle = np.tensordot(self.weights_deg_per_mm, plays_along(pull_mm, self.thresholds_mm), axes=1)
        bend_deg: Array = np.asarray(bend_deg0, dtype=float)[..., None] + (angle - angle[..., :1])
        return bend_deg

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters by name."""
        return {name: [float(value) for value in values] for name, values in dataclasses.asdict(self).items()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "PrandtlIshlinskii":
        """Return the model with these parameters; raises `ValueError` where one is missing or wrong."""
        weights, thresholds = (series(values, field.name) for field in dataclasses.fields(cls))
        if len(weights) != len(thresholds) or min(*weights, *thresholds) < 0:
            raise InputError(
                "weights_deg_per_mm and thresholds_mm must be of one length and not negative; "
                f"got {shown(weights)} and {shown(thresholds)}"
            )
        return cls(weights, thresholds)


def moved(plays_mm: Array, pull_mm: Array, thresholds_mm: Sequence[float]) -> Array:
    """Return the plays (m, ...) after a move to the pull (...) [mm]: each moves only beyond its dead band."""
    threshold = np.reshape(thresholds_mm, (-1,) + (1,) * pull_mm.ndim)
    plays: Array = np.maximum(pull_mm - threshold, np.minimum(pull_mm + threshold, plays_mm))
    return plays


def plays_along(pull_mm: Array, thresholds_mm: Sequence[float]) -> Array:
    """Return the plays (m, ..., N) along commands (..., N) [mm], the first reached from rest at zero."""
    pull = np.moveaxis(np.asarray(pull_mm, dtype=float), -1, 0)
    plays = np.empty((len(pull), len(thresholds_mm), *pull.shape[1:]))
    last = np.zeros(plays.shape[1:])
    for k, now in enumerate(pull):
        last = plays[k] = moved(last, now, thresholds_mm)
    return np.moveaxis(plays, 0, -1)
