"""Quasi-static equilibrium of one bending plane after an increment of the pull.

The two wires of a plane and the section between them are one chain, from the pulley along wire a to the tip
and back along wire b:

    pulley p - a_1 - ... - a_E - z - b_E - ... - b_1 - pulley p,     z = r (theta_1 n_1 + ... + theta_G n_G)

A segment between two nodes is a spring that cannot push. A node is an element of the sheath, but z, which is
where the wires are at the tip: the moment arm r times the bend, that is the sum over the groups of n equal
hinges at the angle theta.

An element of the sheath rubs on its node with the force F = c (T_left + T_right) + floor (capstan, see
`twin/mechanics/friction.py`), a group of n equal hinges with the torque F_g; T(s) is the tension of a segment
at a stretch s. In each increment the positions minimise elastic energy plus dissipation,

    E(x) + F |x - x_before|  ->  min      so that      T_left - T_right  in  F sign(x - x_before)

(incremental energy minimisation: Mielke and Roubicek 2015, Rate-Independent Systems, chapter 1.6; with F that
follows the state: chapter 3.2). F is that at the end of the increment, found together with the positions.

Which nodes slip, and in which direction, is found by an active-set form of Newton's method (Hintermueller,
Ito and Kunisch 2002): the linear system is tridiagonal, with the groups of hinges folded into the row of z
and the pulley's own spring added as a border. Where Newton's steps do not settle, sweeps over the nodes
(Gauss-Seidel) take turns with them: each node in turn is brought to its own equilibrium between its
neighbours. Sweeps converge for these chains (Rheinboldt 1970, M-functions), but slowly.
"""

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.drive import PULLEY_STIFFNESS
from twin.mechanics.friction import CAUGHT_UP
from twin.mechanics.kernels import kernel
from twin.mechanics.wire import taut_part

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

_taut_part = kernel(taut_part)

HELD = 1e-3  # share of its stiffness that a slack segment has, only in the linear system
RESIDUAL_N = 1e-7  # force that is missing from equilibrium at any node, at most [N]
NODE, BEFORE, STRETCH, STRETCH_BEFORE, TENSION, FORCE, SLOPE = range(7)
"""Rows of the scratch arrays of a chain with N nodes and N + 1 segments.

Positions of the nodes, now and at the start of the increment [m] (N used); stretch of each segment, now and
at the start [m], its elastic tension [N], tension with damping [N], and the slope of that [N / m].
"""


class Segment(NamedTuple):
    """Law of one segment of wire in an increment."""

    stiffness: float  # [N / m]
    quadratic: float  # growth of the stiffness [N / m^2]
    damping: float  # over the time of the increment [N / m]
    width: float  # of the toe [m]


class Hinge(NamedTuple):
    """Law of one hinge in an increment."""

    stiffness: float  # [N m / rad]
    cubic: float  # growth of the stiffness [N m / rad^3]
    damping: float  # over the time of the increment [N m / rad]


class Plane(NamedTuple):
    """Parameters of one plane, or of two, for one increment; one uses the first of two numbers."""

    elements: int  # E, of the sheath of one wire
    rest: Array  # (2 E + 2,) stretch of each segment where all positions are zero [m]
    segment: Segment
    per_tension: float  # c, friction of an element per tension on each side [-]
    floor: float  # friction of an element that does not depend on the tension [N]
    hinge: Hinge
    joint_friction: Array  # (G,) own friction of a hinge of each group [N m]
    size: Array  # (G,) hinges of each group
    arm: float  # r, moment arm of the wires [m]
    routing: float  # friction coefficient of wires on vertebrae [-]
    straight: tuple[float, float]  # angle of a hinge where nothing pulls, in each plane [rad]
    target: tuple[float, float]  # distance that each pulley is driven to [m]
    holds: float  # friction of the sheath at rest over that of sliding [-]


@kernel
def bend_of(size: Array, hinge: Array) -> float:
    """Return the bending angle [rad] from number and angle of the hinges of each group."""
    bend = 0.0
    for g in range(len(hinge)):
        bend += size[g] * hinge[g]
    return bend


@kernel
def load_of(law: Segment, stretch: float, before: float) -> tuple[float, float, float]:
    """Return elastic tension [N], tension with damping [N] and its slope [N / m] of a segment.

    It is stretched by `stretch`, and was by `before` at the start of the increment [m].
    """
    taut, share = _taut_part(stretch, law.width)
    tension = taut * (law.stiffness + law.quadratic * taut)
    force = tension
    if law.damping > 0.0:
        force += law.damping * (taut - _taut_part(before, law.width)[0])
    slope = share * (law.stiffness + 2.0 * law.quadratic * taut + law.damping)
    if force <= 0.0:  # no wire pushes, and no jump is left for which there would be no equilibrium
        force = slope = 0.0
    return tension, force, slope


