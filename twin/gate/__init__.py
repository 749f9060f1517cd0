"""The gate: go or no-go for a trained policy before it is deployed on an endoscope, with reasons.

Its checks gather evidence on simulated twins that no training has seen, on the user's logs, on hostile inputs
and on faulty streams; what was not shown is stated.
"""

from twin.gate.check import Check, GateVerdict
from twin.gate.evidence import QUICK, WHOLE, Effort, GateMaterial, gather
from twin.gate.run import run_gate

__all__ = ["QUICK", "WHOLE", "Check", "Effort", "GateMaterial", "GateVerdict", "gather", "run_gate"]
