"""Quasi-static equilibrium of one bending plane after an increment of the pull: the reduced twin's equations.

The two wires of a plane and the section between them are one chain of nodes, from the pulley along wire a to
the tip and back along wire b:

    pulley p - a_1 - ... - a_E - z - b_E - ... - b_1 - pulley p,     z = r (theta_1 n_1 + ... + theta_G n_G)

A segment between two nodes is a spring that cannot push, with the tension T(s) at a stretch s. An element of
the sheath rubs on its node with the force F = c (T_left + T_right) + floor (capstan, see
`twin/mechanics/friction.py`), a group of n equal hinges at the angle theta with the torque F_g. In each
increment the positions minimise elastic energy plus dissipation,

    E(x) + F |x - x_before|  ->  min      so that      T_left - T_right  in  F sign(x - x_before)

(incremental energy minimisation: Mielke and Roubicek 2015, Rate-Independent Systems, chapter 1.6; with F that
follows the state: chapter 3.2). F is that at the end of the increment, found together with the positions.

Which nodes slip, and which way, is found by an active-set form of Newton's method (Hintermueller, Ito and
Kunisch 2002): the linear system is tridiagonal, with the groups of hinges folded into the row of z and the
pulley's own spring added as a border. Where it does not settle, sweeps over the nodes, each to its own
equilibrium, lead it elsewhere; they converge for such chains (Rheinboldt 1970, M-functions), but slowly.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.reduced.compiled import compiled, inlined

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

RESIDUAL_N = 1e-7
"""Force that is missing from equilibrium at any node, at most [N]."""
HELD = 1e-3
"""Share of its stiffness that a slack segment is given in the linear system, not in the equilibrium."""
NEWTON_STEPS = 25
SWEEPS = 25
ROUNDS = 40
"""Times that Newton's steps and sweeps take turns, before the increment is given up."""


class Plane(NamedTuple):
    """Parameters of a plane for one increment.

    Attributes:
        elements: E, of the sheath of one wire.
        rest: (2 E + 2,) stretch of each segment where all positions are zero [m].
        stiffness: of a segment [N / m].
        quadratic: its growth [N / m^2].
        damping: of a segment over the time of the increment [N / m].
        per_tension: c, friction of an element per tension on each side [-].
        floor: friction of an element that does not depend on the tension [N].
        hinge_stiffness: of one hinge [N m / rad].
        hinge_cubic: its growth [N m / rad^3].
        hinge_rest: angle of a hinge that nothing pulls [rad].
        hinge_damping: of one hinge over the time of the increment [N m / rad].
        joint_friction: (G,) own friction of a hinge of each group [N m].
        size: (G,) hinges of each group.
        turned: (G,) square of the angle of a hinge in the other plane [rad^2].
        arm: r, moment arm of the wires [m].
        routing: friction coefficient of wires on vertebrae [-].
        pulley_stiffness: of the pulley's own spring [N / m].
        target: distance that the pulley is driven to [m].
    """

    elements: int
    rest: Array
    stiffness: float
    quadratic: float
    damping: float
    per_tension: float
    floor: float
    hinge_stiffness: float
    hinge_cubic: float
    hinge_rest: float
    hinge_damping: float
    joint_friction: Array
    size: Array
    turned: Array
    arm: float
    routing: float
    pulley_stiffness: float
    target: float


class Work(NamedTuple):
    """Scratch arrays of `solve_plane`: N = 2 E + 1 nodes, N + 1 segments, G groups.

    Attributes:
        node: (N,) positions [m].
        before: (N,) positions at the start of the increment [m].
        stretch_before: (N + 1,) stretch at the start of the increment [m].
        tension: (N + 1,) elastic tension of each segment [N].
        force: (N + 1,) tension with damping [N].
        slope: (N + 1,) derivative of the force by the stretch [N / m].
        lower: (N,) lower diagonal of the linear system [N / m]; so are `main` and `upper`.
        main: see there.
        upper: see there.
        right: (N,) its right side [N], then its solution [m].
        border: (N,) response of the nodes to the pulley [-].
        wrapped: (G,) routing friction of a group, as a share of the tension [-].
        residual: (G,) torque that is missing at a hinge of a group [N m].
        hinge_slope: (G,) derivative of its torque by its angle [N m / rad].
    """

    node: Array
    before: Array
    stretch_before: Array
    tension: Array
    force: Array
    slope: Array
    lower: Array
    main: Array
    upper: Array
    right: Array
    border: Array
    wrapped: Array
    residual: Array
    hinge_slope: Array


