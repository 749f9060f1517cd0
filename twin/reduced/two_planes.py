"""Quasi-static equilibrium of two bending planes, whose dry friction opposes their motion as one.

The equations are those of one plane (`one_plane.py`), but for the friction: at each place of the sheath and
at each group of hinges, neighbours in both planes have one: wires a and c, b and d, and the crossed hinges. A
second plane that nothing moves changes nothing in the first.

Coulomb friction is one force against the direction of a motion, not one against each of its components: with
each plane by itself, the tip would follow a circle of commands along a rounded square. With t the forces that
friction holds and F the friction of each neighbour, p = 1, 2,

    D = |F dx|,  F dx = (F_1 dx_1, F_2 dx_2)      so that      |tau| <= 1,  dx = 0  or  tau = F dx / |F dx|,

tau = (t_1 / F_1, t_2 / F_2): dissipation D is least together with the elastic energy. It is a projection,
which is what Newton's method needs (Alart and Curnier 1991): for any rho, tau = v / max(1, |v|) with
v = tau + rho F dx.

Newton's steps on all unknowns together are semismooth: what slides is found with them. The linear system
is that of one plane with blocks of 2 x 2. Where they do not settle in a whole increment it is divided, and
sweeps over the pairs of neighbours (Gauss-Seidel) take turns with them until less than `RESIDUAL_N` is
missing.

The direction of friction turns within an increment, from tau_0 to the tau at its end. Slip along tau alone,
as in one step of Euler's, is of first order; slip along tau + tau_0, the trapezoidal rule, is of second. So
a share of the slip of what slid before is taken along tau_0, and dx above is the rest. Only where friction
turns far is an increment divided.
"""

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.drive import PULLEY_STIFFNESS
from twin.mechanics.friction import CAUGHT_UP
from twin.mechanics.kernels import copy_row, copy_rows, kernel
from twin.reduced.one_plane import (
    HELD,
    RESIDUAL_N,
    Array,
    Hinge,
    Plane,
    Segment,
    Signs,
    hinge_torque,
    larger,
    load_of,
    turn_of,
)

Two = tuple[float, float]

FARTHEST_TURN = 0.3  # of friction in an increment, the sine of its angle: with more, it is divided
MOST_PARTS = 1024  # that an increment is divided into where no equilibrium is found
LEAD = 0.45  # share of the slip in the first direction: half is of second order, but not damped
LEAD_BELOW_N = 1.0  # force missing before a step after which the slip is known well enough for that
SWEEPS = 25  # in the first turn; each turn has twice as many as the one before, up to 8 times these
ROUNDS = 12  # times that Newton's steps and sweeps take turns, before the increment is given up
NEWTON_STEPS = 25
EAGER = 6  # whole steps; then one that led away is followed by a shorter one, as where wires turn slack
LEAST_SHARE = 1 / 16  # shortest of these steps, as a share of a whole one
FARTHEST = 2e-4  # travel of an element in a step, besides twice the pulleys' [m]: slack hardly holds it
TRIALS = 12  # most steps of the search for the rest of one pair: its wires may turn slack or taut
ROOT_STEPS = 30  # most steps of the search for the travel of a pair that slides
LEAST_TORQUE = 1e-12  # smallest friction of a hinge [N m]: a force over its friction must be a number

STRETCH_BEFORE, TENSION, FORCE, SLOPE = range(4)
"""Columns of a segment of each plane, as the rows of `one_plane.py`."""
PLACE, BEFORE, LED, FIRST, PULLED, FRICTION, OWN, STIFFNESS, WRAPPED = range(9)
"""Columns of a pair of neighbours, one of each plane: elements, then groups of hinges.

Position, that at the start of the increment, and slip in the first direction [m or rad]; that direction, tau
at the start, of those that slid before, else 0; net force that friction holds, and friction [N or N m];
stiffness of the spring of a hinge, and all that it feels [N / m or N m / rad]; friction of both hinges per
tension [m].
"""
AHEAD, BEHIND, MAIN, MISSING, BORDER = 0, 2, 4, 6, 7
"""First columns of a linear system: of pairs by the stretch on both sides, or of nodes by one another.

What is ahead, behind and its own, its right side, which becomes the solution, and travel per travel of the
pulleys.
"""


