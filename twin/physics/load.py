"""Load-dependent forces: friction and damping of a MuJoCo model, from the tension of the wires.

MuJoCo knows one constant friction force per joint. Here it is rewritten, once per control period, from where
the wires are; so is the damping of the wires, which must vanish with their tension, and their inertia.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import (
    LEAST_FRICTION,
    friction_drift,
    friction_floor,
    hinge_friction,
    hinge_groups,
    joint_friction,
)
from twin.mechanics.kernels import kernel
from twin.mechanics.wire import ABSENT, rest_stretch, spring_law, taut_part, tension_at
from twin.physics.layout import Index, Layout, consecutive
from twin.preset.preset import Preset

Array = NDArray[np.float64]
REWRITTEN = (
    "dof_frictionloss",
    "tendon_frictionloss",
    "tendon_damping",
    "tendon_armature",
    "wrap_prm",
    "tendon_stiffness",
    "tendon_lengthspring",
)
"""Fields of a MuJoCo model that follow the load."""
NEARLY_TAUT = 1e-6  # slack up to which a wire counts as taut [m]
# Share of their inertia that slack segments keep. A chain of them that turns taut is stable, until the next
# update, up to a stiffness of 0.4 + 4 * share times that without tension. A larger share delays what slides.
SLACK_SHARE = 0.5

_friction_drift = kernel(friction_drift)
_friction_floor = kernel(friction_floor)
_taut_part = kernel(taut_part)


class Forces(NamedTuple):
    """Forces that follow the load: views of MuJoCo's fields, to write through, and the tension they follow.

    With two planes, friction is written by `write_pairs`: `sheath` and `joints` are no views then.
    """

    sheath: Array  # breakaway friction of the sheath elements, (wires, elements) [N]
    joints: Array  # breakaway friction of each hinge of a group, (planes, groups) [N m]
    damping: Array  # of the wire segments, (wires, elements + 1) [N s / m]
    inertia: Array  # of the wire segments, (wires, elements + 1) [kg]: see `model.py`
    loss: Array  # friction of pairs of neighbours, along and across, (2, pairs); none with one plane
    coefficient: Array  # of their tendons, (2, wraps); likewise
    stiffness: Array  # of the wire segments with a toe, (wires, elements + 1) [N / m]
    length: Array  # at which these have no tension, (wires, elements + 1) [m]
    tension: Array  # of the wire segments, without damping, (wires, elements + 1) [N]

    @classmethod
    def of(cls, layout: Layout, fields: Sequence[Array]) -> Self:
        """Return the views of the fields `REWRITTEN` of a model."""
        joint_loss, tendon_loss, tendon_damping, tendon_inertia, wraps, stiffness, length = fields

        def view(field: Array, index: Index) -> Array:
            return field[consecutive(index)].reshape(index.shape)

        planes = len(layout.hinge)
        if planes == 1:
            sheath, joints = view(joint_loss, layout.element), view(tendon_loss, layout.joints)
        else:
            sheath = np.zeros(layout.element.shape)
            joints = np.zeros((planes, layout.shared.shape[1] - 2 * layout.element.shape[1]))
        damping, inertia = view(tendon_damping, layout.wire), view(tendon_inertia, layout.wire)
        loss, coefficient = view(tendon_loss, layout.shared), view(wraps, layout.wrap)
        springs = view(stiffness, layout.wire), view(length[:, 1], layout.wire)
        return cls(sheath, joints, damping, inertia, loss, coefficient, *springs, np.zeros(layout.wire.shape))


class LoadLaw(NamedTuple):
    """Parameters by which the forces of an endoscope follow the load; indices are those of `Layout`."""

    hinge: Index  # (planes, vertebrae)
    pulley: Index  # (planes,)
    element: Index  # (wires, elements)
    arm: float  # moment arm of a wire [m]
    stiffness: float  # of a wire segment without tension [N / m]
    quadratic: float  # coefficient of its stretch squared [N / m^2]
    width: float  # of the toe of a wire segment [m]
    damping: float  # of a wire segment itself [N s / m]
    rest_stretch: Array  # (wires, elements + 1) stretch of each segment at positions of zero [m]
    joint: Array  # (groups,) own friction of a hinge of each group [N m]
    routing: float  # friction of wires on vertebrae times moment arm [m]
    wrapped: Array  # (vertebrae, groups) share of the turn of each hinge that one of each group feels [-]
    friction: float  # coefficient of an element of the sheath [-]
    bend_offset: float  # wrap angle of a straight sheath [rad]
    floor: float  # friction of an element that does not depend on the tension [N]
    growth: float  # of that with the bend of the sheath [N]
    exponent: float  # of that bend [-]
    drifts: bool  # whether friction warms up or wears
    warm_up: float  # [-]
    warm_up_time: float  # [s]
    wear: float  # [1 / m]

    @classmethod
    def of(cls, preset: Preset, layout: Layout) -> Self:
        """Return the parameters of a preset."""
        elements, vertebrae = preset.sheath_elements, preset.vertebrae
        stiffness, quadratic, width = spring_law(preset)
        # Per routing friction and tension it is linear in the turns: the mean over each group, as a matrix.
        of_hinges = hinge_friction(np.zeros(1), 1.0, np.ones(vertebrae), np.eye(vertebrae))
        return cls(
            hinge=layout.hinge,
            pulley=layout.pulley,
            element=layout.element,
            arm=preset.wire_offset,
            stiffness=stiffness,
            quadratic=quadratic,
            width=width,
            damping=preset.wire_damping * (elements + 1),
            rest_stretch=Wires(preset, layout).rest_stretch,
            joint=joint_friction(preset),
            routing=preset.routing_friction * preset.wire_offset,
            wrapped=np.stack([of_hinges[:, g].mean(axis=1) for g in hinge_groups(vertebrae)], axis=1),
            friction=preset.sheath_friction,
            bend_offset=preset.sheath_bend_offset,
            floor=max(preset.sheath_friction_floor / elements, LEAST_FRICTION),
            growth=preset.sheath_friction_growth / elements,
            exponent=preset.sheath_friction_exponent,
            drifts=bool(preset.friction_warm_up or preset.friction_wear),
            warm_up=preset.friction_warm_up,
            warm_up_time=preset.warm_up_time,
            wear=preset.friction_wear,
        )


@kernel
def sheath_friction(
    law: LoadLaw, sheath_bend: float, scale: float, time: float, travel: float
) -> tuple[float, float]:
    """Return half the friction of an element per tension on both its sides [-], and its friction without [N].

    By `friction_per_tension` and `friction_floor`, at a bend of the sheath [rad]; `scale` multiplies both,
    and so do warm-up after a time [s] and wear after a travel of the pulleys [m].
    """
    factor = scale
    if law.drifts:
        factor *= float(_friction_drift(law.warm_up, law.warm_up_time, law.wear, time, travel))
    wrapped = law.friction * factor * (sheath_bend + law.bend_offset)
    floor = float(_friction_floor(law.floor, law.growth, law.exponent, sheath_bend))
    return math.tanh(wrapped / law.element.shape[1] / 2), floor * factor


@kernel
def follow_load(
    law: LoadLaw,
    forces: Forces,
    qpos: Array,
    qvel: Array,
    time_step: float,
    part: float,
    half_share: float,
    floor: float,
) -> None:
    """Write friction and damping of sheath and hinges, and of the wires, at positions and velocities.

    These are `tension_at`, `element_friction` and `hinge_friction`, from the pulley to the tip. Damping
    holds, besides the wire's own, time step [s] times stiffness: with it, and with as much inertia times the
    time step, a step is one of backward Euler (`model.py`). A segment that will be taut before the next
    update, in a part of the control period [s], has it already.

    A segment with a toe has the spring of MuJoCo that touches its law where it is now.

    Inertia has the stiffness expected at the next update, and segments that are slack keep a share of it: an
    element that slides may pull its neighbours taut within the period, and a chain of taut segments diverges
    at any time step where this inertia is missing. Unlike damping, it does not drag.

    The last two are those of `sheath_friction`.
    """
    wires, elements = law.element.shape
    planes, (vertebrae, groups) = len(law.pulley), law.wrapped.shape
    stiffness, quadratic, own, ahead = law.stiffness, law.quadratic, law.damping, 2 * part
    for plane in range(planes):
        bend, bend_rate = 0.0, 0.0
        for joint in law.hinge[plane]:
            bend += qpos[joint]
            bend_rate += qvel[joint]
        at_tip = 0.0
        for w in range(plane * wires // planes, (plane + 1) * wires // planes):
            side = 1.0 - 2.0 * (w % 2)
            pulley = law.pulley[plane]
            start, start_rate = side * qpos[pulley], side * qvel[pulley]
            before = 0.0
            for i in range(elements + 1):
                if i < elements:
                    end, end_rate = qpos[law.element[w, i]], qvel[law.element[w, i]]
                else:
                    end, end_rate = side * law.arm * bend, side * law.arm * bend_rate
                stretch = law.rest_stretch[w, i] + start - end
                soon = stretch + ahead * (start_rate - end_rate)
                taut, share = _taut_part(stretch, law.width)
                tension = taut * (stiffness + quadratic * taut)
                if i > 0:
                    forces.sheath[w, i - 1] = half_share * (tension + before) + floor
                damping, inertia = 0.0, 0.0
                stiffest = own + time_step * (stiffness + 2 * quadratic * max(taut, soon))
                if law.width > 0.0:
                    slope = share * (stiffness + 2 * quadratic * taut)
                    damping, inertia = share * own + time_step * slope, time_step * stiffest
                    forces.stiffness[w, i] = slope
                    if slope > 0.0:
                        forces.length[w, i] = start - end - tension / slope
                elif max(stretch, soon) > -NEARLY_TAUT:
                    damping = own + time_step * (stiffness + 2 * quadratic * taut)
                    inertia = time_step * stiffest
                elif stretch > -ABSENT / 2:
                    inertia = SLACK_SHARE * time_step * stiffest
                forces.damping[w, i] = damping
                forces.inertia[w, i] = inertia
                forces.tension[w, i] = tension
                before, start, start_rate = tension, end, end_rate
            at_tip += before
        for g in range(groups):
            felt = 0.0
            for v in range(vertebrae):
                turn = abs(qpos[law.hinge[0, v]])
                if planes == 2:
                    turn = math.hypot(turn, qpos[law.hinge[1, v]])
                felt += turn * law.wrapped[v, g]
            forces.joints[plane, g] = law.joint[g] + law.routing * at_tip * felt


class Wires:
    """Wires of an endoscope, as springs."""

    def __init__(self, preset: Preset, layout: Layout) -> None:
        self._shape = layout.wire.shape
        self._law = spring_law(preset)
        self.rest_stretch = np.array([rest_stretch(preset, bool(w % 2)) for w in range(len(layout.element))])
        self.lengthening = _lengthening(preset, layout)

    def tension_and_slack(self, qpos: Array) -> tuple[Array, Array]:
        """Return tension [N] and slack [m] of each segment, both (N, wires, elements + 1), at (N, nq)."""
        lengthened = np.matmul(self.lengthening, qpos[:, :, None]).reshape(-1, *self._shape)
        stretch = self.rest_stretch + lengthened
        return tension_at(stretch, *self._law), np.maximum(-stretch, 0.0)


def _lengthening(preset: Preset, layout: Layout) -> Array:
    """Return the Jacobian of the wire segments' lengths, (wires * (elements + 1), nq)."""
    wires, positions = layout.wire.shape, layout.element.size + layout.pulley.size + layout.hinge.size
    matrix = np.zeros((*wires, positions))
    for wire in range(wires[0]):
        side, plane = 1.0 - 2.0 * (wire % 2), wire // 2
        for element, joint in enumerate(layout.element[wire]):
            matrix[wire, element, joint] = -1.0
            matrix[wire, element + 1, joint] = 1.0
        matrix[wire, 0, layout.pulley[plane]] = side
        matrix[wire, -1, layout.hinge[plane]] = -side * preset.wire_offset
    return matrix.reshape(-1, positions)
