"""Both twins by the same names, for properties that either must have."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from twin import physics, reduced
from twin.preset.preset import Preset


@dataclasses.dataclass(frozen=True)
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

    def able(self, preset: Preset) -> Preset:
        """Return a preset without what the twin has not: there is no gravity in the reduced one."""
        return preset if self is MUJOCO else preset.replace(gravity_x=0.0, gravity_y=0.0, gravity_z=0.0)

    def sliding(self, endoscope: Any) -> np.ndarray:
        """Return how far the elements of the sheath have slid in the first plane, (2 elements,) [m]."""
        if self is MUJOCO:
            return endoscope.data.ptr.qpos[endoscope.layout.element[:2]].ravel()
        return endoscope.twins.state.element[0, 0].copy()


MUJOCO = Twin("mujoco", physics.simulate, physics.simulate_batch, physics.Endoscope)
REDUCED = Twin("reduced", reduced.simulate, reduced.simulate_batch, reduced.ReducedEndoscope)
TWINS = [MUJOCO, REDUCED]


def same_state(one: Any, other: Any) -> bool:
    """Return whether two saved states of a twin are the same bit for bit."""
    if dataclasses.is_dataclass(one):
        one, other = vars(one), vars(other)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same_state(one[name], other[name]) for name in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same_state, one, other))
    return np.array_equal(one, other)
