"""Coleman-Hodgdon hysteresis model (Coleman and Hodgdon 1986; eq. 1 of the RAM paper), in batches.

    d theta / dt = a |v| (b l - theta) + c v,    v = dl / dt

with the pulling distance l in mm and the bending angle theta in degrees, the units that the literature quotes
its parameters in. The model does not depend on rate: only increments of l count.
"""

import dataclasses
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.files.shown import shown
from twin.hysteresis.reading import numbers

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class ColemanHodgdon:
    """Coleman-Hodgdon model: its parameters; arrays of one shape hold many candidates at once.

    Attributes:
        a_per_mm: decay rate of the memory of a reversal, positive [1 / mm].
        b_deg_per_mm: slope that a long pull approaches, positive [deg / mm].
        c_deg_per_mm: slope where angle and asymptote b l meet [deg / mm].
    """

    name: ClassVar[str] = "coleman-hodgdon"
    affine: ClassVar[bool] = True

    a_per_mm: ArrayLike
    b_deg_per_mm: ArrayLike
    c_deg_per_mm: ArrayLike

    def start(self, pull_mm: ArrayLike) -> Array:
        """Return the memory at the first sample, (0, B): empty, as the angle is the complete state."""
        return np.empty((0, np.size(pull_mm)))

    def step(
        self, bend_deg: Array, memory: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike
    ) -> tuple[Array, Array]:
        """Return the angle (...,) [deg] and memory one sample later (eq. 4 without f; explicit Euler)."""
        pull = np.asarray(pull_mm, dtype=float)
        increment = pull - np.asarray(previous_pull_mm, dtype=float)
        a, b, c = np.asarray(self.a_per_mm), np.asarray(self.b_deg_per_mm), np.asarray(self.c_deg_per_mm)
        return bend_deg + a * np.abs(increment) * (b * pull - bend_deg) + c * increment, memory

    def slope(self, bend_deg: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike) -> Array:
        """Return the derivative of a step with respect to the angle (eq. 7): 1 - a |increment|."""
        increment = np.asarray(pull_mm, dtype=float) - np.asarray(previous_pull_mm, dtype=float)
        slope: Array = 1 - np.asarray(self.a_per_mm) * np.abs(increment)
        return slope

    def response(self, pull_mm: Array, bend_deg0: ArrayLike) -> Array:
        """Return the angle (candidates..., ..., N) [deg] along commands (..., N) [mm] from first angles.

        Parameters broadcast against `pull_mm` without time.
        """
        pull = np.moveaxis(np.asarray(pull_mm, dtype=float), -1, 0)
        a, b, c = np.asarray(self.a_per_mm), np.asarray(self.b_deg_per_mm), np.asarray(self.c_deg_per_mm)
        # All that does not depend on the angle comes before the loop, which is two operations a sample.
        axes = max(a.ndim, b.ndim, c.ndim)
        increment, reached = _with_axes(np.diff(pull, axis=0), axes), _with_axes(pull[1:], axes)
        forget = a * np.abs(increment)
        drive = forget * b * reached + c * increment
        keep = 1 - forget
        shape = np.broadcast_shapes(drive.shape[1:], np.shape(bend_deg0))
        bend = np.empty((len(pull), *shape))  # time first: each step writes one block of memory
        bend[0] = bend_deg0
        for k in range(1, len(bend)):
            now = bend[k, ...]
            np.multiply(bend[k - 1], keep[k - 1], out=now)
            now += drive[k - 1]
        return np.moveaxis(bend, 0, -1)

    def monotone(self) -> bool:
        """Return True if loops of any size rise with the pull and fall with the release: c >= b / 2 >= 0."""
        return bool(np.all(np.asarray(self.c_deg_per_mm) >= np.asarray(self.b_deg_per_mm) / 2))

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters by name, with c / b and whether loops are monotone."""
        a, b, c = (float(np.asarray(v)) for v in dataclasses.astuple(self))
        return {
            "a_per_mm": a,
            "b_deg_per_mm": b,
            "c_deg_per_mm": c,
            "c_over_b": c / b,
            "monotone": self.monotone(),
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "ColemanHodgdon":
        """Return the model with these parameters; raises `ValueError` where one is missing or wrong."""
        names = [field.name for field in dataclasses.fields(cls)]
        found = numbers(values, names)
        a, b, _ = found
        if not (np.isfinite(found).all() and a > 0 and b > 0):
            raise InputError(f"{', '.join(names)} must be finite, the first two positive; got {shown(found)}")
        return cls(*found)


def _with_axes(values: Array, axes: int) -> Array:
    """Insert axes for candidates after time: (time, ...) becomes (time, 1..., ...)."""
    extra = max(axes - (values.ndim - 1), 0)
    return values.reshape(len(values), *(1,) * extra, *values.shape[1:])
