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

Newton's steps on all unknowns together (semismooth: what slides is found with them) and, where they do not
settle, sweeps over the pairs of neighbours (Gauss-Seidel) take turns until less than `RESIDUAL_N` is missing
from equilibrium.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from twin.mechanics.drive import PULLEY_STIFFNESS
from twin.mechanics.friction import CAUGHT_UP
from twin.mechanics.kernels import fused, inlined, kernel
from twin.reduced.one_plane import (
    BEFORE,
    FORCE,
    HELD,
    NODE,
    RESIDUAL_N,
    SLOPE,
    STRETCH,
    STRETCH_BEFORE,
    TENSION,
    Array,
    Hinge,
    Plane,
    Segment,
    Signs,
    bend_of,
    copy_row,
    copy_rows,
    hinge_torque,
    larger,
    load_of,
    turn_of,
)

PARTS = 5  # that an increment is divided into: the direction of friction turns within it
MOST_PARTS = 1024  # where no equilibrium is found
SWEEPS = 25  # in the first turn; each turn has twice as many as the one before, up to 8 times these
ROUNDS = 12  # times that Newton's steps and sweeps take turns, before the increment is given up
NEWTON_STEPS = 25
EAGER = 6  # whole steps; then one that led away is followed by a shorter one, as where wires turn slack
LEAST_SHARE = 1 / 16  # shortest of these steps, as a share of a whole one
FARTHEST = (
    2e-4  # travel of an element in a step, besides twice that of the pulleys [m]: slack hardly holds it
)
LEAD, LEAD_BELOW_N = 0.0, 1e-2
TRIALS = 12  # most steps of the search for the rest of one pair: its wires may turn slack or taut
ROOT_STEPS = 30  # most steps of the search for the travel of a pair that slides
LEAST_TORQUE = 1e-12  # smallest friction of a hinge [N m]: a force over its friction must be a number

HELD_FORCE, FRICTION, SLIPPED, STIFFNESS, MISSING = range(5)
"""Rows of two neighbours, one of each plane.

Net force on each that friction holds, its friction [N or N m], slip in the increment [m or rad], stiffness
that it feels [N / m or N m / rad], and missing force; of those that are held, the travel back to their place.
"""
OF_FORCE, OF_FRICTION, OF_SLIP = 5, 7, 9
"""First of two rows each: derivatives of the missing force of a neighbour by those of both."""
LOWER, MAIN, UPPER, BORDER, RIGHT = 0, 2, 4, 6, 8
LED, FIRST = 7, 8
HINGE_BEFORE, HINGE_SLOPE, HINGE_LED, HINGE_FIRST = range(4)


class Positions(NamedTuple):
    """Positions and slip of two planes, as in `ReducedState`."""

    element: Array  # (2, 2 E) [m]
    hinge: Array  # (2, G) [rad]
    pulley: Array  # (2,) [m]
    slip: Signs  # (2, 2 E) whether elements slide
    turn: Signs  # (2, G) whether groups of hinges do


class BothPlanes(NamedTuple):
    """Scratch arrays of two planes: N = 2 E + 1 nodes in each."""

    start: Positions  # at the start of the increment
    chain: Array  # (9, 2, N + 1) rows as in `one_plane.py`, then the two below, of each plane
    hinge: Array  # (4, 2, G) rows of groups of hinges
    pair: Array  # (11, 2) rows of neighbours
    system: Array  # (N, 2, 9) linear system of the nodes: columns below
    pulley: Array  # (2, 3) equations of the pulleys
    group: Array  # (G, 2, 5) travel of groups by that of the nodes before and after the tip, and by itself

    @classmethod
    def of(cls, elements: int, groups: int) -> Self:
        """Return scratch arrays."""
        nodes = 2 * elements + 1
        element, hinge = np.zeros((2, 2 * elements)), np.zeros((2, groups))
        return cls(
            start=Positions(element, hinge, np.zeros(2), element.astype(np.int8), hinge.astype(np.int8)),
            chain=np.zeros((9, 2, nodes + 1)),
            hinge=np.zeros((4, 2, groups)),
            pair=np.zeros((11, 2)),
            system=np.zeros((nodes, 2, 9)),
            pulley=np.zeros((2, 3)),
            group=np.zeros((groups, 2, 5)),
        )