@compiled
def new_work(elements: int, groups: int) -> Work:
    """Return scratch arrays."""
    nodes = 2 * elements + 1
    return Work(
        np.zeros(nodes),
        np.zeros(nodes),
        np.zeros(nodes + 1),
        np.zeros(nodes + 1),
        np.zeros(nodes + 1),
        np.zeros(nodes + 1),
        np.zeros(nodes),
        np.zeros(nodes),
        np.zeros(nodes),
        np.zeros(nodes),
        np.zeros(nodes),
        np.zeros(groups),
        np.zeros(groups),
        np.zeros(groups),
    )


@compiled
def solve_plane(
    plane: Plane, work: Work, element: Array, hinge: Array, pulley: float, slip: Signs, turn: Signs
) -> tuple[float, float, int]:
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
        Position of the pulley [m], largest force that is missing [N] and number of Newton steps.
    """
    elements, arm = plane.elements, plane.arm
    nodes = 2 * elements + 1
    tip = 0.0
    for g in range(len(hinge)):
        tip += plane.size[g] * hinge[g]
    for i in range(elements):
        work.before[i] = element[i]
        work.before[elements + 1 + i] = element[elements + i]
    work.before[elements] = arm * tip
    work.node[:] = work.before
    for i in range(nodes + 1):
        left = pulley if i == 0 else work.node[i - 1]
        right = pulley if i == nodes else work.node[i]
        work.stretch_before[i] = plane.rest[i] + left - right
    hinge_before = hinge.copy()
    _load_segments(plane, work, pulley)
    pulley = plane.target - (work.force[0] - work.force[nodes]) / plane.pulley_stiffness

    steps = 0
    missing = math.inf
    for turns in range(ROUNDS):
        for _ in range(NEWTON_STEPS):
            _load_segments(plane, work, pulley)
            changed, missing = _assemble(plane, work, hinge, hinge_before, slip, turn)
            of_pulley = plane.pulley_stiffness * (plane.target - pulley) - work.force[0] + work.force[nodes]
            missing = _larger(missing, abs(of_pulley))
            if not changed and missing <= RESIDUAL_N:
                break
            pulley += _newton_step(plane, work, hinge, hinge_before, slip, turn, of_pulley)
            steps += 1
        else:
            for _ in range(SWEEPS << min(turns, 5)):
                pulley = _sweep(plane, work, hinge, hinge_before, pulley, slip, turn)
            continue
        break
    for i in range(elements):
        element[i] = work.node[i]
        element[elements + i] = work.node[elements + 1 + i]
    return pulley, missing, steps


@inlined
def _load(
    stiffness: float, quadratic: float, damping: float, stretch: float, before: float
) -> tuple[float, float, float]:
    """Return elastic tension [N], tension with damping [N] and its slope [N / m] of a segment."""
    taut, taut_before = max(stretch, 0.0), max(before, 0.0)
    tension = taut * (stiffness + quadratic * taut)
    force = tension + damping * (taut - taut_before)
    slope = stiffness + 2.0 * quadratic * taut + damping
    if force <= 0.0:  # no wire pushes, and no jump is left for which there would be no equilibrium
        force = slope = 0.0
    return tension, force, slope


@inlined
def _load_segments(plane: Plane, work: Work, pulley: float) -> None:
    last = len(work.node)
    stiffness, quadratic, damping = plane.stiffness, plane.quadratic, plane.damping
    for i in range(last + 1):
        left = pulley if i == 0 else work.node[i - 1]
        right = pulley if i == last else work.node[i]
        stretch = plane.rest[i] + left - right
        work.tension[i], work.force[i], work.slope[i] = _load(
            stiffness, quadratic, damping, stretch, work.stretch_before[i]
        )


@inlined
def _larger(a: float, b: float) -> float:
    """Return the larger of two numbers; infinity where one is no number."""
    if math.isnan(a) or math.isnan(b):
        return math.inf
    return max(a, b)


@inlined
def _next_sign(sign: int, moved: float, force: float, friction: float) -> int:
    """Return the way that a node slides, from the one assumed, its motion and the net force on it.

    A node that was held slides where the force exceeds friction. One that slid stops where it would go back,
    or where no force drives it that way.
    """
    if sign != 0 and moved * sign < 0.0:
        return 0
    if sign == 0:
        if force > friction + RESIDUAL_N:
            return 1
        if force < -friction - RESIDUAL_N:
            return -1
        return 0
    return sign


@inlined
def _assemble(
    plane: Plane, work: Work, hinge: Array, hinge_before: Array, slip: Signs, turn: Signs
) -> tuple[bool, float]:
    """Fill the linear system; return whether a sign changed, and the largest force that is missing [N]."""
    lower, main, upper, right, border = work.lower, work.main, work.upper, work.right, work.border
    E = plane.elements
    c, floor = plane.per_tension, plane.floor
    changed, missing = False, 0.0
    for i in range(2 * E + 1):
        if i == E:
            continue
        j = i if i < E else i - 1
        ahead, behind = work.force[i], work.force[i + 1]
        friction = c * (work.tension[i] + work.tension[i + 1]) + floor
        moved = work.node[i] - work.before[i]
        s = _next_sign(slip[j], moved, ahead - behind, friction)
        if s != slip[j]:
            slip[j] = s
            changed = True
        border[i] = 0.0
        if s == 0:
            lower[i], main[i], upper[i], right[i] = 0.0, 1.0, 0.0, -moved
            changed = changed or moved != 0.0
            continue
        A, B = (1.0 - s * c) * work.slope[i], (1.0 + s * c) * work.slope[i + 1]
        lower[i], main[i], upper[i] = -A, A + B, -B
        right[i] = ahead - behind - s * friction
        missing = _larger(missing, abs(right[i]))
        if A == 0.0 or B == 0.0:  # slack on one side: neighbours that slide with it may be held by nothing
            main[i] += HELD * plane.stiffness

    # Each group follows the moment of the tip: its row is folded into that of z.
    wrapped, residual, slope = work.wrapped, work.residual, work.hinge_slope
    A = B = rest = tip = passed = 0.0
    for g in range(len(hinge)):
        n = plane.size[g]
        angle = hinge[g] - plane.hinge_rest
        turned = math.sqrt(hinge[g] * hinge[g] + plane.turned[g])
        wrapped[g] = plane.routing * (passed + n * turned / 2.0)
        passed += n * turned
        moment = plane.arm * (work.force[E] - work.force[E + 1])
        friction = plane.joint_friction[g] + plane.arm * wrapped[g] * (work.tension[E] + work.tension[E + 1])
        moved = hinge[g] - hinge_before[g]
        force = moment - angle * (plane.hinge_stiffness + plane.hinge_cubic * angle * angle)
        force -= plane.hinge_damping * moved
        s = _next_sign(turn[g], moved, force, friction)
        if s != turn[g]:
            turn[g] = s
            changed = True
        slope[g] = plane.hinge_stiffness + 3.0 * plane.hinge_cubic * angle * angle + plane.hinge_damping
        if s == 0:
            residual[g] = 0.0
            rest -= plane.arm * n * moved
            changed = changed or moved != 0.0
        else:
            residual[g] = force - s * friction
            missing = _larger(missing, abs(residual[g]) / plane.arm)
            share = plane.arm * n / slope[g]
            A += share * plane.arm * (1.0 - s * wrapped[g]) * work.slope[E]
            B += share * plane.arm * (1.0 + s * wrapped[g]) * work.slope[E + 1]
            rest += share * residual[g]
        tip += n * hinge[g]
    lower[E], main[E], upper[E], border[E] = -A, 1.0 + A + B, -B, 0.0
    right[E] = rest + (plane.arm * tip - work.node[E])
    if slip[0] != 0:
        border[0] = -lower[0]
    if slip[2 * E - 1] != 0:
        border[2 * E] = border[2 * E] - upper[2 * E]
    return changed, missing


@inlined
def _newton_step(
    plane: Plane, work: Work, hinge: Array, hinge_before: Array, slip: Signs, turn: Signs, of_pulley: float
) -> float:
    """Solve the linear system, move all nodes and hinges, and return the way of the pulley [m]."""
    lower, main, upper, right, border = work.lower, work.main, work.upper, work.right, work.border
    E, last = plane.elements, 2 * plane.elements
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

    wrapped, residual, slope = work.wrapped, work.residual, work.hinge_slope
    of_a = plane.arm * work.slope[E] * (right[E - 1] - right[E])
    of_b = plane.arm * work.slope[E + 1] * (right[E] - right[E + 1])
    tip = 0.0
    for g in range(len(hinge)):
        s = turn[g]
        if s == 0:
            hinge[g] = hinge_before[g]
        else:
            change = residual[g] + (1.0 - s * wrapped[g]) * of_a - (1.0 + s * wrapped[g]) * of_b
            hinge[g] += change / slope[g]
        tip += plane.size[g] * hinge[g]
    for i in range(last + 1):
        work.node[i] += right[i]
        if i != E and slip[i if i < E else i - 1] == 0:
            work.node[i] = work.before[i]
    work.node[E] = plane.arm * tip
    return pulley


@compiled
def _sweep(
    plane: Plane, work: Work, hinge: Array, hinge_before: Array, pulley: float, slip: Signs, turn: Signs
) -> float:
    """Bring one node after the other to its own equilibrium (Gauss-Seidel); return the pulley's position."""
    E, last = plane.elements, 2 * plane.elements
    for i in range(last + 1):
        if i == E:
            tip = _sweep_hinges(plane, work, hinge, hinge_before, turn)
            work.node[E] = plane.arm * tip
            continue
        left = pulley if i == 0 else work.node[i - 1]
        right = pulley if i == last else work.node[i + 1]
        j = i if i < E else i - 1
        work.node[i], slip[j] = _rest_of_node(
            plane, work.before[i], plane.rest[i] + left, plane.rest[i + 1] - right, work, i
        )
    _load_segments(plane, work, pulley)
    of_pulley = plane.pulley_stiffness * (plane.target - pulley) - work.force[0] + work.force[last + 1]
    moved: float = of_pulley / (plane.pulley_stiffness + work.slope[0] + work.slope[last + 1])
    return pulley + moved