@kernel
def hinge_torque(law: Hinge, rest: float, angle: float, before: float) -> tuple[float, float]:
    """Return the torque of spring and damping of a hinge [N m] and its slope [N m / rad]."""
    away = angle - rest
    torque = away * (law.stiffness + law.cubic * away * away) + law.damping * (angle - before)
    slope = law.stiffness + 3.0 * law.cubic * away * away + law.damping
    return torque, slope


@kernel
def larger(a: float, b: float) -> float:
    """Return the larger of two numbers; infinity where one is no number."""
    if a >= b:
        return a
    return b if b > a else math.inf


@kernel
def turn_of(size: float, angle: float, turned: float) -> float:
    """Return the angle by which a group of `size` hinges turns the wires in both planes [rad].

    One hinge has an `angle` [rad] in this plane, and the square `turned` of it in the other one [rad^2].
    """
    return size * math.sqrt(angle * angle + turned)


NEWTON_STEPS = 25
SWEEPS = 25  # in the first turn; each turn has twice as many as the one before, up to 32 times these
ROUNDS = 40  # times that Newton's steps and sweeps take turns, before the increment is given up
LOOSE = 40.0  # slack of a segment whose toe has hardly a force, over its width [-]
TRIALS = 80  # most steps of the bracketed search for the equilibrium of one node

LOWER, MAIN, UPPER, RIGHT, BORDER = range(7, 12)
"""Rows of the linear system of the nodes, after those of the chain.

Three diagonals [N / m], right side [N] and then solution [m], and response to the pulley [-].
"""
HINGE_BEFORE, WRAPPED, HINGE_RESIDUAL, HINGE_SLOPE = range(4)
"""Rows of the groups of hinges.

Angle of a hinge at the start of the increment [rad], routing friction as a share of the tension [-], torque
that is missing [N m], and its derivative by the angle [N m / rad].
"""


class Place(NamedTuple):
    """What moves a node: an element of the sheath by itself [m], or the hinges of a group [rad]."""

    before: float  # where it was at the start of the increment
    per_tension: float  # friction per tension on each side [-]
    floor: float  # friction that does not depend on the tension [N] or [N m]
    holds: float  # friction at rest over that of sliding [-]
    arm: float  # moment arm [m]; 1 of an element, as is the next
    size: float  # hinges of the group
    others: float  # bend of the other groups [rad]
    hinge: Hinge
    straight: float  # angle of a hinge where nothing pulls [rad]


class Work(NamedTuple):
    """Scratch arrays of `solve_plane`, for E elements and G groups of hinges."""

    chain: Array  # (12, 2 E + 2) rows of nodes and segments
    group: Array  # (4, G) rows of groups of hinges

    @classmethod
    def of(cls, elements: int, groups: int) -> Self:
        """Return scratch arrays."""
        return cls(np.zeros((12, 2 * elements + 2)), np.zeros((4, groups)))


@kernel
def solve_plane(
    plane: Plane, work: Work, element: Array, hinge: Array, pulley: float, slip: Signs, turn: Signs
) -> tuple[float, float]:
    """Bring a plane to equilibrium after an increment; return the pulley [m] and the force missing [N].

    Rewritten are the positions of the elements (2 E,) in the order of the chain [m], the angle of a hinge of
    each group (G,) [rad], and the directions in which elements and groups slide: -1, 0 or 1, of the last
    increment. The scratch arrays hold the tensions at the end.
    """
    E, chain, group = plane.elements, work.chain, work.group
    for j in range(2 * E):
        chain[BEFORE, j if j < E else j + 1] = element[j]
    chain[BEFORE, E] = plane.arm * bend_of(plane.size, hinge)
    for i in range(2 * E + 1):
        chain[NODE, i] = chain[BEFORE, i]
    for g in range(len(hinge)):
        group[HINGE_BEFORE, g] = hinge[g]
    _fill_stretch(plane, chain, chain[STRETCH_BEFORE], pulley)
    _load_segments(plane, chain, pulley)
    if plane.holds > 1.0:
        _hold_caught_up(plane, chain, slip)
    pulley = pulley + _pulley_force(plane, chain, pulley) / PULLEY_STIFFNESS

    missing = math.inf
    for turns in range(ROUNDS):
        pulley, missing, settled = _settle(plane, work, hinge, pulley, slip, turn)
        if settled:
            break
        for _ in range(SWEEPS << min(turns, 5)):
            pulley = _sweep(plane, work, hinge, pulley, slip, turn)
    for j in range(2 * E):
        element[j] = chain[NODE, j if j < E else j + 1]
    return pulley, missing


