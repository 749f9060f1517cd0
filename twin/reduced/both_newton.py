"""Newton's steps to the equilibrium of two bending planes: linear system, its solution, motion.

The rows are those of `shared_friction.py` for the elements of the sheath and the hinges, and those of the tip
and of the pulleys. What slides is found with them (semismooth Newton method).
"""

import math

from twin.mechanics.compiled import compiled, inlined
from twin.reduced.both_chain import (
    BothPlanes,
    Index,
    both_pulley_force,
    load_both,
    load_elements,
    load_hinges,
)
from twin.reduced.chain import HELD, RESIDUAL_N, Array, Plane, Signs, bend_of, larger
from twin.reduced.elimination import eliminate
from twin.reduced.shared_friction import rub

NEWTON_STEPS = 25
EAGER = 6
"""Whole steps; then one that led away is followed by a shorter one, as where wires turn slack and taut."""
FARTHEST = 2e-4
"""Longest way of an element in a step, beside twice that of the pulleys [m]: slack hardly holds it."""
LEAST_SHARE = 1 / 16
"""Shortest of these steps, as a share of a whole one."""


@compiled
def settle_both(
    plane: Plane,
    rest: tuple[float, float],
    target: tuple[float, float],
    both: BothPlanes,
    hinge: Array,
    pulley: Array,
    slip: Signs,
    turn: Signs,
    farthest: float,
    begins: bool,
) -> tuple[float, bool]:
    """Step towards equilibrium; return the largest force missing [N], and whether it is in equilibrium.

    The arguments are those of `solve_both_planes`, and how far an element may go in a step [m], and whether
    what slid in the last increment is let go first.
    """
    E = plane.elements
    missing, before, share = math.inf, math.inf, 1.0
    for step in range(NEWTON_STEPS):
        both.matrix[:] = 0.0
        load_both(plane, both, pulley)
        first = begins and step == 0
        of_elements, moved = _assemble_elements(plane, both, slip, first)
        of_hinges, turned = _assemble_hinges(plane, rest, both, hinge, turn, first)
        missing = max(of_elements, of_hinges, _assemble_ends(plane, target, both, pulley))
        if missing <= RESIDUAL_N and not moved and not turned:
            return missing, True
        if not missing < math.inf:
            break
        eliminate(both.matrix, both.right, 4 * E, 2 * len(plane.size))
        if step >= EAGER:
            share = max(share / 2, LEAST_SHARE) if missing > before else min(2 * share, 1.0)
        before = missing
        longest = 1e-12
        for k in range(4 * E):
            longest = max(longest, abs(both.right[k]))
        _move(plane, both, min(share, farthest / longest), hinge, pulley, slip, turn)
    return missing, False


@inlined
def _limit(slides: int, holds: float, begins: bool) -> float:
    """Return the factor on the friction to be overcome before neighbours slide.

    What slid in the last step goes on at its own friction; what slid in the last increment is let go first.
    """
    if slides == 0:
        return holds
    return 0.0 if begins else 1.0


@compiled
def _assemble_elements(plane: Plane, both: BothPlanes, slip: Signs, begins: bool) -> tuple[float, bool]:
    """Fill the rows of the elements; return the largest force missing [N], and if one is yet to be moved."""
    E, c, pair, slope = plane.elements, plane.per_tension, both.pair, both.slope
    column, matrix, right = both.column, both.matrix, both.right
    missing, unsettled = 0.0, False
    for j in range(2 * E):
        i = j if j < E else j + 1
        load_elements(plane, both, i)
        slides = rub(pair, _limit(slip[0, j], plane.holds, begins))
        for p in range(2):
            row = column[p, i + 1]
            right[row] = -pair.missing[p]
            for q in range(2):
                matrix[row, column[q, i + 1]] += pair.of_slip[p, q]
            if not slides:
                unsettled = unsettled or slip[p, j] != 0 or pair.slipped[p] != 0.0
                slip[p, j] = 0
                continue
            unsettled = unsettled or slip[p, j] == 0
            slip[p, j] = 1
            missing = larger(missing, abs(pair.missing[p]))
            for q in range(2):
                of_force, of_sum = pair.of_force[p, q], c * pair.of_friction[p, q]
                _add_segments(matrix, row, column, slope, q, i, of_force, of_sum)
            if min(slope[p, i], slope[p, i + 1]) == 0.0:
                # Slack on one side: neighbours that slide with it may be held by nothing.
                matrix[row, row] -= HELD * plane.segment.stiffness
    return missing, unsettled