@compiled
def _rest_of_node(
    plane: Plane, before: float, ahead: float, behind: float, work: Work, i: int
) -> tuple[float, int]:
    """Return where a node comes to rest between its neighbours, and which way it went there.

    `ahead` less the position is the stretch on its left, `behind` plus the position that on its right.
    """
    c = plane.per_tension
    left, left_force, _ = _load(
        plane.stiffness, plane.quadratic, plane.damping, ahead - before, work.stretch_before[i]
    )
    right, right_force, _ = _load(
        plane.stiffness, plane.quadratic, plane.damping, behind + before, work.stretch_before[i + 1]
    )
    force, friction = left_force - right_force, c * (left + right) + plane.floor
    if abs(force) <= friction:
        return before, 0
    s = 1 if force > 0.0 else -1
    # The force falls on the way, and is against the node where the wire that pulls it would be slack.
    near, far = before, ahead if s > 0 else -behind
    x = before
    for _ in range(60):
        left, left_force, left_slope = _load(
            plane.stiffness, plane.quadratic, plane.damping, ahead - x, work.stretch_before[i]
        )
        right, right_force, right_slope = _load(
            plane.stiffness, plane.quadratic, plane.damping, behind + x, work.stretch_before[i + 1]
        )
        excess = left_force - right_force - s * (c * (left + right) + plane.floor)
        if abs(excess) <= 0.1 * RESIDUAL_N:
            break
        if excess * s > 0.0:
            near = x
        else:
            far = x
        x += excess / ((1.0 - s * c) * left_slope + (1.0 + s * c) * right_slope)
        if not min(near, far) < x < max(near, far):
            x = (near + far) / 2.0
    return x, s