class Positions(NamedTuple):
    """Positions and slip of two planes, as in `ReducedState`."""

    element: Array  # (2, 2 E) [m]
    hinge: Array  # (2, G) [rad]
    pulley: Array  # (2,) [m]
    slip: Signs  # (2, 2 E) whether elements slide
    turn: Signs  # (2, G) whether groups of hinges do


class BothPlanes(NamedTuple):
    """Scratch arrays of two planes with P = 2 E + G pairs of neighbours, one of each plane."""

    start: Positions  # at the start of the increment
    segment: Array  # (2 E + 2, 2, 4) segments of the chain
    pair: Array  # (P, 2, 9) pairs of neighbours
    slides: NDArray[np.int64]  # (P,) whether they slide
    of_pair: Array  # (P, 2, 7) linear system of the pairs
    of_node: Array  # (2 E + 1, 2, 9) linear system of the nodes of the chain
    of_pulley: Array  # (2, 3) linear system of the pulleys, with its right side and then solution

    @classmethod
    def of(cls, elements: int, groups: int) -> Self:
        """Return scratch arrays."""
        pairs, element, hinge = 2 * elements + groups, np.zeros((2, 2 * elements)), np.zeros((2, groups))
        return cls(
            start=Positions(element, hinge, np.zeros(2), element.astype(np.int8), hinge.astype(np.int8)),
            segment=np.zeros((2 * elements + 2, 2, 4)),
            pair=np.zeros((pairs, 2, 9)),
            slides=np.zeros(pairs, np.int64),
            of_pair=np.zeros((pairs, 2, 7)),
            of_node=np.zeros((2 * elements + 1, 2, 9)),
            of_pulley=np.zeros((2, 3)),
        )


@kernel
def _copy(to: Positions, values: Positions) -> None:
    copy_rows(to.element, values.element)
    copy_rows(to.hinge, values.hinge)
    copy_row(to.pulley, values.pulley)
    copy_rows(to.slip, values.slip)
    copy_rows(to.turn, values.turn)


@kernel
def solve_both_planes(plane: Plane, both: BothPlanes, now: Positions) -> float:
    """Bring two planes to equilibrium after an increment; return the largest force missing [N].

    It is divided where friction turns far, or no equilibrium is found. Positions and slip are rewritten.
    """
    start, missing, parts = both.start, math.inf, 1
    _copy(start, now)
    while parts <= MOST_PARTS:
        if parts > 1:
            _copy(now, start)
        missing = turned = 0.0
        for left in range(parts, 0, -1):
            of_part, turn = _solve_part(plane, both, now, parts, left)
            missing, turned = max(missing, of_part), max(turned, turn)
            if not missing <= RESIDUAL_N:
                break
        if missing <= RESIDUAL_N and (turned <= FARTHEST_TURN or parts > 1):
            break
        parts *= 4
    return missing


@kernel
def _part_of(plane: Plane, parts: int, target: Two) -> Plane:
    """Return the parameters for one of equal parts of an increment, in which damping counts as much more."""
    segment, hinge = plane.segment, plane.hinge
    return Plane(
        plane.elements,
        plane.rest,
        Segment(segment.stiffness, segment.quadratic, segment.damping * parts, segment.width),
        plane.per_tension,
        plane.floor,
        Hinge(hinge.stiffness, hinge.cubic, hinge.damping * parts),
        plane.joint_friction,
        plane.size,
        plane.arm,
        plane.routing,
        plane.straight,
        target,
        plane.holds,
    )


