"""Quasi-static equilibrium of two bending planes, whose dry friction opposes their motion as one.

The equations are those of one plane (`plane.py`), but for the friction: at each place of the sheath and at
each group of hinges, neighbours in both planes have one (`shared_friction.py`): wires a and c, b and d, and
the crossed hinges. A second plane that nothing moves changes nothing in the first.

Newton's steps on all unknowns together (`both_newton.py`) and, where they do not settle, sweeps over the
neighbours (`both_sweep.py`) take turns until less than `RESIDUAL_N` is missing from equilibrium.
"""

import math

from twin.mechanics.compiled import compiled
from twin.mechanics.friction import CAUGHT_UP
from twin.reduced.both_chain import BothPlanes, both_pulley_force, load_both
from twin.reduced.both_newton import FARTHEST, settle_both
from twin.reduced.both_sweep import sweep_both
from twin.reduced.chain import (
    RESIDUAL_N,
    Array,
    Hinge,
    Plane,
    Segment,
    Signs,
    bend_of,
    fill_stretch,
    write_row,
    write_rows,
)

PARTS = 5
"""Parts that an increment is divided into: the direction of friction turns within it."""
MOST_PARTS = 1024
"""Most of them, where no equilibrium is found."""
SWEEPS = 25
"""Sweeps in the first turn; each turn has twice as many as the one before, up to 8 times these."""
ROUNDS = 12
"""Times that Newton's steps and sweeps take turns, before the increment is given up."""


@compiled
def solve_both_planes(
    plane: Plane,
    rest: tuple[float, float],
    target: tuple[float, float],
    both: BothPlanes,
    element: Array,
    hinge: Array,
    pulley: Array,
    slip: Signs,
    turn: Signs,
    periods: int,
) -> float:
    """Bring two planes to equilibrium after an increment, in as many parts as that takes.

    Args:
        plane: parameters of the first; the second has the same but for what follows.
        rest: angle of a hinge where nothing pulls, in each plane [rad].
        target: distance that each pulley is driven to [m].
        both: scratch arrays.
        element: (2, 2 E) positions of the elements in the order of the chains [m]; rewritten.
        hinge: (2, G) angle of a hinge of each group [rad]; rewritten.
        pulley: (2,) positions of the pulleys [m]; rewritten.
        slip: (2, 2 E) 1 where an element slides, of the last increment; rewritten.
        turn: (2, G) the same of the groups.
        periods: control periods in the increment, of which a part has one at least to begin with.

    Returns:
        Largest force that is missing [N].
    """
    start = both.start
    write_rows(start.element, element)
    write_rows(start.hinge, hinge)
    write_row(start.pulley, pulley)
    write_rows(start.slip, slip)
    write_rows(start.turn, turn)
    missing, parts = math.inf, min(periods, PARTS)
    while not missing <= RESIDUAL_N and parts <= MOST_PARTS:
        write_rows(element, start.element)
        write_rows(hinge, start.hinge)
        write_row(pulley, start.pulley)
        write_rows(slip, start.slip)
        write_rows(turn, start.turn)
        of_part = divided(plane, parts)
        missing = 0.0
        for part in range(1, parts + 1):
            share = part / parts
            there = (
                start.pulley[0] + (target[0] - start.pulley[0]) * share,
                start.pulley[1] + (target[1] - start.pulley[1]) * share,
            )
            now = _solve_part(of_part, rest, there, both, element, hinge, pulley, slip, turn)
            missing = max(missing, now)
            if not missing <= RESIDUAL_N:
                break
        parts *= 4
    return missing


@compiled
def divided(plane: Plane, parts: int) -> Plane:
    """Return the parameters for one of equal parts of an increment, in which damping counts as much more."""
    segment, hinge = plane.segment, plane.hinge
    return Plane(
        plane.elements,
        plane.rest,
        Segment(segment.stiffness, segment.quadratic, segment.damping * parts),
        plane.per_tension,
        plane.floor,
        Hinge(hinge.stiffness, hinge.cubic, hinge.rest, hinge.damping * parts),
        plane.joint_friction,
        plane.size,
        plane.arm,
        plane.routing,
        plane.pulley_stiffness,
        plane.target,
        plane.holds,
    )


@compiled
def _solve_part(
    plane: Plane,
    rest: tuple[float, float],
    target: tuple[float, float],
    both: BothPlanes,
    element: Array,
    hinge: Array,
    pulley: Array,
    slip: Signs,
    turn: Signs,
) -> float:
    """Bring two planes to equilibrium after a part of an increment; return the largest force missing [N]."""
    E = plane.elements
    farthest = FARTHEST + 2 * max(abs(target[0] - pulley[0]), abs(target[1] - pulley[1]))
    _begin(plane, target, both, element, hinge, pulley)
    if plane.holds > 1.0:
        hold_caught_up(plane, both, slip)
    missing = math.inf
    for turns in range(ROUNDS):
        missing, settled = settle_both(
            plane, rest, target, both, hinge, pulley, slip, turn, farthest, turns == 0
        )
        if settled:
            break
        for _ in range(SWEEPS << min(turns, 3)):
            sweep_both(plane, rest, target, both, hinge, pulley, slip, turn)
    write_rows(element[:, :E], both.node[:, :E])
    write_rows(element[:, E:], both.node[:, E + 1 :])
    return missing


@compiled
def hold_caught_up(plane: Plane, both: BothPlanes, slip: Signs) -> None:
    """Hold the neighbours that have caught up with what pulls them, by the tensions before an increment."""
    most = 1.0 + CAUGHT_UP * (plane.holds - 1.0)
    for j in range(slip.shape[1]):
        i = j if j < plane.elements else j + 1
        pulled = 0.0
        for p in range(2):
            ahead, behind = both.tension[p, i], both.tension[p, i + 1]
            friction = plane.per_tension * (ahead + behind) + plane.floor
            pulled = math.hypot(pulled, (ahead - behind) / friction)
        if pulled <= most:
            slip[:, j] = 0


@compiled
def _begin(
    plane: Plane, target: tuple[float, float], both: BothPlanes, element: Array, hinge: Array, pulley: Array
) -> None:
    """Take up where the last increment ended, and move the pulleys to where they drive themselves."""
    E = plane.elements
    write_rows(both.before[:, :E], element[:, :E])
    write_rows(both.before[:, E + 1 :], element[:, E:])
    write_rows(both.hinge_before, hinge)
    for p in range(2):
        both.before[p, E] = plane.arm * bend_of(plane.size, hinge[p])
        fill_stretch(both.stretch_before[p], plane.rest, both.before[p], pulley[p])
    write_rows(both.node, both.before)
    load_both(plane, both, pulley)
    for p in range(2):
        pulley[p] += both_pulley_force(plane, target[p], both, pulley, p) / plane.pulley_stiffness
