"""Reduced twin: the same endoscope in quasi-static equilibrium, without MuJoCo and far faster."""

from typing import TYPE_CHECKING, Any

from twin.reduced.twins import ReducedEndoscope, ReducedTwins

if TYPE_CHECKING:
    from twin.reduced.inverse import Inverse
    from twin.reduced.simulation import Derivatives, derivatives, simulate, simulate_batch
else:

    def __getattr__(name: str) -> Any:
        """Load what has kernels when it is first used: Numba takes half a second."""
        if name == "Inverse":
            from twin.reduced.inverse import Inverse

            return Inverse
        if name not in ("Derivatives", "derivatives", "simulate", "simulate_batch"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from twin.reduced import simulation

        return getattr(simulation, name)


__all__ = [
    "Derivatives",
    "Inverse",
    "ReducedEndoscope",
    "ReducedTwins",
    "derivatives",
    "simulate",
    "simulate_batch",
]