@kernel
def _solve_part(whole: Plane, both: BothPlanes, now: Positions, parts: int, left: int) -> tuple[float, float]:
    """Bring two planes to equilibrium after a part of an increment, the first of those that are `left`.

    Return the largest force missing [N], and the sine of the largest angle by which friction turned.
    """
    count, pulley, pair, slides = 2 * whole.elements, now.pulley, both.pair, both.slides
    for k in range(len(pair)):
        slides[k] = now.slip[0, k] if k < count else now.turn[0, k - count]
        for p in range(2):
            pair[k, p, PLACE] = now.element[p, k] if k < count else now.hinge[p, k - count]
            pair[k, p, BEFORE], pair[k, p, LED] = pair[k, p, PLACE], 0.0
    _load(whole, both.segment, pair, pulley, True, 0, len(pair))
    way = (
        _pulley_force(whole, both, pulley, 0) / PULLEY_STIFFNESS,
        _pulley_force(whole, both, pulley, 1) / PULLEY_STIFFNESS,
    )
    rest = 1.0 - 1.0 / left
    plane = _part_of(whole, parts, (whole.target[0] - way[0] * rest, whole.target[1] - way[1] * rest))
    driven, missing, farthest = False, math.inf, FARTHEST
    for p in range(2):
        driven = driven or abs(way[p]) * PULLEY_STIFFNESS > RESIDUAL_N
        pulley[p] += way[p] / left
        farthest = max(farthest, FARTHEST + 2 * abs(way[p] / left))
    _hold_caught_up(plane, both)
    for k in range(len(pair)):
        t, u = pair[k, 0, PULLED] / pair[k, 0, FRICTION], pair[k, 1, PULLED] / pair[k, 1, FRICTION]
        size = math.sqrt(t * t + u * u)
        over = 1.0 / size if slides[k] != 0 and size > 0.0 else 0.0
        pair[k, 0, FIRST], pair[k, 1, FIRST] = t * over, u * over

    settled, turned = False, 0.0
    for turns in range(ROUNDS if parts > 1 else 1):
        for _ in range(SWEEPS << min(turns - 1, 3) if turns > 0 else 0):
            _sweep_both(plane, both, pulley)
        missing, settled = _settle(plane, both, pulley, farthest, turns == 0 and driven)
        if settled:
            break
    for k in range(len(pair)):
        t, u = pair[k, 0, PULLED] / pair[k, 0, FRICTION], pair[k, 1, PULLED] / pair[k, 1, FRICTION]
        turned = max(turned, abs(pair[k, 0, FIRST] * u - pair[k, 1, FIRST] * t))
        for p in range(2):
            if k < count:
                now.element[p, k], now.slip[p, k] = pair[k, p, PLACE], slides[k]
            else:
                now.hinge[p, k - count], now.turn[p, k - count] = pair[k, p, PLACE], slides[k]
    return missing if settled or parts > 1 else math.inf, turned


@kernel
def _hold_caught_up(plane: Plane, both: BothPlanes) -> None:
    """Hold the elements that have caught up with what pulls them, by the tensions before an increment."""
    most, pair = 1.0 + CAUGHT_UP * (plane.holds - 1.0), both.pair
    for k in range(2 * plane.elements if plane.holds > 1.0 else 0):
        v, w = pair[k, 0, PULLED] / pair[k, 0, FRICTION], pair[k, 1, PULLED] / pair[k, 1, FRICTION]
        if v * v + w * w <= most * most:
            both.slides[k] = 0


@kernel
def _load(
    plane: Plane, segment: Array, pair: Array, pulley: Array, begins: bool, first: int, end: int
) -> None:
    """Fill in all segments, and force, friction and stiffness of the pairs from `first` to `end`.

    Where the increment `begins`, stretch is also that at its start.
    """
    E, law, rest, size = plane.elements, plane.segment, plane.rest, plane.size
    for p in range(2):
        bend = 0.0
        for g in range(len(size)):
            bend += size[g] * pair[2 * E + g, p, PLACE]
        tip = plane.arm * bend
        node = pulley[p]
        for i in range(2 * E + 2):
            before = node
            if i == E:
                node = tip
            elif i == 2 * E + 1:
                node = pulley[p]
            else:
                node = pair[i if i < E else i - 1, p, PLACE]
            stretch = rest[i] + before - node
            if begins:
                segment[i, p, STRETCH_BEFORE] = stretch
            loaded = load_of(law, stretch, segment[i, p, STRETCH_BEFORE])
            segment[i, p, TENSION], segment[i, p, FORCE], segment[i, p, SLOPE] = loaded

    arm, passed, straight, own = plane.arm, 0.0, plane.straight, plane.joint_friction
    held = HELD * plane.segment.stiffness
    for k in range(first, min(end, 2 * E)):
        i = k if k < E else k + 1
        for p in range(2):
            pair[k, p, PULLED] = segment[i, p, FORCE] - segment[i + 1, p, FORCE]
            tension = segment[i, p, TENSION] + segment[i + 1, p, TENSION]
            pair[k, p, FRICTION] = plane.per_tension * tension + plane.floor
            pair[k, p, STIFFNESS] = max(segment[i, p, SLOPE] + segment[i + 1, p, SLOPE], held)
    for k in range(2 * E, end):
        g = k - 2 * E
        lateral = pair[k, 1, PLACE]
        turned = turn_of(size[g], pair[k, 0, PLACE], lateral * lateral)
        wrapped = arm * plane.routing * (passed + turned / 2.0)
        passed += turned
        pair[k, 0, WRAPPED] = wrapped
        for p in range(2):
            torque, slope = hinge_torque(plane.hinge, straight[p], pair[k, p, PLACE], pair[k, p, BEFORE])
            pair[k, p, PULLED] = arm * (segment[E, p, FORCE] - segment[E + 1, p, FORCE]) - torque
            rubbing = wrapped * (segment[E, p, TENSION] + segment[E + 1, p, TENSION])
            pair[k, p, FRICTION] = own[g] + rubbing + LEAST_TORQUE
            pair[k, p, OWN] = slope
            slope += arm * arm * size[g] * (segment[E, p, SLOPE] + segment[E + 1, p, SLOPE])
            pair[k, p, STIFFNESS] = slope


