"""Sweeps over the neighbours of two bending planes (Gauss-Seidel), for where Newton's steps do not settle.

Each pair in turn is brought to its own equilibrium between its neighbours, as each node of one plane is
(`sweep.py`): they lead elsewhere, and Newton's steps go on from there.
"""

import math

from twin.mechanics.compiled import compiled
from twin.reduced.both_chain import BothPlanes, both_pulley_force, load_both, load_elements, load_hinges
from twin.reduced.chain import Array, Plane, Signs, bend_of, load_of
from twin.reduced.shared_friction import Neighbours

TRIALS = 12
"""Most steps of the search for the rest of one pair: its wires may turn slack or taut."""
ROOT_STEPS = 30
"""Most steps of the search for the way of a pair that slides."""


@compiled
def sweep_both(
    plane: Plane,
    rest: tuple[float, float],
    target: tuple[float, float],
    both: BothPlanes,
    hinge: Array,
    pulley: Array,
    slip: Signs,
    turn: Signs,
) -> None:
    """Bring one pair after the other to its own equilibrium; arguments are those of `solve_both_planes`."""
    E = plane.elements
    for i in range(2 * E + 1):
        if i == E:
            _sweep_hinges(plane, rest, both, hinge, pulley, turn)
            continue
        slides = False
        for _ in range(TRIALS):
            _load_sides(plane, both, pulley, i)
            load_elements(plane, both, i)
            slides, farthest = come_to_rest(both.pair, plane.holds), 0.0
            for p in range(2):
                moved = both.before[p, i] + both.pair.slipped[p]
                farthest = max(farthest, abs(moved - both.node[p, i]))
                both.node[p, i] = moved
            if farthest < 1e-12:
                break
        j = i if i < E else i - 1
        slip[0, j] = slip[1, j] = 1 if slides else 0
    load_both(plane, both, pulley)
    for p in range(2):
        yielding = plane.pulley_stiffness + both.slope[p, 0] + both.slope[p, -1]
        pulley[p] += both_pulley_force(plane, target[p], both, pulley, p) / yielding


@compiled
def _load_sides(plane: Plane, both: BothPlanes, pulley: Array, i: int) -> None:
    """Fill in tension, force and slope of the segments on both sides of node i."""
    last = both.node.shape[1]
    for p in range(2):
        for k in range(i, i + 2):
            left = pulley[p] if k == 0 else both.node[p, k - 1]
            right = pulley[p] if k == last else both.node[p, k]
            stretch = plane.rest[k] + left - right
            loaded = load_of(plane.segment, stretch, both.stretch_before[p, k])
            both.tension[p, k], both.force[p, k], both.slope[p, k] = loaded


@compiled
def _sweep_hinges(
    plane: Plane, rest: tuple[float, float], both: BothPlanes, hinge: Array, pulley: Array, turn: Signs
) -> None:
    """Bring one group of hinges after the other to its own equilibrium, and the tip with them."""
    E, passed = plane.elements, 0.0
    for g in range(hinge.shape[1]):
        slides, then = False, passed
        for _ in range(TRIALS):
            _load_sides(plane, both, pulley, E)
            _, then = load_hinges(plane, rest, both, hinge, g, passed)
            slides, farthest = come_to_rest(both.pair, 1.0), 0.0
            for p in range(2):
                moved = both.hinge_before[p, g] + both.pair.slipped[p]
                farthest = max(farthest, abs(moved - hinge[p, g]))
                hinge[p, g] = moved
                both.node[p, E] = plane.arm * bend_of(plane.size, hinge[p])
            if farthest < 1e-11:
                break
        passed = then
        turn[0, g] = turn[1, g] = 1 if slides else 0


@compiled
def come_to_rest(pair: Neighbours, limit: float) -> bool:
    """Fill in the slip of a pair that comes to rest with its friction, by its stiffness; return if it slides.

    From the forces t_0 that there would be without slip, tau = t_0 / (F + k lambda / F) with |tau| = 1 and
    the slip lambda tau / F: one equation for lambda, convex and falling. Newton's steps come from below.

    Args:
        pair: with `force`, `friction`, `slipped` and `stiffness`.
        limit: factor on the friction that is overcome before they slide [-].
    """
    t, F, k = pair.force, pair.friction, pair.stiffness
    start = (t[0] + k[0] * pair.slipped[0], t[1] + k[1] * pair.slipped[1])
    if math.hypot(start[0] / F[0], start[1] / F[1]) <= limit:
        pair.slipped[:] = 0.0
        return False
    way = 0.0
    tau = (start[0] / F[0], start[1] / F[1])
    for _ in range(ROOT_STEPS):
        tau = (start[0] / (F[0] + way * k[0] / F[0]), start[1] / (F[1] + way * k[1] / F[1]))
        size = math.hypot(tau[0], tau[1])
        if abs(size - 1.0) < 1e-13:
            break
        slope = 0.0
        for p in range(2):
            slope -= tau[p] ** 2 / size * k[p] / (F[p] ** 2 + way * k[p])
        way = max(way - (size - 1.0) / slope, 0.0)
    for p in range(2):
        pair.slipped[p] = way * tau[p] / F[p]
    return True