@kernel
def _fill_stretch(plane: Plane, chain: Array, stretch: Array, pulley: float) -> None:
    """Fill in the stretch of all segments [m]; below 0 where one is slack."""
    last = 2 * plane.elements + 1
    for i in range(last + 1):
        left = pulley if i == 0 else chain[NODE, i - 1]
        right = pulley if i == last else chain[NODE, i]
        stretch[i] = plane.rest[i] + left - right


@kernel
def _load_segments(plane: Plane, chain: Array, pulley: float) -> None:
    """Fill in stretch, tension, force and slope of all segments."""
    _fill_stretch(plane, chain, chain[STRETCH], pulley)
    for i in range(2 * plane.elements + 2):
        loaded = load_of(plane.segment, chain[STRETCH, i], chain[STRETCH_BEFORE, i])
        chain[TENSION, i], chain[FORCE, i], chain[SLOPE, i] = loaded


@kernel
def _hold_caught_up(plane: Plane, chain: Array, slip: Signs) -> None:
    """Hold the elements that have caught up with what pulls them, by the tensions before an increment."""
    most = 1.0 + CAUGHT_UP * (plane.holds - 1.0)
    for j in range(len(slip)):
        i = j if j < plane.elements else j + 1
        ahead, behind = chain[TENSION, i], chain[TENSION, i + 1]
        if abs(ahead - behind) <= most * (plane.per_tension * (ahead + behind) + plane.floor):
            slip[j] = 0


@kernel
def _pulley_force(plane: Plane, chain: Array, pulley: float) -> float:
    """Return the force that is missing at the pulley [N], between its spring and both wires."""
    first, last = chain[FORCE, 0], chain[FORCE, 2 * plane.elements + 1]
    missing: float = PULLEY_STIFFNESS * (plane.target[0] - pulley) - first + last
    return missing


@kernel
def _settle(
    plane: Plane, work: Work, hinge: Array, pulley: float, slip: Signs, turn: Signs
) -> tuple[float, float, bool]:
    """Take Newton's steps; return the pulley [m], the force missing [N], and whether it is in equilibrium."""
    missing = math.inf
    for _ in range(NEWTON_STEPS):
        _load_segments(plane, work.chain, pulley)
        nodes_changed, of_nodes = _assemble_nodes(plane, work.chain, slip)
        hinges_changed, of_hinges = _assemble_hinges(plane, work.chain, work.group, hinge, turn)
        of_pulley = _pulley_force(plane, work.chain, pulley)
        missing = larger(larger(of_nodes, of_hinges), abs(of_pulley))
        if not nodes_changed and not hinges_changed and missing <= RESIDUAL_N:
            return pulley, missing, True
        pulley += _step(plane, work.chain, work.group, hinge, slip, turn, of_pulley)
    return pulley, missing, False


@kernel
def _direction(force: float, friction: float) -> int:
    """Return the direction in which a node leaves its place: 1, -1, or 0 where friction holds it."""
    if not abs(force) > friction:
        return 0
    return 1 if force > 0.0 else -1


@kernel
def _next_sign(sign: int, moved: float, force: float, at_rest: float) -> int:
    """Return the direction in which a node slides, from that assumed, its motion and the net force on it."""
    if sign != 0:  # what slid stops where it would go back
        return 0 if moved * sign < 0.0 else sign
    return _direction(force, at_rest + RESIDUAL_N)


@kernel
def _assemble_nodes(plane: Plane, chain: Array, slip: Signs) -> tuple[bool, float]:
    """Fill the rows of the sheath's elements; return whether a sign changed, and the force missing [N]."""
    E, c = plane.elements, plane.per_tension
    changed, missing = False, 0.0
    for j in range(2 * E):
        i = j if j < E else j + 1
        ahead, behind = chain[FORCE, i], chain[FORCE, i + 1]
        friction = c * (chain[TENSION, i] + chain[TENSION, i + 1]) + plane.floor
        moved = chain[NODE, i] - chain[BEFORE, i]
        s = _next_sign(slip[j], moved, ahead - behind, plane.holds * friction)
        if s != slip[j]:
            slip[j] = s
            changed = True
        if s == 0:
            chain[LOWER, i] = chain[UPPER, i] = 0.0
            chain[MAIN, i], chain[RIGHT, i] = 1.0, -moved
            changed = changed or moved != 0.0
            continue
        A, B = (1.0 - s * c) * chain[SLOPE, i], (1.0 + s * c) * chain[SLOPE, i + 1]
        chain[LOWER, i], chain[MAIN, i], chain[UPPER, i] = -A, A + B, -B
        chain[RIGHT, i] = ahead - behind - s * friction
        missing = larger(missing, abs(chain[RIGHT, i]))
        if A == 0.0 or B == 0.0:  # slack on one side: neighbours that slide with it may be held by nothing
            chain[MAIN, i] += HELD * plane.segment.stiffness
    return changed, missing


