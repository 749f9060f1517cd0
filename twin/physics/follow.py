"""Friction and damping at the tension of the wires: the kernel that every control period calls."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.compiled import entry

Array = NDArray[np.float64]
Index = NDArray[np.intp]
NEARLY_TAUT = 1e-6
"""Slack up to which a wire counts as taut [m]."""


class Rewritten(NamedTuple):
    """Forces that follow the load, of B endoscopes: views of MuJoCo's fields, to write through.

    With two planes, friction is written by way of `SharedFriction`: `sheath` and `joints` are no views then.

    Attributes:
        sheath: breakaway friction of the sheath elements, (B, wires, elements) [N].
        joints: breakaway friction of each hinge of a group, (B, planes, groups) [N m].
        damping: damping of the wire segments, (B, wires, elements + 1) [N s / m].
        inertia: time step times damping, (B, wires, elements + 1) [kg]: see `model.py`.
        loss: friction of pairs of neighbours, along and across, (B, 2, pairs); none with one plane.
        coefficient: of their tendons, (B, 2, wraps); likewise.
    """

    sheath: Array
    joints: Array
    damping: Array
    inertia: Array
    loss: Array
    coefficient: Array


class LoadLaw(NamedTuple):
    """Parameters of B endoscopes by which forces follow the load.

    Attributes:
        hinge: (planes, vertebrae), as of `Layout`.
        pulley: (planes,), as of `Layout`.
        element: (wires, elements), as of `Layout`.
        wire: (B, 4) moment arm [m], stiffness k [N / m] and k2 [N / m^2] of a segment, own damping [N s / m].
        rest_stretch: (B, wires, elements + 1) stretch of each segment at positions of zero [m].
        joint: (B, groups) own friction of a hinge of each group [N m].
        routing: (B,) friction of wires on vertebrae times moment arm [m].
        wrapped: (vertebrae, groups) share of the turn of each hinge that a hinge of each group feels [-].
        time_step: [s].
        ahead: how far ahead a segment counts as taut [s].
    """

    hinge: Index
    pulley: Index
    element: Index
    wire: Array
    rest_stretch: Array
    joint: Array
    routing: Array
    wrapped: Array
    time_step: float
    ahead: float


@entry
def follow_load(
    law: LoadLaw, rewritten: Rewritten, qpos: Array, qvel: Array, half_share: Array, floor: Array
) -> None:
    """Write the friction of the sheath and of the hinges, and the damping of the wires, of B endoscopes.

    These are `tension_at`, `element_friction` and `hinge_friction`, from the pulley to the tip. Damping
    holds, beside the wire's own, time step times stiffness: with it, and with as much inertia times the time
    step, a step is one of backward Euler (`model.py`). A segment that will be taut before the next update has
    it already.

    Args:
        law: of the endoscopes.
        rewritten: where friction, damping and inertia go.
        qpos: (B, nq) positions.
        qvel: (B, nv) velocities.
        half_share: (B,) half the friction of an element per unit of the tension on both its sides [-].
        floor: (B,) friction of an element that does not depend on the tension [N].
    """
    time_step = law.time_step
    wires, elements = law.element.shape
    planes, (vertebrae, groups) = len(law.pulley), law.wrapped.shape
    for b in range(len(qpos)):
        arm, stiffness, quadratic, own = law.wire[b, 0], law.wire[b, 1], law.wire[b, 2], law.wire[b, 3]
        for plane in range(planes):
            bend, bend_rate = 0.0, 0.0
            for joint in law.hinge[plane]:
                bend += qpos[b, joint]
                bend_rate += qvel[b, joint]
            at_tip = 0.0
            for w in range(plane * wires // planes, (plane + 1) * wires // planes):
                side = 1.0 - 2.0 * (w % 2)
                pulley = law.pulley[plane]
                start, start_rate = side * qpos[b, pulley], side * qvel[b, pulley]
                before = 0.0
                for i in range(elements + 1):
                    if i < elements:
                        end, end_rate = qpos[b, law.element[w, i]], qvel[b, law.element[w, i]]
                    else:
                        end, end_rate = side * arm * bend, side * arm * bend_rate
                    stretch = law.rest_stretch[b, w, i] + start - end
                    soon = stretch + law.ahead * (start_rate - end_rate)
                    taut = max(stretch, 0.0)
                    tension = taut * (stiffness + quadratic * taut)
                    if i > 0:
                        rewritten.sheath[b, w, i - 1] = half_share[b] * (tension + before) + floor[b]
                    damping = 0.0
                    if max(stretch, soon) > -NEARLY_TAUT:
                        damping = own + time_step * (stiffness + 2 * quadratic * taut)
                    rewritten.damping[b, w, i] = damping
                    rewritten.inertia[b, w, i] = time_step * damping
                    before, start, start_rate = tension, end, end_rate
                at_tip += before

            for g in range(groups):
                felt = 0.0
                for v in range(vertebrae):
                    turn = abs(qpos[b, law.hinge[0, v]])
                    if planes == 2:
                        turn = math.hypot(turn, qpos[b, law.hinge[1, v]])
                    felt += turn * law.wrapped[v, g]
                rewritten.joints[b, plane, g] = law.joint[b, g] + law.routing[b] * at_tip * felt