@kernel
def _pulley_force(plane: Plane, both: BothPlanes, pulley: Array, p: int) -> float:
    """Return the force that is missing at a pulley [N], between its spring and both wires."""
    first, last = both.segment[0, p, FORCE], both.segment[-1, p, FORCE]
    missing: float = PULLEY_STIFFNESS * (plane.target[p] - pulley[p]) - first + last
    return missing


class Rubbing(NamedTuple):
    """Friction of two neighbours that slide, F n, n = v / |v|, and its derivatives."""

    size: float  # |v|
    along: Two  # n
    across: Two  # m, which is square to n
    turned: Two  # F_p m_p / |v|: F_p n_p changes by it times the change of v along m
    of_force: Two  # of v_q with the force on each
    of_friction: Two  # with the friction
    of_slip: Two  # with the slip


@kernel
def rub(force: Two, friction: Two, slipped: Two, stiffness: float) -> Rubbing:
    """Return how two neighbours rub that have slipped, from the forces on them, friction and stiffness."""
    F, G = friction
    rho = stiffness / (F * F + G * G)
    f, g = 1.0 / F, 1.0 / G
    t, u = force[0] * f, force[1] * g
    v, w = t + rho * F * slipped[0], u + rho * G * slipped[1]
    size = math.sqrt(v * v + w * w)
    per = 1.0 / size if size > 0.0 else 0.0
    m, n = -w * per, v * per
    return Rubbing(
        size,
        (n, -m),
        (m, n),
        (F * m * per, G * n * per),
        (f, g),
        (rho * slipped[0] - t * f, rho * slipped[1] - u * g),
        (rho * F, rho * G),
    )


@kernel
def _settle(
    plane: Plane, both: BothPlanes, pulley: Array, farthest: float, begins: bool
) -> tuple[float, bool]:
    """Take Newton's steps; return the largest force missing [N], and whether it is in equilibrium.

    An element goes no further than `farthest` in a step [m]; where it `begins`, what slid in the last
    increment is let go first.
    """
    missing, before, share = math.inf, math.inf, 1.0
    leads, moved = begins, False
    for step in range(NEWTON_STEPS):
        _load(plane, both.segment, both.pair, pulley, False, 0, len(both.pair))
        if leads and before <= LEAD_BELOW_N and not moved:
            _lead(both.pair)
            leads = False
        missing, moved = _assemble(plane, both, begins and step == 0)
        for p in range(2):
            missing = larger(missing, abs(_pulley_force(plane, both, pulley, p)))
        if missing <= RESIDUAL_N and not moved:
            return missing, True
        if not missing < math.inf:
            break
        _gather(plane, both)
        eliminate(both.of_node)
        _pull(plane, both, pulley)
        if step >= EAGER:
            share = max(share / 2, LEAST_SHARE) if missing > before else min(2 * share, 1.0)
        before = missing
        _move(plane, both, pulley, share, farthest)
    return missing, False


