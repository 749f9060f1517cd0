"""Reduced twin: the same endoscope in quasi-static equilibrium, without MuJoCo and far faster."""

from twin.reduced.simulate import simulate, simulate_batch
from twin.reduced.twins import ReducedEndoscope, ReducedTwins

__all__ = ["ReducedEndoscope", "ReducedTwins", "simulate", "simulate_batch"]