@compiled
def _sweep_hinges(plane: Plane, work: Work, hinge: Array, hinge_before: Array, turn: Signs) -> float:
    """Bring one group of hinges after the other to its own equilibrium; return the bend [rad]."""
    E, arm = plane.elements, plane.arm
    bend = passed = 0.0
    for g in range(len(hinge)):
        bend += plane.size[g] * hinge[g]
    for g in range(len(hinge)):
        n, others = plane.size[g], bend - plane.size[g] * hinge[g]
        turned = math.sqrt(hinge[g] * hinge[g] + plane.turned[g])
        wrapped = plane.routing * (passed + n * turned / 2.0)
        passed += n * turned
        x, s = hinge_before[g], 0
        near, far = x, x
        for attempt in range(80):
            z = arm * (others + n * x)
            a, a_force, a_slope = _load(
                plane.stiffness,
                plane.quadratic,
                plane.damping,
                plane.rest[E] + work.node[E - 1] - z,
                work.stretch_before[E],
            )
            b, b_force, b_slope = _load(
                plane.stiffness,
                plane.quadratic,
                plane.damping,
                plane.rest[E + 1] + z - work.node[E + 1],
                work.stretch_before[E + 1],
            )
            angle = x - plane.hinge_rest
            force = arm * (a_force - b_force) - plane.hinge_damping * (x - hinge_before[g])
            force -= angle * (plane.hinge_stiffness + plane.hinge_cubic * angle * angle)
            friction = plane.joint_friction[g] + arm * wrapped * (a + b)
            if attempt == 0:
                if abs(force) <= friction:
                    break
                s = 1 if force > 0.0 else -1
                far = s * math.inf
            excess = force - s * friction
            if abs(excess) <= 0.1 * RESIDUAL_N * arm:
                break
            if excess * s > 0.0:
                near = x
            else:
                far = x
            slope = plane.hinge_stiffness + 3.0 * plane.hinge_cubic * angle * angle + plane.hinge_damping
            slope += arm * arm * n * ((1.0 - s * wrapped) * a_slope + (1.0 + s * wrapped) * b_slope)
            x += excess / slope
            if not min(near, far) < x < max(near, far):
                x = (near + far) / 2.0
        hinge[g], turn[g] = x, s
        bend = others + n * x
    return bend
