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
from numpy.typing import NDArray

from twin.mechanics.drive import PULLEY_STIFFNESS
from twin.mechanics.friction import CAUGHT_UP
from twin.mechanics.kernels import kernel
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

Index = NDArray[np.int64]

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
NEAR = 3  # unknowns after its own that a row of an element holds: its neighbour, the next element of both
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


class Positions(NamedTuple):
    """Positions and slip of two planes, as in `ReducedState`."""

    element: Array  # (2, 2 E) [m]
    hinge: Array  # (2, G) [rad]
    pulley: Array  # (2,) [m]
    slip: Signs  # (2, 2 E) whether elements slide
    turn: Signs  # (2, G) whether groups of hinges do


class BothPlanes(NamedTuple):
    """Scratch arrays of two planes: N = 2 E + 1 nodes in each, U = 4 E + 2 G + 4 unknowns."""

    start: Positions  # at the start of the increment
    chain: Array  # (7, 2, N + 1) rows as in `one_plane.py`, of each plane
    hinge: Array  # (2, 2, G) angle at the start of the increment [rad], slope of the torque [N m / rad]
    pair: Array  # (11, 2) rows of neighbours
    column: Index  # (2, N + 2) unknown of each node, with the pulley before and after them
    matrix: Array  # (U, U) linear system: elements, hinges, tip, pulleys [N / m]; rows of hinges [N m]
    right: Array  # (U,) its right side, then its solution

    @classmethod
    def of(cls, elements: int, groups: int) -> Self:
        """Return scratch arrays."""
        nodes, unknowns = 2 * elements + 1, 4 * elements + 2 * groups + 4
        column = np.empty((2, nodes + 2), np.int64)
        for p in range(2):
            column[p, 0] = column[p, -1] = unknowns - 2 + p
            column[p, elements + 1] = unknowns - 4 + p
            for i in range(elements):  # of both wires from the pulley to the tip, neighbours side by side
                column[p, 1 + i] = 2 * i + p
                column[p, nodes - i] = 2 * (elements + i) + p
        element, hinge = np.zeros((2, 2 * elements)), np.zeros((2, groups))
        return cls(
            start=Positions(element, hinge, np.zeros(2), element.astype(np.int8), hinge.astype(np.int8)),
            chain=np.zeros((7, 2, nodes + 1)),
            hinge=np.zeros((2, 2, groups)),
            pair=np.zeros((11, 2)),
            column=column,
            matrix=np.zeros((unknowns, unknowns)),
            right=np.zeros(unknowns),
        )


@kernel
def _copy(to: Positions, values: Positions) -> None:
    copy_rows(to.element, values.element)
    copy_rows(to.hinge, values.hinge)
    copy_row(to.pulley, values.pulley)
    copy_rows(to.slip, values.slip)
    copy_rows(to.turn, values.turn)


@kernel
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


@kernel
def _part_of(plane: Plane, parts: int, target: tuple[float, float]) -> Plane:
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
            both.hinge[0, p, g] = hinge[p, g]
            bend += plane.size[g] * hinge[p, g]
        chain[BEFORE, p, E] = plane.arm * bend
        for i in range(2 * E + 1):
            chain[NODE, p, i] = chain[BEFORE, p, i]
        _fill_stretch(plane, chain, STRETCH_BEFORE, p, pulley[p])
    _load_both(plane, chain, pulley)
    for p in range(2):
        pulley[p] += _pulley_force(plane, chain, pulley, p) / PULLEY_STIFFNESS
    if plane.holds > 1.0:
        _hold_caught_up(plane, chain, slip)

    missing = math.inf
    for turns in range(ROUNDS):
        missing, settled = _settle(plane, both, now, farthest, turns == 0)
        if settled:
            break
        for _ in range(SWEEPS << min(turns, 3)):
            _sweep_both(plane, both, now)
    for p in range(2):
        for j in range(2 * E):
            element[p, j] = chain[NODE, p, j if j < E else j + 1]
    return missing


@kernel
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


@kernel
def _fill_stretch(plane: Plane, chain: Array, row: int, p: int, pulley: float) -> None:
    """Fill a row of a plane with the stretch of all segments [m]; below 0 where one is slack."""
    last = 2 * plane.elements + 1
    for i in range(last + 1):
        left = pulley if i == 0 else chain[NODE, p, i - 1]
        right = pulley if i == last else chain[NODE, p, i]
        chain[row, p, i] = plane.rest[i] + left - right


