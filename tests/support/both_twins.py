"""Both twins by the same names, for properties that either must have."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from twin import physics, reduced


@dataclass(frozen=True)
class Twin:
    """Simulation of one twin.

    Attributes:
        name: as `physics=` takes it.
        simulate: one endoscope along a command.
        simulate_batch: many.
        endoscope: class of an endoscope that is advanced by control periods.
    """

    name: str
    simulate: Callable[..., Any]
    simulate_batch: Callable[..., Any]
    endoscope: type


MUJOCO = Twin("mujoco", physics.simulate, physics.simulate_batch, physics.Endoscope)
REDUCED = Twin("reduced", reduced.simulate, reduced.simulate_batch, reduced.ReducedEndoscope)
TWINS = [MUJOCO, REDUCED]
