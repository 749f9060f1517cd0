"""Hysteresis models from pulling distance to bending angle, one file each, independent of the simulation."""

from twin.hysteresis.bouc_wen import BoucWen
from twin.hysteresis.coleman_hodgdon import ColemanHodgdon
from twin.hysteresis.model import (
    MODELS,
    HysteresisModel,
    IdentifiedModel,
    load_model,
    model_from_dict,
    model_to_dict,
)
from twin.hysteresis.prandtl_ishlinskii import PrandtlIshlinskii

__all__ = [
    "MODELS",
    "BoucWen",
    "ColemanHodgdon",
    "HysteresisModel",
    "IdentifiedModel",
    "PrandtlIshlinskii",
    "load_model",
    "model_from_dict",
    "model_to_dict",
]
