"""What every model of hysteresis can do, and the file that an identified one is kept in."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.hysteresis.bouc_wen import BoucWen
from twin.hysteresis.coleman_hodgdon import ColemanHodgdon
from twin.hysteresis.prandtl_ishlinskii import PrandtlIshlinskii

Array = NDArray[np.float64]


class HysteresisModel(Protocol):
    """A frozen dataclass of parameters; one that is searched for in batches takes arrays of candidates too.

    The bending angle is part of the state, so that a filter can correct it. What the angle and the pull do
    not tell of the past is `memory`, which the command alone moves.
    """

    name: ClassVar[str]
    """Its name on the command line and in files."""
    affine: ClassVar[bool]
    """Whether the next angle is affine in the angle, so that a plain Kalman filter is exact."""

    def start(self, pull_mm: ArrayLike) -> Array:
        """Return the memory (m, B) at the first sample, reached from rest at zero by pulling to (B,) [mm]."""

    def step(
        self, bend_deg: Array, memory: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike
    ) -> tuple[Array, Array]:
        """Return the angle (B,) and the memory (m, B) one sample later, from those at the previous one."""

    def slope(self, bend_deg: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike) -> Array:
        """Return d step / d bend (B,), which an extended Kalman filter needs; 1 at rest."""

    def response(self, pull_mm: Array, bend_deg0: ArrayLike) -> Array:
        """Return the angle (..., N) along commands (..., N) from first angles (...)."""

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters by name, as the model's file holds them."""

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Return the model of such values; `ValueError` where they are none."""


MODELS: dict[str, Callable[[dict[str, Any]], HysteresisModel]] = {
    ColemanHodgdon.name: ColemanHodgdon.from_dict,
    BoucWen.name: BoucWen.from_dict,
    PrandtlIshlinskii.name: PrandtlIshlinskii.from_dict,
}
"""How a model is read, by the name on the command line and in its file."""


def model_to_dict(model: HysteresisModel) -> dict[str, Any]:
    """Return the name and the parameters of a model, as every file holds them."""
    return {"model": model.name, **model.to_dict()}


def model_from_dict(values: dict[str, Any]) -> HysteresisModel:
    """Return the model that `model_to_dict` has described.

    Raises:
        KeyError: there is no name, or no model of that name.
        ValueError: a parameter is missing, is no number or is out of range.
    """
    return MODELS[values["model"]](values)


@dataclasses.dataclass(frozen=True)
class IdentifiedModel:
    """A fitted model and how it was found; the contents of `coleman_hodgdon.json` and its like."""

    model: HysteresisModel
    rmse_deg: float
    optimizer: str
    seed: int
    source: str

    def to_dict(self) -> dict[str, Any]:
        """Return the contents of the file."""
        return {
            **model_to_dict(self.model),
            "rmse_deg": self.rmse_deg,
            "optimizer": self.optimizer,
            "seed": self.seed,
            "source": self.source,
        }


def load_model(path: Path) -> HysteresisModel:
    """Read an identified model; a file that names no model is one of Coleman and Hodgdon.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no model that we know, or parameters that cannot be.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no model file {path}; `endotwin identify` writes one")
    try:
        values = json.loads(path.read_text())
        name = values.get("model", ColemanHodgdon.name)
    except (ValueError, AttributeError) as error:
        raise ValueError(f"{path} is no model of hysteresis written by `endotwin identify`") from error
    if not isinstance(name, str) or name not in MODELS:
        raise ValueError(f"{path} holds the model {name!r}; valid: {', '.join(MODELS)}")
    try:
        return MODELS[name](values)
    except ValueError as error:
        raise ValueError(f"{path} is no {name.title()} model: {error}") from error
