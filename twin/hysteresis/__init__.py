"""Models of hysteresis from pulling distance to bending angle; each is one file, none knows the physics."""

from twin.hysteresis.bouc_wen import BoucWen
from twin.hysteresis.coleman_hodgdon import ColemanHodgdon
from twin.hysteresis.model import (
    MODELS,
    HysteresisModel,
    IdentifiedModel,
    describe_model,
    described_model,
    load_model,
)
from twin.hysteresis.prandtl_ishlinskii import PrandtlIshlinskii

__all__ = [
    "MODELS",
    "BoucWen",
    "ColemanHodgdon",
    "HysteresisModel",
    "IdentifiedModel",
    "PrandtlIshlinskii",
    "describe_model",
    "described_model",
    "load_model",
]
