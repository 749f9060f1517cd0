"""Interface of hysteresis models, and the JSON file of an identified one."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError, MissingFileError
from twin.files.bounded import MEBIBYTE
from twin.files.json_text import read_json
from twin.files.shown import shown
from twin.hysteresis.bouc_wen import BoucWen
from twin.hysteresis.coleman_hodgdon import ColemanHodgdon
from twin.hysteresis.prandtl_ishlinskii import PrandtlIshlinskii

Array = NDArray[np.float64]

MOST_BYTES = MEBIBYTE  # size of a model's file [bytes]


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


def model_from_dict(values: Mapping[str, Any]) -> HysteresisModel:
    """Return the model that `model_to_dict` described; raises `ValueError` where there is none."""
    name = values.get("model") if isinstance(values, Mapping) else None
    if not isinstance(name, str) or name not in MODELS:
        raise InputError(f"holds the model {shown(name)}; valid: {', '.join(MODELS)}")
    try:
        return MODELS[name](dict(values))
    except ValueError as error:
        raise InputError(f"is no {name.title()} model: {error}") from error


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
        return {**model_to_dict(self.model), **{k: v for k, v in vars(self).items() if k != "model"}}


def load_model(path: Path) -> HysteresisModel:
    """Read an identified model; a file that names no model is one of Coleman and Hodgdon."""
    try:
        values = read_json(path, MOST_BYTES)
    except MissingFileError as error:
        raise MissingFileError(f"no model file {path}; `endotwin identify` writes one") from error
    except ValueError as error:
        reason = str(error).removeprefix(f"{path} ")
        raise InputError(
            f"{path} is no model of hysteresis written by `endotwin identify`: {reason}"
        ) from error
    try:
        return model_from_dict({"model": ColemanHodgdon.name} | values)
    except ValueError as error:
        raise InputError(f"{path} {error}") from error