@kernel
def _assemble(plane: Plane, both: BothPlanes, begins: bool) -> tuple[float, bool]:
    """Fill the equations of the pairs; return the largest force missing [N], and if one is yet to move."""
    E, arm, pair, row = plane.elements, plane.arm, both.pair, both.of_pair
    slides, segment = both.slides, both.segment
    missing, unsettled, per_arm = 0.0, False, 1.0 / arm
    for k in range(len(pair)):
        hinges = k >= 2 * E
        i = E if hinges else k if k < E else k + 1
        reach, per_reach = (arm, per_arm) if hinges else (1.0, 1.0)
        gain = pair[k, 0, WRAPPED] if hinges else plane.per_tension
        F = (pair[k, 0, FRICTION], pair[k, 1, FRICTION])
        force = (pair[k, 0, PULLED], pair[k, 1, PULLED])
        slipped = (
            pair[k, 0, PLACE] - pair[k, 0, BEFORE] - pair[k, 0, LED],
            pair[k, 1, PLACE] - pair[k, 1, BEFORE] - pair[k, 1, LED],
        )
        limit = 0.0 if begins else 1.0
        if slides[k] == 0:
            limit = (1.0 if hinges else plane.holds) + reach * RESIDUAL_N / (F[0] + F[1])
        r = rub(force, F, slipped, pair[k, 0, STIFFNESS] + pair[k, 1, STIFFNESS])
        if not r.size > limit:  # it goes back to where it was
            unsettled = unsettled or slides[k] != 0
            slides[k] = 0
            for p in range(2):
                for q in range(MISSING):
                    row[k, p, q] = 0.0
                row[k, p, MAIN + p] = 1.0
                row[k, p, MISSING] = pair[k, p, BEFORE] - pair[k, p, PLACE]
                pair[k, p, LED] = 0.0
                unsettled = unsettled or row[k, p, MISSING] != 0.0
            continue
        unsettled = unsettled or slides[k] == 0
        slides[k] = 1
        for p in range(2):
            row[k, p, MISSING] = force[p] - F[p] * r.along[p]
            missing = larger(missing, abs(row[k, p, MISSING]) * per_reach)
            for q in range(2):
                same, turned = 1.0 if p == q else 0.0, r.turned[p] * r.across[q]
                of_force = same - turned * r.of_force[q]
                of_sum = gain * (same * r.along[p] + turned * r.of_friction[q])
                row[k, p, AHEAD + q] = (reach * of_force - of_sum) * segment[i, q, SLOPE]
                row[k, p, BEHIND + q] = (reach * of_force + of_sum) * segment[i + 1, q, SLOPE]
                row[k, p, MAIN + q] = turned * r.of_slip[q] + of_force * pair[k, q, OWN]
            if not hinges and min(segment[i, p, SLOPE], segment[i + 1, p, SLOPE]) == 0.0:
                # Slack on one side: neighbours that slide with it may be held by nothing.
                row[k, p, MAIN + p] += HELD * plane.segment.stiffness
    return missing, unsettled


@kernel
def _lead(pair: Array) -> None:
    """Take a share `LEAD` of the slip of what slid before as slip in the first direction of friction."""
    for k in range(len(pair)):
        F, G, t, u = pair[k, 0, FRICTION], pair[k, 1, FRICTION], pair[k, 0, FIRST], pair[k, 1, FIRST]
        x, y = F * (pair[k, 0, PLACE] - pair[k, 0, BEFORE]), G * (pair[k, 1, PLACE] - pair[k, 1, BEFORE])
        travel = LEAD * math.sqrt(x * x + y * y) if x * t + y * u > 0.0 else 0.0
        pair[k, 0, LED], pair[k, 1, LED] = travel * t / F, travel * u / G


