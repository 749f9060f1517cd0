"""Advance of reduced twins in time: drive, drift of the friction, and an increment of each bending plane."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.compiled import compiled
from twin.mechanics.drive import PULLEY_STIFFNESS, DriveLaw, advance_drive, delayed_command
from twin.mechanics.friction import friction_drift, friction_floor
from twin.reduced.chain import Array, Hinge, Plane, Segment, Work, new_work
from twin.reduced.parameters import Parameters
from twin.reduced.plane import solve_plane
from twin.reduced.state import ReducedState

_advance_drive = compiled(advance_drive)
_delayed_command = compiled(delayed_command)
_friction_drift = compiled(friction_drift)
_friction_floor = compiled(friction_floor)


@compiled
def advance(parameters: Parameters, state: ReducedState, inputs: Array, periods: int) -> None:
    """Advance endoscopes by one sample, in place.

    Args:
        parameters: of M endoscopes.
        state: theirs.
        inputs: (M, 3) pull [m], lateral pull [m] and bend of the sheath [rad] at the end of the sample.
        periods: control periods in it.
    """
    work = new_work((parameters.rest.shape[1] - 2) // 2, len(parameters.size))
    for m in range(len(inputs)):
        advance_one(parameters, state, work, m, inputs[m], periods)


class Trace(NamedTuple):
    """Positions of one endoscope at S samples, and how far its friction had drifted.

    Attributes:
        element: (S, P, 2 E) the positions of `ReducedState`.
        hinge: (S, P, G) likewise.
        pulley: (S, P) likewise.
        drift: (S,) factor on the sheath's friction.
    """

    element: Array
    hinge: Array
    pulley: Array
    drift: Array


def new_trace(parameters: Parameters, samples: int) -> Trace:
    """Return room for so many samples."""
    planes, groups = parameters.hinge_rest.shape[1], len(parameters.size)
    return Trace(
        np.empty((samples, planes, parameters.rest.shape[1] - 2)),
        np.empty((samples, planes, groups)),
        np.empty((samples, planes)),
        np.empty(samples),
    )


@compiled
def keep(parameters: Parameters, state: ReducedState, m: int, trace: Trace, k: int) -> None:
    """Write where an endoscope is into row k of a trace."""
    trace.element[k] = state.element[m]
    trace.hinge[k] = state.hinge[m]
    trace.pulley[k] = state.pulley[m]
    trace.drift[k] = _drift(parameters, state, m)


@compiled
def advance_record(
    parameters: Parameters,
    state: ReducedState,
    m: int,
    inputs: Array,
    periods: NDArray[np.int64],
    trace: Trace,
) -> None:
    """Advance one endoscope along a whole record, in place.

    Args:
        parameters: of M endoscopes.
        state: theirs.
        m: which one.
        inputs: (S, 3) pull [m], lateral pull [m] and bend of the sheath [rad] at the end of each sample.
        periods: (S,) control periods in each sample.
        trace: of S samples; written.
    """
    work = new_work((parameters.rest.shape[1] - 2) // 2, len(parameters.size))
    for k in range(len(inputs)):
        advance_one(parameters, state, work, m, inputs[k], periods[k])
        keep(parameters, state, m, trace, k)


@compiled
def _drift(parameters: Parameters, state: ReducedState, m: int) -> float:
    """Return the factor on the sheath's friction by warm-up and wear."""
    warm_up, warm_up_time, wear = parameters.warm_up[m], parameters.warm_up_time[m], parameters.wear[m]
    return float(_friction_drift(warm_up, warm_up_time, wear, state.time[m], state.travel[m]))