@compiled
def _assemble_hinges(
    plane: Plane, rest: tuple[float, float], both: BothPlanes, hinge: Array, turn: Signs, begins: bool
) -> tuple[float, bool]:
    """Fill the rows of the groups of hinges; return likewise."""
    E, arm, pair, slope = plane.elements, plane.arm, both.pair, both.slope
    column, matrix, right = both.column, both.matrix, both.right
    missing, unsettled, passed = 0.0, False, 0.0
    for g in range(hinge.shape[1]):
        wrapped, passed = load_hinges(plane, rest, both, hinge, g, passed)
        slides = rub(pair, _limit(turn[0, g], 1.0, begins))
        for p in range(2):
            row = 4 * E + 2 * g + p
            right[row] = -pair.missing[p]
            for q in range(2):
                of_angle = pair.of_slip[p, q] - pair.of_force[p, q] * both.hinge_slope[q]
                matrix[row, 4 * E + 2 * g + q] += of_angle
            if not slides:
                unsettled = unsettled or turn[p, g] != 0 or pair.slipped[p] != 0.0
                turn[p, g] = 0
                continue
            unsettled = unsettled or turn[p, g] == 0
            turn[p, g] = 1
            missing = larger(missing, abs(pair.missing[p]) / arm)
            for q in range(2):
                of_force, of_sum = arm * pair.of_force[p, q], wrapped * pair.of_friction[p, q]
                _add_segments(matrix, row, column, slope, q, E, of_force, of_sum)
    return missing, unsettled


@compiled
def _assemble_ends(plane: Plane, target: tuple[float, float], both: BothPlanes, pulley: Array) -> float:
    """Fill the rows of the tip and of the pulleys; return the largest force missing [N]."""
    first, missing = 4 * plane.elements, 0.0
    slope, column, matrix = both.slope, both.column, both.matrix
    for p in range(2):
        row = column[p, plane.elements + 1]  # the tip is where the hinges bring it, before and after
        both.right[row] = 0.0
        matrix[row, row] = -1.0
        for g in range(len(plane.size)):
            matrix[row, first + 2 * g + p] = plane.arm * plane.size[g]
        row = column[p, 0]
        force = both_pulley_force(plane, target[p], both, pulley, p)
        both.right[row] = -force
        matrix[row, row] -= plane.pulley_stiffness + slope[p, 0] + slope[p, -1]
        matrix[row, column[p, 1]] += slope[p, 0]
        matrix[row, column[p, -2]] += slope[p, -1]
        missing = larger(missing, abs(force))
    return missing


@inlined
def _add_segments(
    matrix: Array, row: int, column: Index, slope: Array, p: int, node: int, of_force: float, of_sum: float
) -> None:
    """Add to a row how the difference and the sum of the tensions on both sides of a node change."""
    ahead, behind = slope[p, node], slope[p, node + 1]
    matrix[row, column[p, node]] += (of_force + of_sum) * ahead
    matrix[row, column[p, node + 1]] += (of_sum - of_force) * behind - (of_force + of_sum) * ahead
    matrix[row, column[p, node + 2]] += (of_force - of_sum) * behind


@compiled
def _move(
    plane: Plane, both: BothPlanes, share: float, hinge: Array, pulley: Array, slip: Signs, turn: Signs
) -> None:
    """Move nodes, hinges and pulleys by a share of the step; what is held goes back to where it was."""
    E, G = plane.elements, len(plane.size)
    way, node, before, column = both.right, both.node, both.before, both.column
    for p in range(2):
        for j in range(2 * E):
            i = j if j < E else j + 1
            moved = node[p, i] + share * way[column[p, i + 1]]
            node[p, i] = before[p, i] if slip[p, j] == 0 else moved
        for g in range(G):
            moved = hinge[p, g] + share * way[4 * E + 2 * g + p]
            hinge[p, g] = both.hinge_before[p, g] if turn[p, g] == 0 else moved
        node[p, E] = plane.arm * bend_of(plane.size, hinge[p])
        pulley[p] += share * way[column[p, 0]]
