"""Chain of nodes of one bending plane: its parameters, its scratch arrays, and the forces at given positions.

The two wires of a plane and the section between them are one chain, from the pulley along wire a to the tip
and back along wire b:

    pulley p - a_1 - ... - a_E - z - b_E - ... - b_1 - pulley p,     z = r (theta_1 n_1 + ... + theta_G n_G)

A segment between two nodes is a spring that cannot push. A node is an element of the sheath, but z, which is
where the wires are at the tip: the moment arm r times the bend, that is the sum over the groups of n equal
hinges at the angle theta.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.compiled import inlined

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

HELD = 1e-3
"""Share of its stiffness that a slack segment is given in the linear system, not in the equilibrium."""
RESIDUAL_N = 1e-7
"""Force that is missing from equilibrium at any node, at most [N]."""


class Segment(NamedTuple):
    """Law of one segment of wire in an increment.

    Attributes:
        stiffness: [N / m].
        quadratic: growth of the stiffness [N / m^2].
        damping: over the time of the increment [N / m].
    """

    stiffness: float
    quadratic: float
    damping: float


class Hinge(NamedTuple):
    """Law of one hinge in an increment.

    Attributes:
        stiffness: [N m / rad].
        cubic: growth of the stiffness [N m / rad^3].
        rest: angle where nothing pulls [rad].
        damping: over the time of the increment [N m / rad].
    """

    stiffness: float
    cubic: float
    rest: float
    damping: float


class Plane(NamedTuple):
    """Parameters of a plane for one increment. What inner loops hand on holds no arrays: those are counted.

    Attributes:
        elements: E, of the sheath of one wire.
        rest: (2 E + 2,) stretch of each segment where all positions are zero [m].
        segment: law of the segments.
        per_tension: c, friction of an element per tension on each side [-].
        floor: friction of an element that does not depend on the tension [N].
        hinge: law of the hinges.
        joint_friction: (G,) own friction of a hinge of each group [N m].
        size: (G,) hinges of each group.
        arm: r, moment arm of the wires [m].
        routing: friction coefficient of wires on vertebrae [-].
        pulley_stiffness: of the pulley's own spring [N / m].
        target: distance that the pulley is driven to [m].
        holds: friction of the sheath at rest over that of sliding [-].
    """

    elements: int
    rest: Array
    segment: Segment
    per_tension: float
    floor: float
    hinge: Hinge
    joint_friction: Array
    size: Array
    arm: float
    routing: float
    pulley_stiffness: float
    target: float
    holds: float


class Work(NamedTuple):
    """Scratch arrays of `solve_plane`: N = 2 E + 1 nodes, N + 1 segments, G groups.

    Attributes:
        node: (N,) positions [m].
        before: (N,) positions at the start of the increment [m].
        stretch: (N + 1,) stretch of each segment [m].
        stretch_before: (N + 1,) the same at the start of the increment [m].
        tension: (N + 1,) elastic tension of each segment [N].
        force: (N + 1,) tension with damping [N].
        slope: (N + 1,) derivative of the force by the stretch [N / m].
        lower: (N,) lower diagonal of the linear system [N / m]; so are `main` and `upper`.
        main: see there.
        upper: see there.
        right: (N,) its right side [N], then its solution [m].
        border: (N,) response of the nodes to the pulley [-].
        hinge_before: (G,) angle of a hinge of each group at the start of the increment [rad].
        wrapped: (G,) routing friction of a group, as a share of the tension [-].
        residual: (G,) torque that is missing at a hinge of a group [N m].
        hinge_slope: (G,) derivative of its torque by its angle [N m / rad].
    """

    node: Array
    before: Array
    stretch: Array
    stretch_before: Array
    tension: Array
    force: Array
    slope: Array
    lower: Array
    main: Array
    upper: Array
    right: Array
    border: Array
    hinge_before: Array
    wrapped: Array
    residual: Array
    hinge_slope: Array


def new_work(elements: int, groups: int) -> Work:
    """Return scratch arrays."""
    nodes = 2 * elements + 1
    of_nodes = ("node", "before", "lower", "main", "upper", "right", "border")
    of_segments = ("stretch", "stretch_before", "tension", "force", "slope")
    of_groups = ("hinge_before", "wrapped", "residual", "hinge_slope")
    return Work(
        **{name: np.zeros(nodes) for name in of_nodes},
        **{name: np.zeros(nodes + 1) for name in of_segments},
        **{name: np.zeros(groups) for name in of_groups},
    )


@inlined
def write_row(to: Array, values: Array) -> None:
    """Write the numbers of an array into another one."""
    for i in range(len(to)):
        to[i] = values[i]


@inlined
def write_rows(to: NDArray[Any], values: NDArray[Any]) -> None:
    """Write the numbers of an array of two dimensions into another one."""
    for i in range(to.shape[0]):
        for k in range(to.shape[1]):
            to[i, k] = values[i, k]


@inlined
def bend_of(size: Array, hinge: Array) -> float:
    """Return the bending angle [rad] from number and angle of the hinges of each group."""
    bend = 0.0
    for g in range(len(hinge)):
        bend += size[g] * hinge[g]
    return bend


@inlined
def fill_stretch(stretch: Array, rest: Array, node: Array, pulley: float) -> None:
    """Fill in the stretch of all segments [m]; below 0 where one is slack."""
    last = len(node)
    for i in range(last + 1):
        left = pulley if i == 0 else node[i - 1]
        right = pulley if i == last else node[i]
        stretch[i] = rest[i] + left - right


@inlined
def load_of(law: Segment, stretch: float, before: float) -> tuple[float, float, float]:
    """Return elastic tension [N], tension with damping [N] and its slope [N / m] of a segment.

    Args:
        law: of the segment.
        stretch: of it [m].
        before: the same at the start of the increment [m].
    """
    taut, taut_before = max(stretch, 0.0), max(before, 0.0)
    tension = taut * (law.stiffness + law.quadratic * taut)
    force = tension + law.damping * (taut - taut_before)
    slope = law.stiffness + 2.0 * law.quadratic * taut + law.damping
    if force <= 0.0:  # no wire pushes, and no jump is left for which there would be no equilibrium
        force = slope = 0.0
    return tension, force, slope


@inlined
def load_segments(plane: Plane, work: Work, pulley: float) -> None:
    """Fill in tension, force and slope of all segments."""
    law, stretch, before = plane.segment, work.stretch, work.stretch_before
    fill_stretch(stretch, plane.rest, work.node, pulley)
    tension, force, slope = work.tension, work.force, work.slope
    for i in range(len(stretch)):
        tension[i], force[i], slope[i] = load_of(law, stretch[i], before[i])


@inlined
def pulley_force(plane: Plane, force: Array, pulley: float) -> float:
    """Return the force that is missing at the pulley [N], between its spring and both wires."""
    missing: float = plane.pulley_stiffness * (plane.target - pulley) - force[0] + force[-1]
    return missing


@inlined
def hinge_torque(law: Hinge, angle: float, before: float) -> tuple[float, float]:
    """Return the torque of spring and damping of a hinge [N m] and its slope [N m / rad]."""
    away = angle - law.rest
    torque = away * (law.stiffness + law.cubic * away * away) + law.damping * (angle - before)
    slope = law.stiffness + 3.0 * law.cubic * away * away + law.damping
    return torque, slope


@inlined
def larger(a: float, b: float) -> float:
    """Return the larger of two numbers; infinity where one is no number."""
    if math.isnan(a) or math.isnan(b):
        return math.inf
    return max(a, b)


@inlined
def turn_of(size: float, angle: float, turned: float) -> float:
    """Return the angle that a group turns the wires by in both planes [rad], whatever its direction.

    Args:
        size: number of its hinges.
        angle: of one of them [rad].
        turned: square of its angle in the other plane [rad^2].
    """
    return size * math.sqrt(angle * angle + turned)
