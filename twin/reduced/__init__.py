"""Reduced twin: the same endoscope in quasi-static equilibrium, without MuJoCo and far faster."""

import importlib
from typing import TYPE_CHECKING, Any

from twin.reduced.twins import ReducedEndoscope, ReducedTwins

if TYPE_CHECKING:
    from twin.reduced.inverse import Inverse
    from twin.reduced.simulation import Derivatives, derivatives, simulate, simulate_batch
else:

    def __getattr__(name: str) -> Any:
        """Load what has kernels when it is first used: Numba takes half a second."""
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        module = "twin.reduced.inverse" if name == "Inverse" else "twin.reduced.simulation"
        return getattr(importlib.import_module(module), name)


__all__ = [
    "Derivatives",
    "Inverse",
    "ReducedEndoscope",
    "ReducedTwins",
    "derivatives",
    "simulate",
    "simulate_batch",
]