@kernel
def _gather(plane: Plane, both: BothPlanes) -> None:
    """Fill the equations of the nodes: elements, and the tip, into which the groups of hinges are folded."""
    E, arm, row, node, size = plane.elements, plane.arm, both.of_pair, both.of_node, plane.size
    for k in range(2 * E):
        i = k if k < E else k + 1
        for p in range(2):
            for q in range(2):
                ahead, behind = row[k, p, AHEAD + q], row[k, p, BEHIND + q]
                node[i, p, AHEAD + q], node[i, p, BEHIND + q] = -ahead, -behind
                node[i, p, MAIN + q] = row[k, p, MAIN + q] + ahead + behind
                node[i, p, BORDER + q] = 0.0
            node[i, p, MISSING] = row[k, p, MISSING]
    for p in range(2):
        for q in range(9):
            node[E, p, q] = 0.0
        node[E, p, MAIN + p] = 1.0
    for g in range(len(size)):
        k, weight = 2 * E + g, arm * size[g]
        divide(row, k, AHEAD, MAIN)
        divide(row, k, MISSING, MISSING + 1)
        for p in range(2):
            for q in range(2):
                ahead, behind = weight * row[k, p, AHEAD + q], weight * row[k, p, BEHIND + q]
                node[E, p, AHEAD + q] -= ahead
                node[E, p, BEHIND + q] -= behind
                node[E, p, MAIN + q] += ahead + behind
            node[E, p, MISSING] += weight * row[k, p, MISSING]
    for p in range(2):
        for q in range(2):  # the pulley is at both ends
            node[0, p, BORDER + q], node[0, p, AHEAD + q] = -node[0, p, AHEAD + q], 0.0
            node[2 * E, p, BORDER + q], node[2 * E, p, BEHIND + q] = -node[2 * E, p, BEHIND + q], 0.0


@kernel
def divide(rows: Array, k: int, first: int, end: int) -> None:
    """Divide columns of the two rows k by their main block, from the left, in place."""
    a, b, c, d = rows[k, 0, MAIN], rows[k, 0, MAIN + 1], rows[k, 1, MAIN], rows[k, 1, MAIN + 1]
    over = 1.0 / (a * d - b * c)
    for q in range(first, end):
        above, below = rows[k, 0, q], rows[k, 1, q]
        rows[k, 0, q] = (d * above - b * below) * over
        rows[k, 1, q] = (a * below - c * above) * over


@kernel
def eliminate(node: Array) -> None:
    """Solve block-tridiagonal equations (N, 2, 9) in place, without pivots, for right side and border."""
    for i in range(len(node)):
        for p in range(2):
            for k in range(2):
                ahead = node[i, p, AHEAD + k]
                if ahead == 0.0:
                    continue
                node[i, p, MAIN] -= ahead * node[i - 1, k, BEHIND]
                node[i, p, MAIN + 1] -= ahead * node[i - 1, k, BEHIND + 1]
                for column in range(MISSING, 9):
                    node[i, p, column] -= ahead * node[i - 1, k, column]
        divide(node, i, BEHIND, MAIN)
        divide(node, i, MISSING, 9)
    for i in range(len(node) - 2, -1, -1):
        for p in range(2):
            for k in range(2):
                for column in range(MISSING, 9):
                    node[i, p, column] -= node[i, p, BEHIND + k] * node[i + 1, k, column]


@kernel
def _pull(plane: Plane, both: BothPlanes, pulley: Array) -> None:
    """Find the travel of the pulleys u: (K + k_a + k_b) u = force + k_a x_first + k_b x_last."""
    node, row, last, segment = both.of_node, both.of_pulley, 2 * plane.elements, both.segment
    for p in range(2):
        ahead, behind = segment[0, p, SLOPE], segment[last + 1, p, SLOPE]
        for q in range(2):
            row[p, q] = -ahead * node[0, p, BORDER + q] - behind * node[last, p, BORDER + q]
        row[p, p] += PULLEY_STIFFNESS + ahead + behind
        row[p, 2] = _pulley_force(plane, both, pulley, p)
        row[p, 2] += ahead * node[0, p, MISSING] + behind * node[last, p, MISSING]
    over = 1.0 / (row[0, 0] * row[1, 1] - row[0, 1] * row[1, 0])
    u = (row[1, 1] * row[0, 2] - row[0, 1] * row[1, 2]) * over
    w = (row[0, 0] * row[1, 2] - row[1, 0] * row[0, 2]) * over
    row[0, 2], row[1, 2] = u, w
    for i in range(last + 1):
        for p in range(2):
            node[i, p, MISSING] += node[i, p, BORDER] * u + node[i, p, BORDER + 1] * w