@kernel
def _assemble_hinges(
    plane: Plane, chain: Array, group: Array, hinge: Array, turn: Signs
) -> tuple[bool, float]:
    """Fold the groups of hinges, which follow the moment of the tip, into the row of z; return likewise."""
    E, arm = plane.elements, plane.arm
    moment = arm * (chain[FORCE, E] - chain[FORCE, E + 1])
    both = chain[TENSION, E] + chain[TENSION, E + 1]
    changed, missing = False, 0.0
    A = B = rest = passed = 0.0
    for g in range(len(hinge)):
        size = plane.size[g]
        turned = turn_of(size, hinge[g], 0.0)
        wrapped = plane.routing * (passed + turned / 2.0)
        passed += turned
        torque, slope = hinge_torque(plane.hinge, plane.straight[0], hinge[g], group[HINGE_BEFORE, g])
        group[WRAPPED, g], group[HINGE_SLOPE, g] = wrapped, slope
        friction = plane.joint_friction[g] + arm * wrapped * both
        moved = hinge[g] - group[HINGE_BEFORE, g]
        s = _next_sign(turn[g], moved, moment - torque, friction)
        if s != turn[g]:
            turn[g] = s
            changed = True
        if s == 0:
            group[HINGE_RESIDUAL, g] = 0.0
            rest -= arm * size * moved
            changed = changed or moved != 0.0
            continue
        residual = moment - torque - s * friction
        group[HINGE_RESIDUAL, g] = residual
        missing = larger(missing, abs(residual) / arm)
        share = arm * size / slope
        A += share * arm * (1.0 - s * wrapped) * chain[SLOPE, E]
        B += share * arm * (1.0 + s * wrapped) * chain[SLOPE, E + 1]
        rest += share * residual
    chain[LOWER, E], chain[MAIN, E], chain[UPPER, E] = -A, 1.0 + A + B, -B
    chain[RIGHT, E] = rest + (arm * bend_of(plane.size, hinge) - chain[NODE, E])
    return changed, missing


@kernel
def _step(
    plane: Plane, chain: Array, group: Array, hinge: Array, slip: Signs, turn: Signs, of_pulley: float
) -> float:
    """Solve the linear system, move all nodes and hinges, and return the travel of the pulley [m]."""
    E, last, right, border = plane.elements, 2 * plane.elements, chain[RIGHT], chain[BORDER]
    # The border is how the first and the last element follow the pulley.
    for i in range(last + 1):
        border[i] = 0.0
    border[0] = 0.0 if slip[0] == 0 else -chain[LOWER, 0]
    border[last] = 0.0 if slip[last - 1] == 0 else -chain[UPPER, last]
    for i in range(1, last + 1):
        ratio = chain[LOWER, i] / chain[MAIN, i - 1]
        chain[MAIN, i] -= ratio * chain[UPPER, i - 1]
        right[i] -= ratio * right[i - 1]
        border[i] -= ratio * border[i - 1]
    right[last] /= chain[MAIN, last]
    border[last] /= chain[MAIN, last]
    for i in range(last - 1, -1, -1):
        right[i] = (right[i] - chain[UPPER, i] * right[i + 1]) / chain[MAIN, i]
        border[i] = (border[i] - chain[UPPER, i] * border[i + 1]) / chain[MAIN, i]

    first_slope, last_slope = chain[SLOPE, 0], chain[SLOPE, last + 1]
    yielding = PULLEY_STIFFNESS + first_slope * (1.0 - border[0]) + last_slope * (1.0 - border[last])
    pulley: float = (of_pulley + first_slope * right[0] + last_slope * right[last]) / yielding
    for i in range(last + 1):
        right[i] += border[i] * pulley

    of_a = plane.arm * chain[SLOPE, E] * (right[E - 1] - right[E])
    of_b = plane.arm * chain[SLOPE, E + 1] * (right[E] - right[E + 1])
    for g in range(len(hinge)):
        s = turn[g]
        pulled = (1.0 - s * group[WRAPPED, g]) * of_a - (1.0 + s * group[WRAPPED, g]) * of_b
        moved = hinge[g] + (group[HINGE_RESIDUAL, g] + pulled) / group[HINGE_SLOPE, g]
        hinge[g] = group[HINGE_BEFORE, g] if s == 0 else moved
    for j in range(last):
        i = j if j < E else j + 1
        chain[NODE, i] = chain[BEFORE, i] if slip[j] == 0 else chain[NODE, i] + right[i]
    chain[NODE, E] = plane.arm * bend_of(plane.size, hinge)
    return pulley


