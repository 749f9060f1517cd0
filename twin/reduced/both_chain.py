"""Chains of nodes of two bending planes: scratch arrays, and the forces at given positions (`chain.py`)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.compiled import compiled
from twin.reduced.chain import (
    HELD,
    Array,
    Hinge,
    Plane,
    Signs,
    fill_stretch,
    hinge_torque,
    load_of,
    turn_of,
)
from twin.reduced.shared_friction import Neighbours, new_neighbours

Index = NDArray[np.int64]

LEAST_TORQUE = 1e-12
"""Smallest friction of a hinge [N m]: a force over its friction must be a number."""


class Start(NamedTuple):
    """Positions and slip of two planes at the start of an increment.

    Attributes:
        element: (2, 2 E) as of `ReducedState`; so are the others.
        hinge: (2, G).
        pulley: (2,).
        slip: (2, 2 E).
        turn: (2, G).
    """

    element: Array
    hinge: Array
    pulley: Array
    slip: Signs
    turn: Signs


class BothPlanes(NamedTuple):
    """Scratch arrays of two planes: N = 2 E + 1 nodes and N + 1 segments in each, U = 4 E + 2 G + 4 unknowns.

    Attributes:
        node: (2, N) as of `Work`; so are the others of two rows.
        before: (2, N).
        stretch: (2, N + 1).
        stretch_before: (2, N + 1).
        tension: (2, N + 1).
        force: (2, N + 1).
        slope: (2, N + 1).
        hinge_before: (2, G).
        hinge_slope: (2,) derivative of the torque of a hinge of the group that is looked at [N m / rad].
        pair: neighbours: elements of the sheath, or groups of hinges.
        column: (2, N + 2) unknown of each node of the chain, with the pulley before and after them.
        matrix: (U, U) of the linear system: elements, hinges, tip, pulleys [N / m]; rows of hinges [N m].
        right: (U,) its right side, then its solution.
        start: where the increment began.
    """

    node: Array
    before: Array
    stretch: Array
    stretch_before: Array
    tension: Array
    force: Array
    slope: Array
    hinge_before: Array
    hinge_slope: Array
    pair: Neighbours
    column: Index
    matrix: Array
    right: Array
    start: Start


def new_both_planes(elements: int, groups: int) -> BothPlanes:
    """Return scratch arrays."""
    nodes, unknowns = 2 * elements + 1, 4 * elements + 2 * groups + 4
    column = np.empty((2, nodes + 2), np.int64)
    for p in range(2):
        column[p, 0] = column[p, -1] = unknowns - 2 + p
        column[p, elements + 1] = unknowns - 4 + p
        for i in range(elements):  # of both wires from the pulley to the tip, neighbours side by side
            column[p, 1 + i] = 2 * i + p
            column[p, nodes - i] = 2 * (elements + i) + p
    of_nodes = ("node", "before")
    of_segments = ("stretch", "stretch_before", "tension", "force", "slope")
    return BothPlanes(
        **{name: np.zeros((2, nodes)) for name in of_nodes},
        **{name: np.zeros((2, nodes + 1)) for name in of_segments},
        hinge_before=np.zeros((2, groups)),
        hinge_slope=np.zeros(2),
        pair=new_neighbours(),
        column=column,
        matrix=np.zeros((unknowns, unknowns)),
        right=np.zeros(unknowns),
        start=Start(
            np.zeros((2, 2 * elements)),
            np.zeros((2, groups)),
            np.zeros(2),
            np.zeros((2, 2 * elements), np.int8),
            np.zeros((2, groups), np.int8),
        ),
    )


@compiled
def load_both(plane: Plane, both: BothPlanes, pulley: Array) -> None:
    """Fill in tension, force and slope of all segments."""
    law, stretch, before = plane.segment, both.stretch, both.stretch_before
    tension, force, slope = both.tension, both.force, both.slope
    for p in range(2):
        fill_stretch(stretch[p], plane.rest, both.node[p], pulley[p])
        for i in range(stretch.shape[1]):
            tension[p, i], force[p, i], slope[p, i] = load_of(law, stretch[p, i], before[p, i])


@compiled
def both_pulley_force(plane: Plane, target: float, both: BothPlanes, pulley: Array, p: int) -> float:
    """Return the force that is missing at a pulley [N], between its spring and both wires."""
    missing: float = plane.pulley_stiffness * (target - pulley[p]) - both.force[p, 0] + both.force[p, -1]
    return missing


@compiled
def load_elements(plane: Plane, both: BothPlanes, i: int) -> None:
    """Fill in force, friction, slip and stiffness of the two elements at node i of the chains."""
    pair, held = both.pair, HELD * plane.segment.stiffness
    tension, force, slope = both.tension, both.force, both.slope
    for p in range(2):
        pair.force[p] = force[p, i] - force[p, i + 1]
        pair.friction[p] = plane.per_tension * (tension[p, i] + tension[p, i + 1]) + plane.floor
        pair.slipped[p] = both.node[p, i] - both.before[p, i]
        pair.stiffness[p] = max(slope[p, i] + slope[p, i + 1], held)


@compiled
def load_hinges(
    plane: Plane, rest: tuple[float, float], both: BothPlanes, hinge: Array, g: int, passed: float
) -> tuple[float, float]:
    """Fill in the same of the two hinges of a group.

    Args:
        plane: parameters.
        rest: angle of a hinge where nothing pulls, in each plane [rad].
        both: scratch arrays.
        hinge: (2, G) angle of a hinge of each group [rad].
        g: the group.
        passed: angle that the groups before it turn the wires by [rad].

    Returns:
        Friction of the group per tension of the wires, a moment arm [m], and `passed` for the next one.
    """
    E, arm, pair, law, size = plane.elements, plane.arm, both.pair, plane.hinge, plane.size[g]
    tension, force, slope = both.tension, both.force, both.slope
    turned = turn_of(size, hinge[0, g], hinge[1, g] ** 2)
    wrapped = arm * plane.routing * (passed + turned / 2.0)
    for p in range(2):
        of_plane = Hinge(law.stiffness, law.cubic, rest[p], law.damping)
        torque, both.hinge_slope[p] = hinge_torque(of_plane, hinge[p, g], both.hinge_before[p, g])
        pair.force[p] = arm * (force[p, E] - force[p, E + 1]) - torque
        rubbing = wrapped * (tension[p, E] + tension[p, E + 1])
        pair.friction[p] = plane.joint_friction[g] + rubbing + LEAST_TORQUE
        pair.slipped[p] = hinge[p, g] - both.hinge_before[p, g]
        pair.stiffness[p] = both.hinge_slope[p] + arm * arm * size * (slope[p, E] + slope[p, E + 1])
    return wrapped, passed + turned
