"""Dry friction that opposes the motion in both bending planes as one, by constraints that MuJoCo has.

`twin/reduced/two_planes.py` states the law: neighbours slide in the direction tau / F, with tau the
forces that friction holds over the friction F of each. Here every pair has a constraint along tau and one
across it. With a friction of 1 each, in units of F, the pair slides along tau, and across it hardly at all.
The direction follows the force from one control period to the next. What slides gives way as the direction
turns, so that the force across it, which determines the turn, falls: the step is implicit.

Stick and slip: elements of the sheath at rest are held by more than they slide against (`stiction`). One that
has broken away slides until it has caught up with what pulls it; then it is held again, and the tip moves in
steps. Friction falls within some control periods: MuJoCo takes two time steps to brake what slides, so that
an element let go at once would slide several times too far.
"""

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import CAUGHT_UP, LEAST_FRICTION, hinge_groups
from twin.mechanics.kernels import kernel
from twin.physics.layout import Index, Layout
from twin.physics.load import Forces
from twin.preset.preset import Preset

Array = NDArray[np.float64]

LEAST_FORCE = 1e-3  # force over friction above which it determines a direction [-]
BREAKS_AWAY = 0.99  # force beyond sliding friction that breaks away, as a share of what stiction adds [-]
FALL = 0.8  # factor within a control period on what stiction adds to the friction of what slides [-]


class Pairs(NamedTuple):
    """Pairs of neighbours in two planes that share their friction: elements, pulley to tip, then hinges."""

    direction: Array  # (pairs,) of the force that friction holds, over the friction of each [rad]; state
    dof: Index  # (2, pairs) joint of each neighbour, of hinges the first of a group
    members: Index  # (pairs,) joints of each neighbour
    first_wrap: Index  # (pairs + 1,) place of the first coefficient of each pair
    arm: float  # moment arm of a wire [m]
    hinge_stiffness: float  # of one hinge [N m / rad]

    @classmethod
    def of(cls, preset: Preset, layout: Layout) -> Self:
        """Return the pairs of a preset, all directions in the plane of wires a and b."""
        groups = hinge_groups(preset.vertebrae)
        a, b, c, d = layout.element
        hinges = layout.hinge[:, [group[0] for group in groups]]
        members = np.array([1] * (a.size + b.size) + [len(group) for group in groups])
        return cls(
            direction=np.zeros(len(members)),
            dof=np.concatenate([np.stack([a, c]), np.stack([b, d]), hinges], axis=1),
            members=members,
            first_wrap=np.concatenate([[0], np.cumsum(2 * members)]),
            arm=preset.wire_offset,
            hinge_stiffness=preset.section_stiffness * preset.vertebrae,
        )


@kernel
def _friction(forces: Forces, pair: int, plane: int) -> float:
    """Return the friction of one neighbour of a pair [N], of hinges [N m]."""
    elements = forces.sheath.shape[1]
    if pair < 2 * elements:
        return max(float(forces.sheath[2 * plane + pair // elements, pair % elements]), LEAST_FRICTION)
    return max(float(forces.joints[plane, pair - 2 * elements]), LEAST_FRICTION)


@kernel
def _stiffness(pairs: Pairs, forces: Forces, pair: int, plane: int, time_step: float) -> float:
    """Return the stiffness that holds one neighbour of a pair [N / m], of hinges [N m / rad].

    The damping of the wire segments holds that of each [N s / m].
    """
    elements, damping = forces.sheath.shape[1], forces.damping
    if pair < 2 * elements:
        wire, i = 2 * plane + pair // elements, pair % elements
        return float(damping[wire, i] + damping[wire, i + 1]) / time_step
    of_tips = float(damping[2 * plane, elements] + damping[2 * plane + 1, elements]) / time_step
    return pairs.hinge_stiffness + pairs.arm**2 * float(pairs.members[pair]) * of_tips


@kernel
def write_pairs(pairs: Pairs, forces: Forces) -> None:
    """Write friction and coefficients of the tendons along and across the directions."""
    for k in range(len(pairs.direction)):
        first, second = _friction(forces, k, 0), _friction(forces, k, 1)
        largest = max(first, second)
        cos, sin = math.cos(pairs.direction[k]), math.sin(pairs.direction[k])
        forces.loss[0, k] = forces.loss[1, k] = largest
        start, end = pairs.first_wrap[k], pairs.first_wrap[k + 1]
        middle = start + pairs.members[k]
        forces.coefficient[0, start:middle] = cos * first / largest
        forces.coefficient[0, middle:end] = sin * second / largest
        forces.coefficient[1, start:middle] = -sin * first / largest
        forces.coefficient[1, middle:end] = cos * second / largest


@kernel
def turn(pairs: Pairs, forces: Forces, constraint: Array, qvel: Array, time_step: float, part: float) -> None:
    """Turn the directions towards those of the forces (nv,) that friction holds, the only constraints.

    Neighbours slide by x_p = lambda e_p / F_p in a part of a period [s], with e along the direction, against
    springs k_p. Turned by alpha, they lose alpha c = alpha lambda sum k_p a_p^2 / F_p^2 of the force across,
    with a across it. So the turn by the force across is divided by 1 + c.
    """
    for k in range(len(pairs.direction)):
        before = pairs.direction[k]
        cos, sin = math.cos(before), math.sin(before)
        ahead = held = slid = softness = size = 0.0
        for plane, along, across in ((0, cos, -sin), (1, sin, cos)):
            dof, friction = pairs.dof[plane, k], _friction(forces, k, plane)
            tau = constraint[dof] / friction
            size = math.hypot(size, tau)
            held += tau * across
            ahead += tau * along
            slid += qvel[dof] * friction * along
            softness += _stiffness(pairs, forces, k, plane, time_step) * (across / friction) ** 2
        if size > LEAST_FORCE:
            # Back along the same line is no turn.
            angle = math.atan2(math.copysign(held, held * ahead), abs(ahead))
            pairs.direction[k] = before + angle / (1 + part * abs(slid) * softness)


class Sticking(NamedTuple):
    """Stick and slip of the elements. With two planes, neighbours stick and slip as one."""

    grip: Array  # (sides, elements) share of what stiction adds that holds each, 1 at rest [-]; state
    stiction: float  # friction at rest beyond that of sliding, as a share of it [-]
    period: float  # control period [s]

    @classmethod
    def of(cls, preset: Preset, layout: Layout) -> Self:
        """Return the elements of a preset at rest; sides are wires a and b, or a with c and b with d."""
        return cls(np.ones((2, layout.element.shape[1])), preset.stiction, preset.control_period)


@kernel
def hold(sticking: Sticking, forces: Forces, part: float) -> None:
    """Let go what breaks away, hold what has caught up, and raise the friction of both.

    Forces have the friction of sliding; the time since the last call is a part of the control period [s].
    """
    stiction, fall = sticking.stiction, FALL ** (part / sticking.period)
    sides, elements = sticking.grip.shape
    for side in range(sides):
        for i in range(elements):
            pulled = 0.0
            for w in range(side, len(forces.sheath), sides):
                tension = forces.tension[w, i + 1] - forces.tension[w, i]
                pulled = math.hypot(pulled, tension / forces.sheath[w, i])
            grip = sticking.grip[side, i]
            if pulled - 1.0 >= BREAKS_AWAY * stiction or grip < 1.0:
                grip *= fall
            if pulled - 1.0 <= CAUGHT_UP * stiction:
                grip = 1.0
            sticking.grip[side, i] = grip
            for w in range(side, len(forces.sheath), sides):
                forces.sheath[w, i] *= 1 + stiction * grip