@kernel
def _sweep(plane: Plane, work: Work, hinge: Array, pulley: float, slip: Signs, turn: Signs) -> float:
    """Bring one node after the other to its own equilibrium; return the pulley's position [m]."""
    E, last, chain = plane.elements, 2 * plane.elements, work.chain
    for i in range(last + 1):
        if i == E:
            _sweep_hinges(plane, work, hinge, turn)
            continue
        left = pulley if i == 0 else chain[NODE, i - 1]
        right = pulley if i == last else chain[NODE, i + 1]
        ahead, behind = plane.rest[i] + left, plane.rest[i + 1] - right
        c, floor, free = plane.per_tension, plane.floor, Hinge(0.0, 0.0, 0.0)
        place = Place(chain[BEFORE, i], c, floor, plane.holds, 1.0, 1.0, 0.0, free, 0.0)
        # Further on, the force is against the node: the wire that pulls it there would be slack.
        loose = LOOSE * plane.segment.width
        x, s = _rest(plane.segment, chain, i, place, (ahead + loose, -behind - loose), ahead, behind)
        chain[NODE, i], slip[i if i < E else i - 1] = x, s
    _load_segments(plane, chain, pulley)
    yielding = PULLEY_STIFFNESS + chain[SLOPE, 0] + chain[SLOPE, last + 1]
    moved: float = _pulley_force(plane, chain, pulley) / yielding
    return pulley + moved


@kernel
def _rest(
    law: Segment, chain: Array, i: int, place: Place, ends: tuple[float, float], ahead: float, behind: float
) -> tuple[float, int]:
    """Return where an element or a group comes to rest between its neighbours, and how it moves there.

    It moves node i: at z, the stretch on its left is `ahead` less z, that on its right `behind` plus z [m].
    The motion ends at the first of two `ends` forwards, at the other one backwards.
    """
    arm, wrapped = place.arm, place.per_tension
    s, x, near, far = 0, place.before, place.before, place.before
    for trial in range(TRIALS):
        z = arm * (place.others + place.size * x)
        a, a_force, a_slope = load_of(law, ahead - z, chain[STRETCH_BEFORE, i])
        b, b_force, b_slope = load_of(law, behind + z, chain[STRETCH_BEFORE, i + 1])
        torque, slope = hinge_torque(place.hinge, place.straight, x, place.before)
        force = arm * (a_force - b_force) - torque
        friction = place.floor + arm * wrapped * (a + b)
        if trial == 0:
            s = _direction(force, place.holds * friction)
            if s == 0:
                break
            far = ends[0] if s > 0 else ends[1]
        excess = force - s * friction
        if abs(excess) <= 0.1 * RESIDUAL_N * arm:
            break
        if excess * s > 0.0:
            near = x
        else:
            far = x
        slope += arm * arm * place.size * ((1.0 - s * wrapped) * a_slope + (1.0 + s * wrapped) * b_slope)
        x += excess / slope
        if not min(near, far) < x < max(near, far):
            x = (near + far) / 2.0
    return x, s


@kernel
def _sweep_hinges(plane: Plane, work: Work, hinge: Array, turn: Signs) -> None:
    """Bring one group of hinges after the other to its own equilibrium, and the tip with them."""
    E, chain, size, passed = plane.elements, work.chain, plane.size, 0.0
    ahead, behind = plane.rest[E] + chain[NODE, E - 1], plane.rest[E + 1] - chain[NODE, E + 1]
    bend = bend_of(size, hinge)
    for g in range(len(hinge)):
        others = bend - size[g] * hinge[g]
        turned = turn_of(size[g], hinge[g], 0.0)
        wrapped = plane.routing * (passed + turned / 2.0)
        passed += turned
        before, floor = work.group[HINGE_BEFORE, g], plane.joint_friction[g]
        place = Place(before, wrapped, floor, 1.0, plane.arm, size[g], others, plane.hinge, plane.straight[0])
        ends = math.inf, -math.inf
        hinge[g], turn[g] = _rest(plane.segment, chain, E, place, ends, ahead, behind)
        bend = others + size[g] * hinge[g]
    chain[NODE, E] = plane.arm * bend
