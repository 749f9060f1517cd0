"""Increment of a reduced twin: every bending plane in equilibrium with its drive, some time later."""

import math

from twin.mechanics.compiled import compiled
from twin.mechanics.drive import PULLEY_STIFFNESS
from twin.mechanics.friction import friction_drift, friction_floor
from twin.reduced.both_chain import BothPlanes
from twin.reduced.both_planes import solve_both_planes
from twin.reduced.chain import Array, Hinge, Plane, Segment, Work
from twin.reduced.parameters import Parameters
from twin.reduced.plane import solve_plane
from twin.reduced.state import ReducedState
from twin.reduced.workspace import Workspace

_friction_drift = compiled(friction_drift)
_friction_floor = compiled(friction_floor)


@compiled
def drift_of(parameters: Parameters, state: ReducedState, m: int) -> float:
    """Return the factor on the sheath's friction by warm-up and wear."""
    warm_up, warm_up_time, wear = parameters.warm_up[m], parameters.warm_up_time[m], parameters.wear[m]
    return float(_friction_drift(warm_up, warm_up_time, wear, state.time[m], state.travel[m]))


@compiled
def increment(
    parameters: Parameters, state: ReducedState, work: Workspace, m: int, periods: int, sheath_bend: float
) -> None:
    """Bring an endoscope to equilibrium with its drive.

    Args:
        parameters: of M endoscopes.
        state: theirs; that of one is rewritten.
        work: scratch arrays.
        m: which one.
        periods: control periods since the last increment.
        sheath_bend: angle that the sheath is bent by [rad].
    """
    state.time[m] += periods * parameters.control_period
    plane = _plane(parameters, state, m, periods, sheath_bend)
    rest = parameters.hinge_rest[m]
    missing = _solve(work.plane, work.both, plane, rest, state, m, periods)
    state.missing[m] = max(state.missing[m], missing) if missing < math.inf else math.inf


@compiled
def _solve(
    work: Work | None,
    both: BothPlanes | None,
    plane: Plane,
    rest: Array,
    state: ReducedState,
    m: int,
    periods: int,
) -> float:
    """Solve for one plane or for both; return the largest force that is missing [N].

    Numba leaves out a branch where it knows the type None: so one solver is compiled, and not both.
    """
    missing = 0.0
    if work is not None:
        element, hinge, pulley = state.element[m, 0], state.hinge[m, 0], state.pulley[m, 0]
        slip, turn = state.slip[m, 0], state.turn[m, 0]
        state.pulley[m, 0], missing = solve_plane(plane, work, element, hinge, pulley, slip, turn)
    if both is not None:
        missing = solve_both_planes(
            plane,
            (rest[0], rest[1]),
            (plane.target, state.drive[m, 1, 2]),
            both,
            state.element[m],
            state.hinge[m],
            state.pulley[m],
            state.slip[m],
            state.turn[m],
            periods,
        )
    return missing


@compiled
def _plane(
    parameters: Parameters,
    state: ReducedState,
    m: int,
    periods: int,
    sheath_bend: float,
) -> Plane:
    """Return the parameters of the first plane for one increment."""
    seconds, drift = periods * parameters.control_period, drift_of(parameters, state, m)
    # As `friction_per_tension`, for the tension on each side instead of their mean.
    wrapped = parameters.sheath_friction[m] * drift * (sheath_bend + parameters.bend_offset[m])
    own, growth, exponent = parameters.floor[m], parameters.growth[m], parameters.exponent[m]
    return Plane(
        state.element.shape[2] // 2,
        parameters.rest[m],
        Segment(
            parameters.wire_stiffness[m],
            parameters.wire_quadratic[m],
            parameters.wire_damping[m] / seconds,
        ),
        math.tanh(wrapped / 2.0),
        float(_friction_floor(own, growth, exponent, sheath_bend)) * drift,
        Hinge(
            parameters.hinge_stiffness[m],
            parameters.hinge_cubic[m],
            parameters.hinge_rest[m, 0],
            parameters.hinge_damping[m] / seconds,
        ),
        parameters.joint_friction[m],
        parameters.size,
        parameters.arm[m],
        parameters.routing[m],
        PULLEY_STIFFNESS,
        state.drive[m, 0, 2],
        parameters.holds[m],
    )