@kernel
def _move(plane: Plane, both: BothPlanes, pulley: Array, share: float, farthest: float) -> None:
    """Move pairs and pulleys by a share of the step; what is held goes back to where it was.

    No element goes further than `farthest`.
    """
    E, pair, node, row = plane.elements, both.pair, both.of_node, both.of_pair
    longest = 1e-12
    for k in range(2 * E):
        for p in range(2):
            row[k, p, MISSING] = node[k if k < E else k + 1, p, MISSING]
            longest = max(longest, abs(row[k, p, MISSING]))
    share = min(share, farthest / longest)
    for k in range(len(pair)):
        for p in range(2):
            if both.slides[k] == 0:
                pair[k, p, PLACE] = pair[k, p, BEFORE]
                continue
            travel = row[k, p, MISSING]
            if k >= 2 * E:
                for q in range(2):
                    tip = node[E, q, MISSING]
                    travel += row[k, p, AHEAD + q] * (node[E - 1, q, MISSING] - tip)
                    travel -= row[k, p, BEHIND + q] * (tip - node[E + 1, q, MISSING])
            pair[k, p, PLACE] += share * travel
    for p in range(2):
        pulley[p] += share * both.of_pulley[p, 2]


@kernel
def _sweep_both(plane: Plane, both: BothPlanes, pulley: Array) -> None:
    """Bring one pair after the other to its own equilibrium."""
    pair = both.pair
    for k in range(len(pair)):
        pair[k, 0, LED] = pair[k, 1, LED] = 0.0
        for _ in range(TRIALS):
            _load(plane, both.segment, pair, pulley, False, k, k + 1)
            farthest = 0.0
            slipped, slides = come_to_rest(
                (pair[k, 0, PULLED], pair[k, 1, PULLED]),
                (pair[k, 0, FRICTION], pair[k, 1, FRICTION]),
                (pair[k, 0, PLACE] - pair[k, 0, BEFORE], pair[k, 1, PLACE] - pair[k, 1, BEFORE]),
                (pair[k, 0, STIFFNESS], pair[k, 1, STIFFNESS]),
                plane.holds if k < 2 * plane.elements else 1.0,
            )
            both.slides[k] = 1 if slides else 0
            for p in range(2):
                moved = pair[k, p, BEFORE] + slipped[p]
                farthest = max(farthest, abs(moved - pair[k, p, PLACE]))
                pair[k, p, PLACE] = moved
            if farthest < 1e-12:
                break
    _load(plane, both.segment, pair, pulley, False, 0, 0)
    for p in range(2):
        yielding = PULLEY_STIFFNESS + both.segment[0, p, SLOPE] + both.segment[-1, p, SLOPE]
        pulley[p] += _pulley_force(plane, both, pulley, p) / yielding


@kernel
def come_to_rest(force: Two, friction: Two, slipped: Two, stiffness: Two, limit: float) -> tuple[Two, bool]:
    """Return the slip of neighbours that come to rest with their friction and stiffness, and if they slide.

    From the forces t_0 that there would be without slip, tau = t_0 / (F + k lambda / F) with |tau| = 1 and
    the slip lambda tau / F: one equation for lambda, convex and falling. Newton's steps come from below.
    They slide where the force exceeds `limit` times the friction.
    """
    F, k = friction, stiffness
    start = (force[0] + k[0] * slipped[0], force[1] + k[1] * slipped[1])
    tau, travel = (start[0] / F[0], start[1] / F[1]), 0.0
    if math.hypot(tau[0], tau[1]) <= limit:
        return (0.0, 0.0), False
    for _ in range(ROOT_STEPS):
        tau = (start[0] / (F[0] + travel * k[0] / F[0]), start[1] / (F[1] + travel * k[1] / F[1]))
        size = math.hypot(tau[0], tau[1])
        if abs(size - 1.0) < 1e-13:
            break
        slope = 0.0
        for p in range(2):
            slope -= tau[p] * tau[p] / size * k[p] / (F[p] * F[p] + travel * k[p])
        travel = max(travel - (size - 1.0) / slope, 0.0)
    return (travel * tau[0] / F[0], travel * tau[1] / F[1]), True