@kernel
def _load_both(plane: Plane, chain: Array, pulley: Array) -> None:
    """Fill in stretch, tension, force and slope of all segments."""
    for p in range(2):
        _fill_stretch(plane, chain, STRETCH, p, pulley[p])
        for i in range(2 * plane.elements + 2):
            loaded = load_of(plane.segment, chain[STRETCH, p, i], chain[STRETCH_BEFORE, p, i])
            chain[TENSION, p, i], chain[FORCE, p, i], chain[SLOPE, p, i] = loaded


@kernel
def _pulley_force(plane: Plane, chain: Array, pulley: Array, p: int) -> float:
    """Return the force that is missing at a pulley [N], between its spring and both wires."""
    first, last = chain[FORCE, p, 0], chain[FORCE, p, 2 * plane.elements + 1]
    missing: float = PULLEY_STIFFNESS * (plane.target[p] - pulley[p]) - first + last
    return missing


@kernel
def _load_elements(plane: Plane, chain: Array, pair: Array, i: int) -> None:
    """Fill in force, friction, slip and stiffness of the two elements at node i of the chains."""
    held = HELD * plane.segment.stiffness
    for p in range(2):
        pair[HELD_FORCE, p] = chain[FORCE, p, i] - chain[FORCE, p, i + 1]
        tension = chain[TENSION, p, i] + chain[TENSION, p, i + 1]
        pair[FRICTION, p] = plane.per_tension * tension + plane.floor
        pair[SLIPPED, p] = chain[NODE, p, i] - chain[BEFORE, p, i]
        pair[STIFFNESS, p] = max(chain[SLOPE, p, i] + chain[SLOPE, p, i + 1], held)


@kernel
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
        torque, slope = hinge_torque(law, plane.straight[p], hinge[p, g], both.hinge[0, p, g])
        both.hinge[1, p, g] = slope
        pair[HELD_FORCE, p] = arm * (chain[FORCE, p, E] - chain[FORCE, p, E + 1]) - torque
        rubbing = wrapped * (chain[TENSION, p, E] + chain[TENSION, p, E + 1])
        pair[FRICTION, p] = plane.joint_friction[g] + rubbing + LEAST_TORQUE
        pair[SLIPPED, p] = hinge[p, g] - both.hinge[0, p, g]
        pair[STIFFNESS, p] = slope + arm * arm * size * (chain[SLOPE, p, E] + chain[SLOPE, p, E + 1])
    return wrapped, passed + turned


@kernel
def rub(pair: Array, limit: float) -> bool:
    """Fill in what is missing and its derivatives, from forces, friction, slip and stiffness of neighbours.

    Return whether they slide: they do where the force exceeds `limit` times the friction.
    """
    t, F = (pair[HELD_FORCE, 0], pair[HELD_FORCE, 1]), (pair[FRICTION, 0], pair[FRICTION, 1])
    dx = (pair[SLIPPED, 0], pair[SLIPPED, 1])
    rho = (pair[STIFFNESS, 0] + pair[STIFFNESS, 1]) / (F[0] ** 2 + F[1] ** 2)
    v = (t[0] / F[0] + rho * F[0] * dx[0], t[1] / F[1] + rho * F[1] * dx[1])
    size = math.hypot(v[0], v[1])
    slide = size > limit
    for p in range(2):
        pair[MISSING, p] = t[p] - F[p] * v[p] / size if slide else -dx[p]
        for q in range(2):
            same = 1.0 if p == q else 0.0
            if not slide:
                pair[OF_FORCE + p, q], pair[OF_FRICTION + p, q], pair[OF_SLIP + p, q] = 0.0, 0.0, -same
                continue
            # of F_p v_p / |v| with respect to v_q
            turned = F[p] * (same - v[p] * v[q] / size**2) / size
            pair[OF_FORCE + p, q] = same - turned / F[q]
            pair[OF_FRICTION + p, q] = -same * v[p] / size - turned * (rho * dx[q] - t[q] / F[q] ** 2)
            pair[OF_SLIP + p, q] = -turned * rho * F[q]
    return slide


