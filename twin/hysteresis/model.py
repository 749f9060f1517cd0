"""Interface of hysteresis models, and the JSON file of an identified one."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError, MissingFileError
from twin.hysteresis.bouc_wen import BoucWen
from twin.hysteresis.coleman_hodgdon import ColemanHodgdon
from twin.hysteresis.prandtl_ishlinskii import PrandtlIshlinskii

Array = NDArray[np.float64]


class HysteresisModel(Protocol):
    """Interface of a hysteresis model: a frozen dataclass of parameters.

    The bending angle is part of the state, so that a filter can correct it. `memory` is the rest of the
    state; the command alone moves it. A model that is identified in batches also takes arrays of candidates.

    Attributes:
        name: name of the model on the command line and in files.
        affine: True if the next angle is affine in the angle, so that a plain Kalman filter is exact.
    """

    name: ClassVar[str]
    affine: ClassVar[bool]

    def start(self, pull_mm: ArrayLike) -> Array:
        """Return the memory (m, B) at the first sample, after a pull from rest at zero to (B,) [mm]."""

    def step(
        self, bend_deg: Array, memory: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike
    ) -> tuple[Array, Array]:
        """Return angle (B,) [deg] and memory (m, B) one sample later."""

    def slope(self, bend_deg: Array, pull_mm: ArrayLike, previous_pull_mm: ArrayLike) -> Array:
        """Return the derivative of a step with respect to the angle, (B,), for an extended Kalman filter."""

    def response(self, pull_mm: Array, bend_deg0: ArrayLike) -> Array:
        """Return the angle (..., N) [deg] along commands (..., N) [mm] from first angles (...) [deg]."""

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters by name, as the model's file holds them."""

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Return the model with these parameters; raises `ValueError` if one is missing or out of range."""


MODELS: dict[str, Callable[[dict[str, Any]], HysteresisModel]] = {
    ColemanHodgdon.name: ColemanHodgdon.from_dict,
    BoucWen.name: BoucWen.from_dict,
    PrandtlIshlinskii.name: PrandtlIshlinskii.from_dict,
}
"""Hysteresis models by their name on the command line and in files."""


def model_to_dict(model: HysteresisModel) -> dict[str, Any]:
    """Return the name and the parameters of a model, as files hold them."""
    return {"model": model.name, **model.to_dict()}


def model_from_dict(values: dict[str, Any]) -> HysteresisModel:
    """Return the model that `model_to_dict` described.

    Raises:
        KeyError: there is no name, or no model of that name.
        ValueError: a parameter is missing, is no number or is out of range.
    """
    return MODELS[values["model"]](values)


@dataclasses.dataclass(frozen=True)
class IdentifiedModel:
    """Identified model with its fit error and origin: the contents of `coleman_hodgdon.json` and its like.

    Attributes:
        model: the hysteresis model.
        rmse_deg: root mean square error over the records it was identified from [deg].
        optimizer: method of the fit, in words.
        seed: seed of the optimizer.
        source: origin of the records.
    """

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
        raise MissingFileError(f"no model file {path}; `endotwin identify` writes one")
    try:
        values = json.loads(path.read_text())
        name = values.get("model", ColemanHodgdon.name)
    except (ValueError, AttributeError) as error:
        raise InputError(f"{path} is no model of hysteresis written by `endotwin identify`") from error
    if not isinstance(name, str) or name not in MODELS:
        raise InputError(f"{path} holds the model {name!r}; valid: {', '.join(MODELS)}")
    try:
        return MODELS[name](values)
    except ValueError as error:
        raise InputError(f"{path} is no {name.title()} model: {error}") from error
