"""The Coleman-Hodgdon model of hysteresis (Coleman and Hodgdon 1986; eq. 1 of the RAM paper), in batches.

    d theta / dt = a |v| (b l - theta) + c v,    v = dl / dt

with the pulling distance l in mm and the bending angle theta in degrees, the units that the literature quotes
its parameters in. The model does not depend on rate: only increments of l count.
"""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class ColemanHodgdon:
    """Parameters of the model; arrays of one shape hold many candidates at once."""

    a_per_mm: ArrayLike
    """How fast the memory of a reversal is lost [1 / mm]."""
    b_deg_per_mm: ArrayLike
    """Slope that a long pull approaches [deg / mm]."""
    c_deg_per_mm: ArrayLike
    """Slope added at every point; b a l + c governs the slope after a reversal [deg / mm]."""

    def step(self, bend_deg: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike) -> Array:
        """Return the bending angle one sample later (eq. 4 without the error f; explicit Euler).

        Args:
            bend_deg: (...,) angle at the previous sample [deg].
            pull_mm: (...,) pulling distance at this sample [mm].
            previous_pull_mm: (...,) pulling distance at the previous sample [mm].

        Returns:
            (...,) angle at this sample [deg].
        """
        pull = np.asarray(pull_mm, dtype=float)
        increment = pull - np.asarray(previous_pull_mm, dtype=float)
        a, b, c = np.asarray(self.a_per_mm), np.asarray(self.b_deg_per_mm), np.asarray(self.c_deg_per_mm)
        return bend_deg + a * np.abs(increment) * (b * pull - bend_deg) + c * increment

    def response(self, pull_mm: Array, bend_deg0: ArrayLike) -> Array:
        """Return the model's bending angle along a command.

        Args:
            pull_mm: (..., N) pulling distance [mm].
            bend_deg0: (...) angle at the first sample [deg].

        Returns:
            (candidates..., ..., N) bending angle [deg]; parameters broadcast against `pull_mm` without time.
        """
        pull = np.asarray(pull_mm, dtype=float)
        a, b, c = np.asarray(self.a_per_mm), np.asarray(self.b_deg_per_mm), np.asarray(self.c_deg_per_mm)
        shape = np.broadcast_shapes(a.shape, b.shape, c.shape, pull.shape[:-1], np.shape(bend_deg0))
        bend = np.empty((pull.shape[-1], *shape))  # time first: each step writes one block of memory
        bend[0] = bend_deg0
        increment = np.diff(pull, axis=-1)
        for k in range(1, len(bend)):
            forget = a * np.abs(increment[..., k - 1])
            drive = forget * b * pull[..., k] + c * increment[..., k - 1]
            bend[k] = bend[k - 1] - forget * bend[k - 1] + drive
        return np.moveaxis(bend, 0, -1)

    def monotone(self) -> bool:
        """Whether loops of any size rise with the pull and fall with the release: c >= b / 2 >= 0."""
        return bool(np.all(np.asarray(self.c_deg_per_mm) >= np.asarray(self.b_deg_per_mm) / 2))


@dataclasses.dataclass(frozen=True)
class IdentifiedModel:
    """A fitted model and how it was found; the contents of `coleman_hodgdon.json`."""

    model: ColemanHodgdon
    rmse_deg: float
    optimizer: str
    seed: int
    source: str

    def to_dict(self) -> dict[str, Any]:
        """Return the contents of the file."""
        a, b, c = (float(np.asarray(v)) for v in dataclasses.astuple(self.model))
        return {
            "a_per_mm": a,
            "b_deg_per_mm": b,
            "c_deg_per_mm": c,
            "rmse_deg": self.rmse_deg,
            "c_over_b": c / b,
            "monotone": self.model.monotone(),
            "optimizer": self.optimizer,
            "seed": self.seed,
            "source": self.source,
        }


def load_model(path: Path) -> ColemanHodgdon:
    """Read the parameters from a `coleman_hodgdon.json`.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file does not hold finite `a_per_mm`, `b_deg_per_mm` and `c_deg_per_mm`.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no model file {path}; `endotwin identify` writes one")
    names = [field.name for field in dataclasses.fields(ColemanHodgdon)]
    try:
        values = json.loads(path.read_text())
        numbers = [float(values[name]) for name in names]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is no Coleman-Hodgdon model: needs {', '.join(names)}") from error
    a, b, _ = numbers
    if not (np.isfinite(numbers).all() and a > 0 and b > 0):
        raise ValueError(f"{path}: {', '.join(names)} must be finite, the first two positive; got {numbers}")
    return ColemanHodgdon(*numbers)