@kernel
def _settle(
    plane: Plane, both: BothPlanes, now: Positions, farthest: float, begins: bool
) -> tuple[float, bool]:
    """Take Newton's steps; return the largest force missing [N], and whether it is in equilibrium.

    An element goes no further than `farthest` in a step [m]; where it `begins`, what slid in the last
    increment is let go first.
    """
    E, right, pulley = plane.elements, both.right, now.pulley
    missing, before, share = math.inf, math.inf, 1.0
    for step in range(NEWTON_STEPS):
        for row in range(len(right)):
            for k in range(len(right)):
                both.matrix[row, k] = 0.0
        _load_both(plane, both.chain, pulley)
        first = begins and step == 0
        of_elements, moved = _assemble_elements(plane, both, now.slip, first)
        of_hinges, turned = _assemble_hinges(plane, both, now.hinge, now.turn, first)
        missing = max(of_elements, of_hinges, _assemble_ends(plane, both, pulley))
        if missing <= RESIDUAL_N and not moved and not turned:
            return missing, True
        if not missing < math.inf:
            break
        eliminate(both.matrix, right, 4 * E, 2 * len(plane.size))
        if step >= EAGER:
            share = max(share / 2, LEAST_SHARE) if missing > before else min(2 * share, 1.0)
        before = missing
        longest = 1e-12
        for k in range(4 * E):
            longest = max(longest, abs(right[k]))
        _move(plane, both, now, min(share, farthest / longest))
    return missing, False


@kernel
def _limit(slides: int, holds: float, begins: bool) -> float:
    """Return the factor on the friction to be overcome before neighbours slide."""
    if slides == 0:
        return holds
    return 0.0 if begins else 1.0


@kernel
def _assemble_elements(plane: Plane, both: BothPlanes, slip: Signs, begins: bool) -> tuple[float, bool]:
    """Fill the rows of the elements; return the largest force missing [N], and if one is yet to be moved."""
    E, c, pair, chain = plane.elements, plane.per_tension, both.pair, both.chain
    column, matrix, right = both.column, both.matrix, both.right
    missing, unsettled = 0.0, False
    for j in range(2 * E):
        i = j if j < E else j + 1
        _load_elements(plane, chain, pair, i)
        slides = rub(pair, _limit(slip[0, j], plane.holds, begins))
        for p in range(2):
            row = column[p, i + 1]
            right[row] = -pair[MISSING, p]
            for q in range(2):
                matrix[row, column[q, i + 1]] += pair[OF_SLIP + p, q]
            if not slides:
                unsettled = unsettled or slip[p, j] != 0 or pair[SLIPPED, p] != 0.0
                slip[p, j] = 0
                continue
            unsettled = unsettled or slip[p, j] == 0
            slip[p, j] = 1
            missing = larger(missing, abs(pair[MISSING, p]))
            for q in range(2):
                of_force, of_sum = pair[OF_FORCE + p, q], c * pair[OF_FRICTION + p, q]
                _add_segments(matrix, row, column, chain, q, i, of_force, of_sum)
            if min(chain[SLOPE, p, i], chain[SLOPE, p, i + 1]) == 0.0:
                # Slack on one side: neighbours that slide with it may be held by nothing.
                matrix[row, row] -= HELD * plane.segment.stiffness
    return missing, unsettled


@kernel
def _assemble_hinges(
    plane: Plane, both: BothPlanes, hinge: Array, turn: Signs, begins: bool
) -> tuple[float, bool]:
    """Fill the rows of the groups of hinges; return likewise."""
    E, arm, pair, chain = plane.elements, plane.arm, both.pair, both.chain
    column, matrix, right = both.column, both.matrix, both.right
    missing, unsettled, passed = 0.0, False, 0.0
    for g in range(hinge.shape[1]):
        wrapped, passed = _load_hinges(plane, both, hinge, g, passed)
        slides = rub(pair, _limit(turn[0, g], 1.0, begins))
        for p in range(2):
            row = 4 * E + 2 * g + p
            right[row] = -pair[MISSING, p]
            for q in range(2):
                of_angle = pair[OF_SLIP + p, q] - pair[OF_FORCE + p, q] * both.hinge[1, q, g]
                matrix[row, 4 * E + 2 * g + q] += of_angle
            if not slides:
                unsettled = unsettled or turn[p, g] != 0 or pair[SLIPPED, p] != 0.0
                turn[p, g] = 0
                continue
            unsettled = unsettled or turn[p, g] == 0
            turn[p, g] = 1
            missing = larger(missing, abs(pair[MISSING, p]) / arm)
            for q in range(2):
                of_force, of_sum = arm * pair[OF_FORCE + p, q], wrapped * pair[OF_FRICTION + p, q]
                _add_segments(matrix, row, column, chain, q, E, of_force, of_sum)
    return missing, unsettled


