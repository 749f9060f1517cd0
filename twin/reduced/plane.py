"""Quasi-static equilibrium of one bending plane after an increment of the pull: the reduced twin's equations.

An element of the sheath rubs on its node with the force F = c (T_left + T_right) + floor (capstan, see
`twin/mechanics/friction.py`), a group of n equal hinges with the torque F_g; T(s) is the tension of a segment
at a stretch s (`twin/reduced/chain.py` draws the chain). In each increment the positions minimise elastic
energy plus dissipation,

    E(x) + F |x - x_before|  ->  min      so that      T_left - T_right  in  F sign(x - x_before)

(incremental energy minimisation: Mielke and Roubicek 2015, Rate-Independent Systems, chapter 1.6; with F that
follows the state: chapter 3.2). F is that at the end of the increment, found together with the positions.

Newton's steps (`newton.py`) and, where they do not settle, sweeps over the nodes (`sweep.py`) take turns
until less than `RESIDUAL_N` is missing from equilibrium at every node.
"""

import math

from twin.mechanics.compiled import compiled
from twin.mechanics.friction import CAUGHT_UP
from twin.reduced.chain import (
    Array,
    Plane,
    Signs,
    Work,
    bend_of,
    fill_stretch,
    load_segments,
    pulley_force,
    write_row,
)
from twin.reduced.newton import settle
from twin.reduced.sweep import sweep

SWEEPS = 25
"""Sweeps in the first turn; each turn has twice as many as the one before, up to 32 times these."""
ROUNDS = 40
"""Times that Newton's steps and sweeps take turns, before the increment is given up."""


@compiled
def solve_plane(
    plane: Plane, work: Work, element: Array, hinge: Array, pulley: float, slip: Signs, turn: Signs
) -> tuple[float, float]:
    """Bring a plane to equilibrium after an increment.

    Args:
        plane: parameters.
        work: scratch arrays; they hold the tensions at the end.
        element: (2 E,) positions of the elements in the order of the chain [m]; rewritten.
        hinge: (G,) angle of a hinge of each group [rad]; rewritten.
        pulley: its position [m].
        slip: (2 E,) way that each element slides: -1, 0 or 1, of the last increment; rewritten.
        turn: (G,) the same of the groups.

    Returns:
        Position of the pulley [m] and largest force that is missing [N].
    """
    E = plane.elements
    write_row(work.before[:E], element[:E])
    write_row(work.before[E + 1 :], element[E:])
    work.before[E] = plane.arm * bend_of(plane.size, hinge)
    write_row(work.node, work.before)
    write_row(work.hinge_before, hinge)
    fill_stretch(work.stretch_before, plane.rest, work.node, pulley)
    load_segments(plane, work, pulley)
    if plane.holds > 1.0:
        hold_caught_up(plane, work, slip)
    pulley = pulley + pulley_force(plane, work.force, pulley) / plane.pulley_stiffness

    missing = math.inf
    for turns in range(ROUNDS):
        pulley, missing, settled = settle(plane, work, hinge, pulley, slip, turn)
        if settled:
            break
        for _ in range(SWEEPS << min(turns, 5)):
            pulley = sweep(plane, work, hinge, pulley, slip, turn)
    write_row(element[:E], work.node[:E])
    write_row(element[E:], work.node[E + 1 :])
    return pulley, missing


@compiled
def hold_caught_up(plane: Plane, work: Work, slip: Signs) -> None:
    """Hold the elements that have caught up with what pulls them, by the tensions before an increment."""
    most = 1.0 + CAUGHT_UP * (plane.holds - 1.0)
    for j in range(len(slip)):
        i = j if j < plane.elements else j + 1
        ahead, behind = work.tension[i], work.tension[i + 1]
        if abs(ahead - behind) <= most * (plane.per_tension * (ahead + behind) + plane.floor):
            slip[j] = 0
