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

from twin.mechanics.kernels import entry
from twin.physics.layout import Layout
from twin.physics.model import constraint_time, implicit
from twin.preset.preset import Preset

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
STEPPED = (
    "dof_armature",
    "dof_damping",
    "dof_solref",
    "tendon_solref_fri",
    "actuator_gainprm",
    "actuator_biasprm",
)
"""Fields of a MuJoCo model that depend on the time step, besides those of `load.py`."""

ADDED, CHANGED = 16e-3, 1e-3  # tension in a part, and its change, at most, as shares of the pretension [-]
FADING = 0.75  # of the number of parts that a control period needed, from one to the next [-]
LEAST_TENSION = 1.0  # that these are shares of where there is less pretension [N]
LEAST_PART = 1.5e-4  # shortest part [s]: far below, friction creeps, as its constraints become soft


class Division:
    """Rule by which an endoscope divides its control periods.

    Its `past` (1 + 2 planes,) are the parts that the last period needed, whole or not, and travel and
    position of each pulley in it [m].
    """

    def __init__(self, preset: Preset) -> None:
        """Begin at rest."""
        self._period, self._time_step = preset.control_period, preset.time_step
        self._stiffness = preset.wire_stiffness / max(preset.pretension, LEAST_TENSION)
        self._most = max(self._period / LEAST_PART, 1.0)
        self.past = np.zeros(1 + 2 * preset.bending_planes)

    def reset(self) -> None:
        """Return to rest."""
        self.past[:] = 0.0

    def parts(self, pulley: Array) -> Counts:
        """Return the parts, a power of two, of each control period (P,), at the end of which pulleys are.

        Their positions are (P, planes) [m].
        """
        parts = np.empty(len(pulley), dtype=np.int64)
        count_parts(pulley, self._stiffness, self._most, self.past, parts)
        return parts

    def steps(self, parts: int) -> tuple[int, float]:
        """Return the number of time steps in a part, and their length [s]."""
        part = self._period / parts
        steps = math.ceil(part / self._time_step - 1e-9)
        return steps, part / steps


@entry
def count_parts(pulley: Array, stiffness: float, most: float, past: Array, parts: Counts) -> None:
    """Write the parts of each control period (P,), and its `Division.past`.

    `stiffness` is that of a wire over its tension at rest [1 / m], `most` the most parts.
    """
    planes = pulley.shape[1]
    for k in range(len(pulley)):
        needed = 0.0
        for p in range(planes):
            stride = pulley[k, p] - past[1 + planes + p]
            change = stride - past[1 + p]
            needed = max(needed, stiffness * abs(stride) / ADDED, stiffness * abs(change) / CHANGED)
            past[1 + p], past[1 + planes + p] = stride, pulley[k, p]
        past[0] = max(min(needed, most), FADING * past[0])
        parts[k] = 1
        while parts[k] < past[0] and 2 * parts[k] <= most:
            parts[k] *= 2


def write_time_step(preset: Preset, layout: Layout, fields: Sequence[Array], time_step: float) -> None:
    """Write the fields `STEPPED` of one model for a time step [s]."""
    inertia, damping, joint_constraint, tendon_constraint, gain, bias = fields
    law = implicit(preset, time_step)
    inertia[layout.pulley], inertia[layout.element] = law.pulley_inertia, law.element_inertia
    inertia[layout.hinge], damping[layout.hinge] = law.hinge_inertia, law.hinge_damping
    joint_constraint[:, 0] = tendon_constraint[:, 0] = constraint_time(time_step)
    gain[1::2, 0], bias[1::2, 2] = law.pulley_damping, -law.pulley_damping