@compiled
def advance_one(
    parameters: Parameters, state: ReducedState, work: Work, m: int, inputs: Array, periods: int
) -> None:
    """Advance one endoscope by one sample, in place; see `advance`."""
    planes = parameters.hinge_rest.shape[1]
    begin = state.command[m].copy()
    if parameters.rigid[m]:
        for p in range(planes):
            state.travel[m] += abs(inputs[p] - state.drive[m, p, 2])
            state.drive[m, p, 0] = inputs[p]
            state.drive[m, p, 2] = inputs[p]
        _increment(parameters, state, work, m, periods, inputs[2])
        state.command[m] = inputs
        return

    # A drive may turn back within a sample: its way until then is an increment of its own.
    law = _law(parameters, m)
    way = np.zeros(planes)
    waiting = 0
    for k in range(1, periods + 1):
        share = k / periods
        ahead = np.empty((planes, 3))
        turns_back = False
        for p in range(planes):
            command = begin[p] * (1.0 - share) + inputs[p] * share
            now, past = state.drive[m, p], state.past[m, p]
            wanted = _delayed_command(law.delay, past, command) - parameters.zero[m, p]
            for late in range(len(past) - 1, -1, -1):
                past[late] = past[late - 1] if late > 0 else command
            ahead[p] = _advance_drive(law, now[0], now[1], now[2], wanted)
            turns_back = turns_back or (ahead[p, 2] - now[2]) * way[p] < 0.0
        if turns_back:
            done = (k - 1) / periods
            bend = begin[2] * (1.0 - done) + inputs[2] * done
            _increment(parameters, state, work, m, waiting, bend)
            way[:] = 0.0
            waiting = 0
        waiting += 1
        for p in range(planes):
            step = ahead[p, 2] - state.drive[m, p, 2]
            state.travel[m] += abs(step)
            way[p] += step
            state.drive[m, p] = ahead[p]
    _increment(parameters, state, work, m, waiting, inputs[2])
    state.command[m] = inputs


@compiled
def _law(parameters: Parameters, m: int) -> DriveLaw:
    law = parameters.drive[m]
    return DriveLaw(law[0], law[1], law[2], law[3], law[4], law[5] != 0.0, law[6])


@compiled
def _increment(
    parameters: Parameters, state: ReducedState, work: Work, m: int, periods: int, sheath_bend: float
) -> None:
    """Bring all planes to equilibrium with the drive, some control periods later."""
    planes = parameters.hinge_rest.shape[1]
    seconds = periods * parameters.control_period
    state.time[m] += seconds
    drift = _drift(parameters, state, m)
    # As `friction_per_tension`, for the tension on each side instead of their mean.
    wrapped = parameters.sheath_friction[m] * drift * (sheath_bend + parameters.bend_offset[m])
    per_tension = math.tanh(wrapped / 2.0)
    own, growth, exponent = parameters.floor[m], parameters.growth[m], parameters.exponent[m]
    floor = float(_friction_floor(own, growth, exponent, sheath_bend))
    turned = np.zeros((planes, state.hinge.shape[2]))
    if planes == 2:
        turned[0] = state.hinge[m, 1] ** 2
        turned[1] = state.hinge[m, 0] ** 2
    for p in range(planes):
        plane = Plane(
            state.element.shape[2] // 2,
            parameters.rest[m],
            Segment(
                parameters.wire_stiffness[m],
                parameters.wire_quadratic[m],
                parameters.wire_damping[m] / seconds,
            ),
            per_tension,
            floor * drift,
            Hinge(
                parameters.hinge_stiffness[m],
                parameters.hinge_cubic[m],
                parameters.hinge_rest[m, p],
                parameters.hinge_damping[m] / seconds,
            ),
            parameters.joint_friction[m],
            parameters.size,
            turned[p],
            parameters.arm[m],
            parameters.routing[m],
            PULLEY_STIFFNESS,
            state.drive[m, p, 2],
        )
        state.pulley[m, p], missing = solve_plane(
            plane,
            work,
            state.element[m, p],
            state.hinge[m, p],
            state.pulley[m, p],
            state.slip[m, p],
            state.turn[m, p],
        )
        state.missing[m] = max(state.missing[m], missing) if missing < math.inf else math.inf
