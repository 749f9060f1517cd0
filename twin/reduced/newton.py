"""Newton's steps to the equilibrium of one bending plane: signs of sliding, linear system, its solution.

Which nodes slip, and which way, is found by an active-set form of Newton's method (Hintermueller, Ito and
Kunisch 2002): the linear system is tridiagonal, with the groups of hinges folded into the row of z and the
pulley's own spring added as a border.
"""

import math

from twin.mechanics.compiled import compiled, inlined
from twin.reduced.chain import (
    HELD,
    RESIDUAL_N,
    Array,
    Plane,
    Signs,
    Work,
    bend_of,
    hinge_torque,
    larger,
    load_segments,
    pulley_force,
    turn_of,
)

NEWTON_STEPS = 25


@compiled
def settle(
    plane: Plane, work: Work, hinge: Array, pulley: float, slip: Signs, turn: Signs
) -> tuple[float, float, bool]:
    """Step towards equilibrium.

    Returns:
        Position of the pulley [m], largest force that is missing [N], and whether it is in equilibrium.
    """
    missing = math.inf
    for _ in range(NEWTON_STEPS):
        load_segments(plane, work, pulley)
        nodes_changed, of_nodes = _assemble_nodes(plane, work, slip)
        hinges_changed, of_hinges = _assemble_hinges(plane, work, hinge, turn)
        of_pulley = pulley_force(plane, work.force, pulley)
        missing = larger(larger(of_nodes, of_hinges), abs(of_pulley))
        if not nodes_changed and not hinges_changed and missing <= RESIDUAL_N:
            return pulley, missing, True
        pulley += _step(plane, work, hinge, slip, turn, of_pulley)
    return pulley, missing, False


@inlined
def _next_sign(sign: int, moved: float, force: float, at_rest: float) -> int:
    """Return the way that a node slides, from the one assumed, its motion and the net force on it.

    One that slid stops where it would go back. One that was held slides where the force exceeds the friction
    at rest.
    """
    if sign != 0:
        return 0 if moved * sign < 0.0 else sign
    if force > at_rest + RESIDUAL_N:
        return 1
    if force < -at_rest - RESIDUAL_N:
        return -1
    return 0


@inlined
def _assemble_nodes(plane: Plane, work: Work, slip: Signs) -> tuple[bool, float]:
    """Fill the rows of the sheath's elements; return whether a sign changed, and the force missing [N]."""
    E, c = plane.elements, plane.per_tension
    lower, main, upper, right = work.lower, work.main, work.upper, work.right
    tension, force, slope, node, before = work.tension, work.force, work.slope, work.node, work.before
    changed, missing = False, 0.0
    for j in range(2 * E):
        i = j if j < E else j + 1
        ahead, behind = force[i], force[i + 1]
        friction = c * (tension[i] + tension[i + 1]) + plane.floor
        moved = node[i] - before[i]
        s = _next_sign(slip[j], moved, ahead - behind, plane.holds * friction)
        if s != slip[j]:
            slip[j] = s
            changed = True
        if s == 0:
            lower[i], main[i], upper[i], right[i] = 0.0, 1.0, 0.0, -moved
            changed = changed or moved != 0.0
            continue
        A, B = (1.0 - s * c) * slope[i], (1.0 + s * c) * slope[i + 1]
        lower[i], main[i], upper[i] = -A, A + B, -B
        right[i] = ahead - behind - s * friction
        missing = larger(missing, abs(right[i]))
        if A == 0.0 or B == 0.0:  # slack on one side: neighbours that slide with it may be held by nothing
            main[i] += HELD * plane.segment.stiffness
    return changed, missing


@inlined
def _assemble_hinges(plane: Plane, work: Work, hinge: Array, turn: Signs) -> tuple[bool, float]:
    """Fold the groups of hinges, which follow the moment of the tip, into the row of z; return likewise."""
    E, arm = plane.elements, plane.arm
    law, size, before = plane.hinge, plane.size, work.hinge_before
    wrapped, residual, slope = work.wrapped, work.residual, work.hinge_slope
    moment = arm * (work.force[E] - work.force[E + 1])
    both = work.tension[E] + work.tension[E + 1]
    changed, missing = False, 0.0
    A = B = rest = passed = 0.0
    for g in range(len(hinge)):
        turned = turn_of(size[g], hinge[g], 0.0)
        wrapped[g] = plane.routing * (passed + turned / 2.0)
        passed += turned
        torque, slope[g] = hinge_torque(law, hinge[g], before[g])
        friction = plane.joint_friction[g] + arm * wrapped[g] * both
        moved = hinge[g] - before[g]
        s = _next_sign(turn[g], moved, moment - torque, friction)
        if s != turn[g]:
            turn[g] = s
            changed = True
        if s == 0:
            residual[g] = 0.0
            rest -= arm * size[g] * moved
            changed = changed or moved != 0.0
            continue
        residual[g] = moment - torque - s * friction
        missing = larger(missing, abs(residual[g]) / arm)
        share = arm * size[g] / slope[g]
        A += share * arm * (1.0 - s * wrapped[g]) * work.slope[E]
        B += share * arm * (1.0 + s * wrapped[g]) * work.slope[E + 1]
        rest += share * residual[g]
    work.lower[E], work.main[E], work.upper[E] = -A, 1.0 + A + B, -B
    work.right[E] = rest + (arm * bend_of(plane.size, hinge) - work.node[E])
    return changed, missing


@inlined
def _step(plane: Plane, work: Work, hinge: Array, slip: Signs, turn: Signs, of_pulley: float) -> float:
    """Solve the linear system, move all nodes and hinges, and return the way of the pulley [m]."""
    lower, main, upper, right, border = work.lower, work.main, work.upper, work.right, work.border
    E, last = plane.elements, 2 * plane.elements
    # The border is how the first and the last element follow the pulley.
    border[:] = 0.0
    border[0] = 0.0 if slip[0] == 0 else -lower[0]
    border[last] = 0.0 if slip[last - 1] == 0 else -upper[last]
    for i in range(1, last + 1):
        ratio = lower[i] / main[i - 1]
        main[i] -= ratio * upper[i - 1]
        right[i] -= ratio * right[i - 1]
        border[i] -= ratio * border[i - 1]
    right[last] /= main[last]
    border[last] /= main[last]
    for i in range(last - 1, -1, -1):
        right[i] = (right[i] - upper[i] * right[i + 1]) / main[i]
        border[i] = (border[i] - upper[i] * border[i + 1]) / main[i]

    first_slope, last_slope = work.slope[0], work.slope[last + 1]
    yielding = plane.pulley_stiffness + first_slope * (1.0 - border[0]) + last_slope * (1.0 - border[last])
    pulley: float = (of_pulley + first_slope * right[0] + last_slope * right[last]) / yielding
    for i in range(last + 1):
        right[i] += border[i] * pulley

    before, wrapped, residual, slope = work.hinge_before, work.wrapped, work.residual, work.hinge_slope
    of_a = plane.arm * work.slope[E] * (right[E - 1] - right[E])
    of_b = plane.arm * work.slope[E + 1] * (right[E] - right[E + 1])
    for g in range(len(hinge)):
        s = turn[g]
        if s == 0:
            hinge[g] = before[g]
            continue
        pulled = (1.0 - s * wrapped[g]) * of_a - (1.0 + s * wrapped[g]) * of_b
        hinge[g] += (residual[g] + pulled) / slope[g]
    for j in range(last):
        i = j if j < E else j + 1
        work.node[i] = work.before[i] if slip[j] == 0 else work.node[i] + right[i]
    work.node[E] = plane.arm * bend_of(plane.size, hinge)
    return pulley