@kernel
def _assemble_ends(plane: Plane, both: BothPlanes, pulley: Array) -> float:
    """Fill the rows of the tip and of the pulleys; return the largest force missing [N]."""
    first, last, missing = 4 * plane.elements, 2 * plane.elements + 1, 0.0
    chain, column, matrix = both.chain, both.column, both.matrix
    for p in range(2):
        row = column[p, plane.elements + 1]  # the tip is where the hinges bring it, before and after
        both.right[row] = 0.0
        matrix[row, row] = -1.0
        for g in range(len(plane.size)):
            matrix[row, first + 2 * g + p] = plane.arm * plane.size[g]
        row = column[p, 0]
        force = _pulley_force(plane, chain, pulley, p)
        both.right[row] = -force
        matrix[row, row] -= PULLEY_STIFFNESS + chain[SLOPE, p, 0] + chain[SLOPE, p, last]
        matrix[row, column[p, 1]] += chain[SLOPE, p, 0]
        matrix[row, column[p, last]] += chain[SLOPE, p, last]
        missing = larger(missing, abs(force))
    return missing


@kernel
def _add_segments(
    matrix: Array, row: int, column: Index, chain: Array, p: int, node: int, of_force: float, of_sum: float
) -> None:
    """Add to a row how the difference and the sum of the tensions on both sides of a node change."""
    ahead, behind = chain[SLOPE, p, node], chain[SLOPE, p, node + 1]
    matrix[row, column[p, node]] += (of_force + of_sum) * ahead
    matrix[row, column[p, node + 1]] += (of_sum - of_force) * behind - (of_force + of_sum) * ahead
    matrix[row, column[p, node + 2]] += (of_force - of_sum) * behind


@kernel
def _move(plane: Plane, both: BothPlanes, now: Positions, share: float) -> None:
    """Move nodes, hinges and pulleys by a share of the step; what is held goes back to where it was."""
    E, G, chain = plane.elements, len(plane.size), both.chain
    travel, column, hinge, slip, turn = both.right, both.column, now.hinge, now.slip, now.turn
    for p in range(2):
        for j in range(2 * E):
            i = j if j < E else j + 1
            moved = chain[NODE, p, i] + share * travel[column[p, i + 1]]
            chain[NODE, p, i] = chain[BEFORE, p, i] if slip[p, j] == 0 else moved
        bend = 0.0
        for g in range(G):
            moved = hinge[p, g] + share * travel[4 * E + 2 * g + p]
            hinge[p, g] = both.hinge[0, p, g] if turn[p, g] == 0 else moved
            bend += plane.size[g] * hinge[p, g]
        chain[NODE, p, E] = plane.arm * bend
        now.pulley[p] += share * travel[column[p, 0]]


@kernel
def eliminate(matrix: Array, right: Array, elements: int, hinges: int) -> None:
    """Solve a linear system (N, N) in place, without pivots: its right side (N,) becomes the solution.

    Its unknowns are those of `elements`, of `hinges`, two side by side, and a border. Elements hold the next
    `NEAR` alone, hinges their neighbour and elements, and all of them the border: the work grows with their
    number, and not with its third power.
    """
    count, border = len(right), elements + hinges
    for k in range(count):
        near = _near(k, elements, hinges, count)
        far = max(near, border)
        for row in range(k + 1, count):
            if row >= near and (row < elements or (row < far and k >= elements)):
                continue
            if matrix[row, k] == 0.0:
                continue
            ratio = matrix[row, k] / matrix[k, k]
            for column in range(k + 1, near):
                matrix[row, column] -= ratio * matrix[k, column]
            for column in range(far, count):
                matrix[row, column] -= ratio * matrix[k, column]
            right[row] -= ratio * right[k]
    for k in range(count - 1, -1, -1):
        near = _near(k, elements, hinges, count)
        total = right[k]
        for column in range(k + 1, near):
            total -= matrix[k, column] * right[column]
        for column in range(max(near, border), count):
            total -= matrix[k, column] * right[column]
        right[k] = total / matrix[k, k]


@kernel
def _near(k: int, elements: int, hinges: int, count: int) -> int:
    """Return the end of the unknowns that row k holds before those of the border."""
    if k < elements:
        return min(k + 1 + NEAR, elements)
    if k < elements + hinges:
        return k + 2 - (k - elements) % 2
    return count


@kernel
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


@kernel
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


@kernel
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
                moved = both.hinge[0, p, g] + pair[SLIPPED, p]
                farthest = max(farthest, abs(moved - hinge[p, g]))
                hinge[p, g] = moved
                chain[NODE, p, E] = plane.arm * bend_of(plane.size, hinge[p])
            if farthest < 1e-11:
                break
        passed = then
        turn[0, g] = turn[1, g] = 1 if slides else 0


@kernel
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
