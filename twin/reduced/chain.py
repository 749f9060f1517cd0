"""Chain of nodes of one bending plane: its parameters, and the forces at given positions.

The two wires of a plane and the section between them are one chain, from the pulley along wire a to the tip
and back along wire b:

    pulley p - a_1 - ... - a_E - z - b_E - ... - b_1 - pulley p,     z = r (theta_1 n_1 + ... + theta_G n_G)

A segment between two nodes is a spring that cannot push. A node is an element of the sheath, but z, which is
where the wires are at the tip: the moment arm r times the bend, that is the sum over the groups of n equal
hinges at the angle theta.

Scratch arrays hold several quantities in their rows. Numba counts the references of every array that is
handed on, atomically: few arrays with named rows are several times as fast as one array for each quantity.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.kernels import inlined

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

HELD = 1e-3
"""Share of its stiffness that a slack segment is given in the linear system, not in the equilibrium."""
RESIDUAL_N = 1e-7
"""Force that is missing from equilibrium at any node, at most [N]."""
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


class Hinge(NamedTuple):
    """Law of one hinge in an increment."""

    stiffness: float  # [N m / rad]
    cubic: float  # growth of the stiffness [N m / rad^3]
    rest: float  # angle where nothing pulls [rad]
    damping: float  # over the time of the increment [N m / rad]


class Plane(NamedTuple):
    """Parameters of a plane for one increment."""

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
    pulley_stiffness: float  # of the pulley's own spring [N / m]
    target: float  # distance that the pulley is driven to [m]
    holds: float  # friction of the sheath at rest over that of sliding [-]


@inlined
def copy_row(to: NDArray[Any], values: NDArray[Any]) -> None:
    """Copy the numbers of an array into another one."""
    for i in range(len(to)):
        to[i] = values[i]


@inlined
def copy_rows(to: NDArray[Any], values: NDArray[Any]) -> None:
    """Copy the numbers of an array of two dimensions into another one."""
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
def load_of(law: Segment, stretch: float, before: float) -> tuple[float, float, float]:
    """Return elastic tension [N], tension with damping [N] and its slope [N / m] of a segment.

    It is stretched by `stretch`, and was by `before` at the start of the increment [m].
    """
    taut, taut_before = max(stretch, 0.0), max(before, 0.0)
    tension = taut * (law.stiffness + law.quadratic * taut)
    force = tension + law.damping * (taut - taut_before)
    slope = law.stiffness + 2.0 * law.quadratic * taut + law.damping
    if force <= 0.0:  # no wire pushes, and no jump is left for which there would be no equilibrium
        force = slope = 0.0
    return tension, force, slope


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
    """Return the angle by which a group of `size` hinges turns the wires in both planes [rad].

    One hinge has an `angle` [rad] in this plane, and the square `turned` of it in the other one [rad^2].
    """
    return size * math.sqrt(angle * angle + turned)
