"""Division of a control period into parts where the command is fast, each with a shorter time step.

Two errors grow with what happens within a step: friction follows the load of its start, and the inertia that
makes springs implicit (`model.py`), in proportion to the square of the time step, delays what should move and
lets it run on beyond its rest. Slow commands leave neither. A step command does: at steps of 2.5 ms its error
is up to a third of the range. So the parts are as many as keep small, in each, the tension that the command
adds to a wire, and the change of that from one period to the next. As the endoscope comes to rest only
afterwards, they become fewer by and by.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.physics.layout import Layout
from twin.physics.model import constraint_time, implicit
from twin.preset.preset import Preset

Array = NDArray[np.float64]
STEPPED = (
    "dof_armature",
    "dof_damping",
    "dof_solref",
    "tendon_solref_fri",
    "actuator_gainprm",
    "actuator_biasprm",
)
"""Fields of MuJoCo's models that depend on the time step, besides those of `load.py`."""

ADDED, CHANGED = 8e-3, 1e-3  # tension in a part, and its change, at most, as shares of the pretension [-]
FADING = 0.75  # of the number of parts that a control period needed, from one to the next [-]
LEAST_TENSION = 1.0  # that these are shares of where there is less pretension [N]
LEAST_PART = 1.5e-4  # shortest part [s]: far below, friction creeps, as its constraints become soft


class Division:
    """Rule by which one endoscope divides its control periods, with what it has of the past."""

    def __init__(self, preset: Preset) -> None:
        """Begin at rest."""
        self._period, self._time_step = preset.control_period, preset.time_step
        self._stiffness = preset.wire_stiffness / max(preset.pretension, LEAST_TENSION)
        self._most = max(self._period / LEAST_PART, 1.0)
        self.reset()

    def reset(self) -> None:
        """Return to rest."""
        self._needed, self.parts = 0.0, 1
        self._strides: Sequence[float] = (0.0, 0.0)

    def state(self) -> tuple[float, ...]:
        """Return the parts that were needed, whole or not, and the last travel of the pulleys [m]."""
        return self._needed, *self._strides

    def restore(self, state: tuple[float, ...]) -> None:
        """Restore a state that `state` returned."""
        self._needed, *self._strides = state
        self.parts = self._power_of_two()

    def advance(self, strides: Sequence[float]) -> int:
        """Return the parts, a power of two, of the next control period, in which the pulleys travel [m]."""
        largest = max(map(abs, strides))
        change = max(abs(now - before) for now, before in zip(strides, self._strides, strict=False))
        needed = self._stiffness * max(largest / ADDED, change / CHANGED)
        self._needed, self._strides = max(min(needed, self._most), FADING * self._needed), strides
        self.parts = self._power_of_two()
        return self.parts

    def _power_of_two(self) -> int:
        parts = 1
        while parts < self._needed and 2 * parts <= self._most:
            parts *= 2
        return parts

    def steps(self) -> tuple[int, float]:
        """Return the number of time steps in a part, and their length [s]."""
        part = self._period / self.parts
        steps = math.ceil(part / self._time_step - 1e-9)
        return steps, part / steps


def write_time_step(preset: Preset, layout: Layout, fields: Sequence[Array], time_step: float) -> None:
    """Write the fields `STEPPED` of one model for a time step [s]."""
    inertia, damping, joint_constraint, tendon_constraint, gain, bias = fields
    law = implicit(preset, time_step)
    inertia[layout.pulley], inertia[layout.element] = law.pulley_inertia, law.element_inertia
    inertia[layout.hinge], damping[layout.hinge] = law.hinge_inertia, law.hinge_damping
    joint_constraint[:, 0] = tendon_constraint[:, 0] = constraint_time(time_step)
    gain[1::2, 0], bias[1::2, 2] = law.pulley_damping, -law.pulley_damping
