"""Reduced twin: the same endoscope in quasi-static equilibrium, without MuJoCo and far faster."""

from twin.reduced.derivatives import Derivatives, derivatives
from twin.reduced.endoscope import ReducedEndoscope
from twin.reduced.inverse import Inverse
from twin.reduced.simulate import simulate, simulate_batch
from twin.reduced.twins import ReducedTwins

__all__ = [
    "Derivatives",
    "Inverse",
    "ReducedEndoscope",
    "ReducedTwins",
    "derivatives",
    "simulate",
    "simulate_batch",
]