@inlined
def _copy(to: Positions, values: Positions) -> None:
    copy_rows(to.element, values.element)
    copy_rows(to.hinge, values.hinge)
    copy_row(to.pulley, values.pulley)
    copy_rows(to.slip, values.slip)
    copy_rows(to.turn, values.turn)


@fused
def solve_both_planes(plane: Plane, both: BothPlanes, now: Positions, periods: int) -> float:
    """Bring two planes to equilibrium after an increment, in as many parts as that takes.

    Positions and slip are rewritten. A part has at least one of the control periods to begin with. Return
    the largest force that is missing [N].
    """
    start, target = both.start, plane.target
    _copy(start, now)
    missing, parts = math.inf, min(periods, PARTS)
    while not missing <= RESIDUAL_N and parts <= MOST_PARTS:
        _copy(now, start)
        missing = 0.0
        for part in range(1, parts + 1):
            share = part / parts
            there = (
                start.pulley[0] + (target[0] - start.pulley[0]) * share,
                start.pulley[1] + (target[1] - start.pulley[1]) * share,
            )
            missing = max(missing, _solve_part(_part_of(plane, parts, there), both, now))
            if not missing <= RESIDUAL_N:
                break
        parts *= 4
    return missing


@inlined
def _part_of(plane: Plane, parts: int, target: tuple[float, float]) -> Plane:
    """Return the parameters for one of equal parts of an increment, in which damping counts as much more."""
    segment, hinge = plane.segment, plane.hinge
    return Plane(
        plane.elements,
        plane.rest,
        Segment(segment.stiffness, segment.quadratic, segment.damping * parts),
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
def _solve_part(plane: Plane, both: BothPlanes, now: Positions) -> float:
    """Bring two planes to equilibrium after a part of an increment; return the largest force missing [N]."""
    E, chain, target, slip = plane.elements, both.chain, plane.target, now.slip
    element, hinge, pulley = now.element, now.hinge, now.pulley
    farthest = FARTHEST + 2 * max(abs(target[0] - pulley[0]), abs(target[1] - pulley[1]))
    for p in range(2):
        for j in range(2 * E):
            chain[BEFORE, p, j if j < E else j + 1] = element[p, j]
        bend = 0.0
        for g in range(hinge.shape[1]):
            both.hinge[HINGE_BEFORE, p, g] = hinge[p, g]
            both.hinge[HINGE_LED, p, g] = 0.0
            bend += plane.size[g] * hinge[p, g]
        chain[BEFORE, p, E] = plane.arm * bend
        for i in range(2 * E + 1):
            chain[NODE, p, i] = chain[BEFORE, p, i]
            chain[LED, p, i] = 0.0
        _fill_stretch(plane, chain, STRETCH_BEFORE, p, pulley[p])
    _load_both(plane, chain, pulley)
    _remember(plane, both, now)
    driven = False
    for p in range(2):
        force = _pulley_force(plane, chain, pulley, p)
        driven = driven or abs(force) > RESIDUAL_N
        pulley[p] += force / PULLEY_STIFFNESS
    if plane.holds > 1.0:
        _hold_caught_up(plane, chain, slip)

    missing = math.inf
    for turns in range(ROUNDS):
        missing, settled = _settle(plane, both, now, farthest, turns == 0 and driven)
        if settled:
            break
        for p in range(2):
            for i in range(2 * E + 1):
                chain[LED, p, i] = 0.0
            for g in range(hinge.shape[1]):
                both.hinge[HINGE_LED, p, g] = 0.0
        for _ in range(SWEEPS << min(turns, 3)):
            _sweep_both(plane, both, now)
    for p in range(2):
        for j in range(2 * E):
            element[p, j] = chain[NODE, p, j if j < E else j + 1]
    return missing


@inlined
def _remember(plane: Plane, both: BothPlanes, now: Positions) -> None:
    E, chain, pair, passed = plane.elements, both.chain, both.pair, 0.0
    for j in range(2 * E):
        i = j if j < E else j + 1
        _load_elements(plane, chain, pair, i)
        v, w = pair[HELD_FORCE, 0] / pair[FRICTION, 0], pair[HELD_FORCE, 1] / pair[FRICTION, 1]
        size = math.sqrt(v * v + w * w)
        over = 0.0 if size < 0.99 else 1 / size
        chain[FIRST, 0, i], chain[FIRST, 1, i] = v * over, w * over
    for g in range(now.hinge.shape[1]):
        _, passed = _load_hinges(plane, both, now.hinge, g, passed)
        v, w = pair[HELD_FORCE, 0] / pair[FRICTION, 0], pair[HELD_FORCE, 1] / pair[FRICTION, 1]
        size = math.sqrt(v * v + w * w)
        over = 0.0 if size < 0.99 else 1 / size
        both.hinge[HINGE_FIRST, 0, g], both.hinge[HINGE_FIRST, 1, g] = v * over, w * over


@inlined
def _hold_caught_up(plane: Plane, chain: Array, slip: Signs) -> None:
    """Hold the neighbours that have caught up with what pulls them, by the tensions before an increment."""
    most = 1.0 + CAUGHT_UP * (plane.holds - 1.0)
    for j in range(slip.shape[1]):
        i = j if j < plane.elements else j + 1
        pulled = 0.0
        for p in range(2):
            ahead, behind = chain[TENSION, p, i], chain[TENSION, p, i + 1]
            friction = plane.per_tension * (ahead + behind) + plane.floor
            pulled = math.hypot(pulled, (ahead - behind) / friction)
        if pulled <= most:
            slip[0, j] = slip[1, j] = 0


@inlined
def _fill_stretch(plane: Plane, chain: Array, row: int, p: int, pulley: float) -> None:
    """Fill a row of a plane with the stretch of all segments [m]; below 0 where one is slack."""
    last = 2 * plane.elements + 1
    for i in range(last + 1):
        left = pulley if i == 0 else chain[NODE, p, i - 1]
        right = pulley if i == last else chain[NODE, p, i]
        chain[row, p, i] = plane.rest[i] + left - right


@inlined
def _load_both(plane: Plane, chain: Array, pulley: Array) -> None:
    """Fill in stretch, tension, force and slope of all segments."""
    for p in range(2):
        _fill_stretch(plane, chain, STRETCH, p, pulley[p])
        for i in range(2 * plane.elements + 2):
            loaded = load_of(plane.segment, chain[STRETCH, p, i], chain[STRETCH_BEFORE, p, i])
            chain[TENSION, p, i], chain[FORCE, p, i], chain[SLOPE, p, i] = loaded


@inlined
def _pulley_force(plane: Plane, chain: Array, pulley: Array, p: int) -> float:
    """Return the force that is missing at a pulley [N], between its spring and both wires."""
    first, last = chain[FORCE, p, 0], chain[FORCE, p, 2 * plane.elements + 1]
    missing: float = PULLEY_STIFFNESS * (plane.target[p] - pulley[p]) - first + last
    return missing


@inlined
def _load_elements(plane: Plane, chain: Array, pair: Array, i: int) -> None:
    """Fill in force, friction, slip and stiffness of the two elements at node i of the chains."""
    held = HELD * plane.segment.stiffness
    for p in range(2):
        pair[HELD_FORCE, p] = chain[FORCE, p, i] - chain[FORCE, p, i + 1]
        tension = chain[TENSION, p, i] + chain[TENSION, p, i + 1]
        pair[FRICTION, p] = plane.per_tension * tension + plane.floor
        pair[SLIPPED, p] = chain[NODE, p, i] - chain[BEFORE, p, i] - chain[LED, p, i]
        pair[STIFFNESS, p] = max(chain[SLOPE, p, i] + chain[SLOPE, p, i + 1], held)


@inlined
def _load_hinges(plane: Plane, both: BothPlanes, hinge: Array, g: int, passed: float) -> tuple[float, float]:
    """Fill in the same of the two hinges of group g.

    `passed` is the angle by which the groups before it turn the wires [rad]. Return the friction of the group
    per tension of the wires, a moment arm [m], and `passed` for the next one.
    """
    E, arm, pair, law, size = plane.elements, plane.arm, both.pair, plane.hinge, plane.size[g]
    chain = both.chain
    turned = turn_of(size, hinge[0, g], hinge[1, g] ** 2)
    wrapped = arm * plane.routing * (passed + turned / 2.0)
    for p in range(2):
        torque, slope = hinge_torque(law, plane.straight[p], hinge[p, g], both.hinge[HINGE_BEFORE, p, g])
        both.hinge[HINGE_SLOPE, p, g] = slope
        pair[HELD_FORCE, p] = arm * (chain[FORCE, p, E] - chain[FORCE, p, E + 1]) - torque
        rubbing = wrapped * (chain[TENSION, p, E] + chain[TENSION, p, E + 1])
        pair[FRICTION, p] = plane.joint_friction[g] + rubbing + LEAST_TORQUE
        pair[SLIPPED, p] = hinge[p, g] - both.hinge[HINGE_BEFORE, p, g] - both.hinge[HINGE_LED, p, g]
        pair[STIFFNESS, p] = slope + arm * arm * size * (chain[SLOPE, p, E] + chain[SLOPE, p, E + 1])
    return wrapped, passed + turned


@inlined
def rub(pair: Array, limit: float) -> bool:
    """Fill in what is missing and its derivatives, from forces, friction, slip and stiffness of neighbours.

    Return whether they slide: they do where the force exceeds `limit` times the friction.
    """
    F, G = pair[FRICTION, 0], pair[FRICTION, 1]
    rho = (pair[STIFFNESS, 0] + pair[STIFFNESS, 1]) / (F * F + G * G)
    v = pair[HELD_FORCE, 0] / F + rho * F * pair[SLIPPED, 0]
    w = pair[HELD_FORCE, 1] / G + rho * G * pair[SLIPPED, 1]
    size = math.sqrt(v * v + w * w)
    if not size > limit:
        return False
    along, across = (v / size, w / size), (-w / size, v / size)
    for p in range(2):
        pair[MISSING, p] = pair[HELD_FORCE, p] - pair[FRICTION, p] * along[p]
        # of F_p v_p / |v| with respect to v_q: what turns it, across itself
        turned = pair[FRICTION, p] * across[p] / size
        for q in range(2):
            same, of_q, F = 1.0 if p == q else 0.0, turned * across[q], pair[FRICTION, q]
            pair[OF_FORCE + p, q] = same - of_q / F
            change = rho * pair[SLIPPED, q] - pair[HELD_FORCE, q] / (F * F)
            pair[OF_FRICTION + p, q] = -same * along[p] - of_q * change
            pair[OF_SLIP + p, q] = -of_q * rho * F
    return True


@fused
def _settle(
    plane: Plane, both: BothPlanes, now: Positions, farthest: float, begins: bool
) -> tuple[float, bool]:
    """Take Newton's steps; return the largest force missing [N], and whether it is in equilibrium.

    An element goes no further than `farthest` in a step [m]; where it `begins`, what slid in the last
    increment is let go first.
    """
    E, system, pulley = plane.elements, both.system, now.pulley
    missing, before, share = math.inf, math.inf, 1.0
    lead = LEAD if begins else 0.0
    for step in range(NEWTON_STEPS):
        _load_both(plane, both.chain, pulley)
        first = begins and step == 0
        of_elements, moved = _assemble_elements(plane, both, now.slip, first)
        of_hinges, turned = _assemble_hinges(plane, both, now.hinge, now.turn, first)
        missing = max(of_elements, of_hinges)
        for p in range(2):
            missing = larger(missing, abs(_pulley_force(plane, both.chain, pulley, p)))
        if lead > 0.0 and missing <= LEAD_BELOW_N and not moved and not turned:
            _lead(plane, both, now, lead)
            lead = 0.0
            continue
        if missing <= RESIDUAL_N and not moved and not turned:
            return missing, True
        if not missing < math.inf:
            break
        eliminate(system)
        _pull(plane, both, pulley)
        if step >= EAGER:
            share = max(share / 2, LEAST_SHARE) if missing > before else min(2 * share, 1.0)
        before = missing
        longest = 1e-12
        for i in range(2 * E + 1):
            if i != E:
                longest = max(longest, abs(system[i, 0, RIGHT]), abs(system[i, 1, RIGHT]))
        _move(plane, both, now, min(share, farthest / longest))
    return missing, False


@inlined
def _limit(pair: Array, slides: int, holds: float, begins: bool, residual: float) -> float:
    """Return the factor on the friction to be overcome before neighbours slide."""
    if slides == 0:
        return holds + residual / (pair[FRICTION, 0] + pair[FRICTION, 1])
    return 0.0 if begins else 1.0


@fused
def _assemble_elements(plane: Plane, both: BothPlanes, slip: Signs, begins: bool) -> tuple[float, bool]:
    """Fill the rows of the elements; return the largest force missing [N], and if one is yet to be moved."""
    E, c, pair, chain = plane.elements, plane.per_tension, both.pair, both.chain
    missing, unsettled = 0.0, False
    for j in range(2 * E):
        i = j if j < E else j + 1
        row = both.system[i]
        row[:] = 0.0
        _load_elements(plane, chain, pair, i)
        slides = 1 if rub(pair, _limit(pair, slip[0, j], plane.holds, begins, RESIDUAL_N)) else 0
        unsettled = unsettled or slip[0, j] != slides
        slip[0, j] = slip[1, j] = slides
        if slides == 0:  # it goes back to where it was
            for p in range(2):
                chain[LED, p, i] = 0.0
                row[p, MAIN + p] = 1.0
                row[p, RIGHT] = chain[BEFORE, p, i] - chain[NODE, p, i]
                unsettled = unsettled or row[p, RIGHT] != 0.0
            continue
        for p in range(2):
            missing = larger(missing, abs(pair[MISSING, p]))
            for q in range(2):
                of_force, of_sum = pair[OF_FORCE + p, q], c * pair[OF_FRICTION + p, q]
                ahead = (of_force + of_sum) * chain[SLOPE, q, i]
                behind = (of_force - of_sum) * chain[SLOPE, q, i + 1]
                row[p, (BORDER if i == 0 else LOWER) + q] = ahead
                row[p, MAIN + q] = pair[OF_SLIP + p, q] - ahead - behind
                row[p, (BORDER if i == 2 * E else UPPER) + q] = behind
            if min(chain[SLOPE, p, i], chain[SLOPE, p, i + 1]) == 0.0:
                # Slack on one side: neighbours that slide with it may be held by nothing.
                row[p, MAIN + p] -= HELD * plane.segment.stiffness
            row[p, RIGHT] = -pair[MISSING, p]
    return missing, unsettled


@fused
def _assemble_hinges(
    plane: Plane, both: BothPlanes, hinge: Array, turn: Signs, begins: bool
) -> tuple[float, bool]:
    """Fold the groups of hinges, which follow the moment of the tip, into its row; return likewise."""
    E, arm, pair, chain, angle = plane.elements, plane.arm, both.pair, both.chain, both.hinge
    tip, missing, unsettled, passed = both.system[E], 0.0, False, 0.0
    tip[:] = 0.0
    tip[0, MAIN] = tip[1, MAIN + 1] = 1.0
    for g in range(hinge.shape[1]):
        wrapped, passed = _load_hinges(plane, both, hinge, g, passed)
        slides = 1 if rub(pair, _limit(pair, turn[0, g], 1.0, begins, arm * RESIDUAL_N)) else 0
        unsettled = unsettled or turn[0, g] != slides
        turn[0, g] = turn[1, g] = slides
        group = both.group[g]
        group[:] = 0.0
        if slides == 0:
            for p in range(2):
                angle[HINGE_LED, p, g] = 0.0
                group[p, 4] = angle[HINGE_BEFORE, p, g] - hinge[p, g]
                unsettled = unsettled or group[p, 4] != 0.0
        else:
            for p in range(2):
                missing = larger(missing, abs(pair[MISSING, p]) / arm)
                for q in range(2):
                    of_force, of_sum = arm * pair[OF_FORCE + p, q], wrapped * pair[OF_FRICTION + p, q]
                    group[p, q] = (of_force + of_sum) * chain[SLOPE, q, E]
                    group[p, 2 + q] = (of_force - of_sum) * chain[SLOPE, q, E + 1]
                    both.pulley[p, q] = pair[OF_FORCE + p, q] * angle[HINGE_SLOPE, q, g] - pair[OF_SLIP + p, q]
                group[p, 4] = pair[MISSING, p]
            divide(group, both.pulley, 0, 0, 5)
        weight = arm * plane.size[g]
        for p in range(2):
            for q in range(2):
                tip[p, LOWER + q] -= weight * group[p, q]
                tip[p, MAIN + q] += weight * (group[p, q] + group[p, 2 + q])
                tip[p, UPPER + q] -= weight * group[p, 2 + q]
            tip[p, RIGHT] += weight * group[p, 4]
    return missing, unsettled


@inlined
def _lead(plane: Plane, both: BothPlanes, now: Positions, lead: float) -> None:
    """Let the friction of what slid before oppose the slip as it turns."""
    E, chain, angle, pair, passed = plane.elements, both.chain, both.hinge, both.pair, 0.0
    for j in range(2 * E):
        i = j if j < E else j + 1
        _load_elements(plane, chain, pair, i)
        F, G = pair[FRICTION, 0], pair[FRICTION, 1]
        travel = lead * math.sqrt((F * pair[SLIPPED, 0]) ** 2 + (G * pair[SLIPPED, 1]) ** 2)
        chain[LED, 0, i] = travel * chain[FIRST, 0, i] / F
        chain[LED, 1, i] = travel * chain[FIRST, 1, i] / G
    for g in range(now.hinge.shape[1]):
        _, passed = _load_hinges(plane, both, now.hinge, g, passed)
        F, G = pair[FRICTION, 0], pair[FRICTION, 1]
        travel = lead * math.sqrt((F * pair[SLIPPED, 0]) ** 2 + (G * pair[SLIPPED, 1]) ** 2)
        angle[HINGE_LED, 0, g] = travel * angle[HINGE_FIRST, 0, g] / F
        angle[HINGE_LED, 1, g] = travel * angle[HINGE_FIRST, 1, g] / G


@inlined
def divide(row: Array, by: Array, of: int, first: int, end: int) -> None:
    """Divide columns of a row (2, ...) in place by two columns of another, from the left."""
    a, b, c, d = by[0, of], by[0, of + 1], by[1, of], by[1, of + 1]
    over = 1.0 / (a * d - b * c)
    for k in range(first, end):
        above, below = row[0, k], row[1, k]
        row[0, k] = (d * above - b * below) * over
        row[1, k] = (a * below - c * above) * over


@kernel
def eliminate(system: Array) -> None:
    """Solve block-tridiagonal equations (N, 2, 9) in place, without pivots.

    Nodes become the right side less the border times the unknowns of the border.
    """
    last = len(system) - 1
    for i in range(last + 1):
        row = system[i]
        if i > 0:
            for p in range(2):
                for k in range(2):
                    low = row[p, LOWER + k]
                    row[p, MAIN] -= low * system[i - 1, k, UPPER]
                    row[p, MAIN + 1] -= low * system[i - 1, k, UPPER + 1]
                    for column in range(BORDER, RIGHT + 1):
                        row[p, column] -= low * system[i - 1, k, column]
        divide(row, row, MAIN, UPPER, RIGHT + 1)
    for i in range(last - 1, -1, -1):
        for p in range(2):
            for k in range(2):
                for column in range(BORDER, RIGHT + 1):
                    system[i, p, column] -= system[i, p, UPPER + k] * system[i + 1, k, column]


@inlined
def _pull(plane: Plane, both: BothPlanes, pulley: Array) -> None:
    """Move the pulleys, and with them the solution for the nodes.

    Pulleys u: (K + k_a + k_b) u = force + k_a x_first + k_b x_last.
    """
    system, chain, last = both.system, both.chain, 2 * plane.elements
    row = both.pulley
    for p in range(2):
        ahead, behind = chain[SLOPE, p, 0], chain[SLOPE, p, last + 1]
        for k in range(2):
            row[p, k] = ahead * system[0, p, BORDER + k] + behind * system[last, p, BORDER + k]
        row[p, p] += PULLEY_STIFFNESS + ahead + behind
        row[p, 2] = _pulley_force(plane, chain, pulley, p)
        row[p, 2] += ahead * system[0, p, RIGHT] + behind * system[last, p, RIGHT]
    divide(row, row, 0, 2, 3)
    for i in range(last + 1):
        for p in range(2):
            for k in range(2):
                system[i, p, RIGHT] -= system[i, p, BORDER + k] * row[k, 2]


@inlined
def _move(plane: Plane, both: BothPlanes, now: Positions, share: float) -> None:
    """Move nodes, hinges and pulleys by a share of the step; what is held goes back to where it was."""
    E, chain, system = plane.elements, both.chain, both.system
    hinge, slip, turn = now.hinge, now.slip, now.turn
    for p in range(2):
        for j in range(2 * E):
            i = j if j < E else j + 1
            moved = chain[NODE, p, i] + share * system[i, p, RIGHT]
            chain[NODE, p, i] = chain[BEFORE, p, i] if slip[p, j] == 0 else moved
        bend = 0.0
        for g in range(len(plane.size)):
            group = both.group[g]
            travel = group[p, 4]
            for q in range(2):
                ahead = system[E - 1, q, RIGHT] - system[E, q, RIGHT]
                behind = system[E, q, RIGHT] - system[E + 1, q, RIGHT]
                travel += group[p, q] * ahead - group[p, 2 + q] * behind
            moved = hinge[p, g] + share * travel
            hinge[p, g] = both.hinge[HINGE_BEFORE, p, g] if turn[p, g] == 0 else moved
            bend += plane.size[g] * hinge[p, g]
        chain[NODE, p, E] = plane.arm * bend
        now.pulley[p] += share * both.pulley[p, 2]


@fused
def _sweep_both(plane: Plane, both: BothPlanes, now: Positions) -> None:
    """Bring one pair after the other to its own equilibrium."""
    E, chain, pair, pulley, slip = plane.elements, both.chain, both.pair, now.pulley, now.slip
    for i in range(2 * E + 1):
        if i == E:
            _sweep_hinges(plane, both, now)
            continue
        slides = False
        for _ in range(TRIALS):
            _load_sides(plane, chain, pulley, i)
            _load_elements(plane, chain, pair, i)
            slides, farthest = come_to_rest(pair, plane.holds), 0.0
            for p in range(2):
                moved = chain[BEFORE, p, i] + pair[SLIPPED, p]
                farthest = max(farthest, abs(moved - chain[NODE, p, i]))
                chain[NODE, p, i] = moved
            if farthest < 1e-12:
                break
        j = i if i < E else i - 1
        slip[0, j] = slip[1, j] = 1 if slides else 0
    _load_both(plane, chain, pulley)
    for p in range(2):
        yielding = PULLEY_STIFFNESS + chain[SLOPE, p, 0] + chain[SLOPE, p, 2 * E + 1]
        pulley[p] += _pulley_force(plane, chain, pulley, p) / yielding


@inlined
def _load_sides(plane: Plane, chain: Array, pulley: Array, i: int) -> None:
    """Fill in tension, force and slope of the segments on both sides of node i."""
    last = 2 * plane.elements + 1
    for p in range(2):
        for k in range(i, i + 2):
            left = pulley[p] if k == 0 else chain[NODE, p, k - 1]
            right = pulley[p] if k == last else chain[NODE, p, k]
            stretch = plane.rest[k] + left - right
            loaded = load_of(plane.segment, stretch, chain[STRETCH_BEFORE, p, k])
            chain[TENSION, p, k], chain[FORCE, p, k], chain[SLOPE, p, k] = loaded


@fused
def _sweep_hinges(plane: Plane, both: BothPlanes, now: Positions) -> None:
    """Bring one group of hinges after the other to its own equilibrium, and the tip with them."""
    E, passed, chain, pair = plane.elements, 0.0, both.chain, both.pair
    hinge, pulley, turn = now.hinge, now.pulley, now.turn
    for g in range(hinge.shape[1]):
        slides, then = False, passed
        for _ in range(TRIALS):
            _load_sides(plane, chain, pulley, E)
            _, then = _load_hinges(plane, both, hinge, g, passed)
            slides, farthest = come_to_rest(pair, 1.0), 0.0
            for p in range(2):
                moved = both.hinge[HINGE_BEFORE, p, g] + pair[SLIPPED, p]
                farthest = max(farthest, abs(moved - hinge[p, g]))
                hinge[p, g] = moved
                chain[NODE, p, E] = plane.arm * bend_of(plane.size, hinge[p])
            if farthest < 1e-11:
                break
        passed = then
        turn[0, g] = turn[1, g] = 1 if slides else 0


@inlined
def come_to_rest(pair: Array, limit: float) -> bool:
    """Fill in the slip of neighbours that come to rest with their friction and stiffness.

    From the forces t_0 that there would be without slip, tau = t_0 / (F + k lambda / F) with |tau| = 1 and
    the slip lambda tau / F: one equation for lambda, convex and falling. Newton's steps come from below.
    Return whether they slide: they do where the force exceeds `limit` times the friction.
    """
    F, k = (pair[FRICTION, 0], pair[FRICTION, 1]), (pair[STIFFNESS, 0], pair[STIFFNESS, 1])
    start = (pair[HELD_FORCE, 0] + k[0] * pair[SLIPPED, 0], pair[HELD_FORCE, 1] + k[1] * pair[SLIPPED, 1])
    tau, travel = (start[0] / F[0], start[1] / F[1]), 0.0
    if math.hypot(tau[0], tau[1]) <= limit:
        pair[SLIPPED, 0] = pair[SLIPPED, 1] = 0.0
        return False
    for _ in range(ROOT_STEPS):
        tau = (start[0] / (F[0] + travel * k[0] / F[0]), start[1] / (F[1] + travel * k[1] / F[1]))
        size = math.hypot(tau[0], tau[1])
        if abs(size - 1.0) < 1e-13:
            break
        slope = 0.0
        for p in range(2):
            slope -= tau[p] ** 2 / size * k[p] / (F[p] ** 2 + travel * k[p])
        travel = max(travel - (size - 1.0) / slope, 0.0)
    for p in range(2):
        pair[SLIPPED, p] = travel * tau[p] / F[p]
    return True
