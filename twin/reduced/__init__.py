"""Reduced twin: the same endoscope in quasi-static equilibrium, without MuJoCo and far faster."""

from twin.reduced.endoscope import ReducedEndoscope
from twin.reduced.simulate import simulate, simulate_batch
from twin.reduced.twins import ReducedTwins

__all__ = ["ReducedEndoscope", "ReducedTwins", "simulate", "simulate_batch"]
