"""Sweeps over the nodes of one bending plane (Gauss-Seidel), for where Newton's steps do not settle.

Each node in turn is brought to its own equilibrium between its neighbours. Such sweeps converge for these
chains (Rheinboldt 1970, M-functions), but slowly: they lead elsewhere, and Newton's steps go on from there.
"""

import math

from twin.mechanics.compiled import compiled, inlined
from twin.reduced.chain import (
    RESIDUAL_N,
    Array,
    Plane,
    Signs,
    Work,
    bend_of,
    hinge_torque,
    load_of,
    load_segments,
    pulley_force,
    turn_of,
)

TRIALS = 80
"""Most steps of the bracketed search for the rest of one node."""


@compiled
def sweep(plane: Plane, work: Work, hinge: Array, pulley: float, slip: Signs, turn: Signs) -> float:
    """Bring one node after the other to its own equilibrium; return the pulley's position [m]."""
    E, last = plane.elements, 2 * plane.elements
    for i in range(last + 1):
        if i == E:
            _sweep_hinges(plane, work, hinge, turn)
            continue
        left = pulley if i == 0 else work.node[i - 1]
        right = pulley if i == last else work.node[i + 1]
        ahead, behind = plane.rest[i] + left, plane.rest[i + 1] - right
        work.node[i], slip[i if i < E else i - 1] = _rest_of_node(plane, work, i, ahead, behind)
    load_segments(plane, work, pulley)
    yielding = plane.pulley_stiffness + work.slope[0] + work.slope[last + 1]
    moved: float = pulley_force(plane, work.force, pulley) / yielding
    return pulley + moved


@inlined
def _way(force: float, friction: float) -> int:
    """Return the way that a node leaves its place: 1, -1, or 0 where friction holds it."""
    if abs(force) <= friction:
        return 0
    return 1 if force > 0.0 else -1


@inlined
def _within(x: float, near: float, far: float) -> float:
    """Return a step of Newton's where it lies in the bracket, else the middle of that."""
    return x if min(near, far) < x < max(near, far) else (near + far) / 2.0


@compiled
def _rest_of_node(plane: Plane, work: Work, i: int, ahead: float, behind: float) -> tuple[float, int]:
    """Return where an element comes to rest between its neighbours, and which way it went there.

    `ahead` less the position is the stretch on its left, `behind` plus the position that on its right.
    """
    c, before = plane.per_tension, work.before[i]
    s, x, near, far = 0, before, before, before
    for trial in range(TRIALS):
        a, a_force, a_slope = load_of(plane.segment, ahead - x, work.stretch_before[i])
        b, b_force, b_slope = load_of(plane.segment, behind + x, work.stretch_before[i + 1])
        friction = c * (a + b) + plane.floor
        if trial == 0:
            s = _way(a_force - b_force, plane.holds * friction)
            if s == 0:
                break
            # Further on, the force is against the node: the wire that pulls it there would be slack.
            far = ahead if s > 0 else -behind
        excess = a_force - b_force - s * friction
        if abs(excess) <= 0.1 * RESIDUAL_N:
            break
        if excess * s > 0.0:
            near = x
        else:
            far = x
        x = _within(x + excess / ((1.0 - s * c) * a_slope + (1.0 + s * c) * b_slope), near, far)
    return x, s


@inlined
def _sweep_hinges(plane: Plane, work: Work, hinge: Array, turn: Signs) -> None:
    """Bring one group of hinges after the other to its own equilibrium, and the tip with them."""
    size, passed = plane.size, 0.0
    bend = bend_of(size, hinge)
    for g in range(len(hinge)):
        others = bend - size[g] * hinge[g]
        turned = turn_of(size[g], hinge[g], 0.0)
        wrapped = plane.routing * (passed + turned / 2.0)
        passed += turned
        hinge[g], turn[g] = _rest_of_group(plane, work, g, others, wrapped)
        bend = others + size[g] * hinge[g]
    work.node[plane.elements] = plane.arm * bend


@compiled
def _rest_of_group(plane: Plane, work: Work, g: int, others: float, wrapped: float) -> tuple[float, int]:
    """Return the angle where the hinges of a group come to rest, and which way they went there.

    Args:
        plane: parameters.
        work: where the other nodes are.
        g: the group.
        others: bend of the other groups [rad].
        wrapped: routing friction of the group, as a share of the tension [-].
    """
    E, arm, n, before = plane.elements, plane.arm, plane.size[g], work.hinge_before[g]
    left, right = plane.rest[E] + work.node[E - 1], plane.rest[E + 1] - work.node[E + 1]
    s, x, near, far = 0, before, before, before
    for trial in range(TRIALS):
        z = arm * (others + n * x)
        a, a_force, a_slope = load_of(plane.segment, left - z, work.stretch_before[E])
        b, b_force, b_slope = load_of(plane.segment, right + z, work.stretch_before[E + 1])
        torque, slope = hinge_torque(plane.hinge, x, before)
        force, friction = (
            arm * (a_force - b_force) - torque,
            plane.joint_friction[g] + arm * wrapped * (a + b),
        )
        if trial == 0:
            s = _way(force, friction)
            if s == 0:
                break
            far = s * math.inf
        excess = force - s * friction
        if abs(excess) <= 0.1 * RESIDUAL_N * arm:
            break
        if excess * s > 0.0:
            near = x
        else:
            far = x
        slope += arm * arm * n * ((1.0 - s * wrapped) * a_slope + (1.0 + s * wrapped) * b_slope)
        x = _within(x + excess / slope, near, far)
    return x, s
