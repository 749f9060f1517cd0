"""Advance of reduced twins in time: drive, drift of the friction, and an increment of each bending plane."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.drive import DriveLaw, advance_drive
from twin.reduced.compiled import compiled
from twin.reduced.parameters import Parameters
from twin.reduced.plane import Plane, Work, new_work, solve_plane

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

PULLEY_STIFFNESS = 4e6
"""Stiffness of the spring that holds a pulley, as in the MuJoCo model [N / m]."""

_advance_drive = compiled(advance_drive)


class ReducedState(NamedTuple):
    """ReducedState of M endoscopes with P planes, E elements in the sheath of a wire and G groups of hinges.

    Attributes:
        element: (M, P, 2 E) positions of the sheath elements, pulley to tip of the first wire, then tip to
            pulley of its antagonist, towards the end of the chain [m].
        hinge: (M, P, G) angle of a hinge of each group [rad].
        slip: (M, P, 2 E) way that each element slid in the last increment: -1, 0 or 1.
        turn: (M, P, G) the same of each group.
        pulley: (M, P) position of the pulley [m].
        drive: (M, P, 3) motor, its last stride and the gear behind it [m].
        command: (M, 3) pull [m], lateral pull [m] and bend of the sheath [rad] that it stands at.
        time: (M,) since the start of the run [s].
        travel: (M,) that the pulleys have travelled [m].
        missing: (M,) largest force that was missing from equilibrium since the state was made [N].
    """

    element: Array
    hinge: Array
    slip: Signs
    turn: Signs
    pulley: Array
    drive: Array
    command: Array
    time: Array
    travel: Array
    missing: Array


def new_state(parameters: Parameters, sheath_bend: Array) -> ReducedState:
    """Return the state of endoscopes that are straight and at rest.

    Args:
        parameters: of M endoscopes.
        sheath_bend: (M,) angle that each sheath is bent by [rad].
    """
    count, planes = parameters.hinge_rest.shape
    elements, groups = parameters.rest.shape[1] - 2, len(parameters.size)
    command = np.zeros((count, 3))
    command[:, 2] = sheath_bend
    return ReducedState(
        element=np.zeros((count, planes, elements)),
        hinge=np.zeros((count, planes, groups)),
        slip=np.zeros((count, planes, elements), np.int8),
        turn=np.zeros((count, planes, groups), np.int8),
        pulley=np.zeros((count, planes)),
        drive=np.zeros((count, planes, 3)),
        command=command,
        time=np.zeros(count),
        travel=np.zeros(count),
        missing=np.zeros(count),
    )


@compiled
def advance(
    parameters: Parameters, state: ReducedState, inputs: Array, periods: int, first: int, last: int
) -> None:
    """Advance endoscopes by one sample, in place.

    Args:
        parameters: of M endoscopes.
        state: theirs.
        inputs: (M, 3) pull [m], lateral pull [m] and bend of the sheath [rad] at the end of the sample.
        periods: control periods in it.
        first: the first endoscope.
        last: the one behind the last.
    """
    work = new_work((parameters.rest.shape[1] - 2) // 2, len(parameters.size))
    for m in range(first, last):
        _advance_one(parameters, state, work, m, inputs[m], periods)


@compiled
def advance_record(
    parameters: Parameters,
    state: ReducedState,
    m: int,
    inputs: Array,
    periods: NDArray[np.int64],
    element: Array,
    hinge: Array,
    pulley: Array,
    drift: Array,
) -> None:
    """Advance one endoscope along a whole record, in place.

    Args:
        parameters: of M endoscopes.
        state: theirs.
        m: which one.
        inputs: (S, 3) pull [m], lateral pull [m] and bend of the sheath [rad] at the end of each sample.
        periods: (S,) control periods in each sample.
        element: (S, P, 2 E) the positions of `ReducedState` at the end of each sample; written.
        hinge: (S, P, G) likewise.
        pulley: (S, P) likewise.
        drift: (S,) factor on the sheath's friction then; written.
    """
    work = new_work((parameters.rest.shape[1] - 2) // 2, len(parameters.size))
    for k in range(len(inputs)):
        _advance_one(parameters, state, work, m, inputs[k], periods[k])
        element[k] = state.element[m]
        hinge[k] = state.hinge[m]
        pulley[k] = state.pulley[m]
        drift[k] = friction_drift(parameters, state, m)


@compiled
def friction_drift(parameters: Parameters, state: ReducedState, m: int) -> float:
    """Return the factor on the sheath's friction by warm-up and wear."""
    warm = parameters.warm_up[m] * math.exp(-state.time[m] / parameters.warm_up_time[m])
    factor: float = 1.0 + warm + parameters.wear[m] * state.travel[m]
    return factor


@compiled
def _advance_one(
    parameters: Parameters, state: ReducedState, work: Work, m: int, inputs: Array, periods: int
) -> None:
    planes = parameters.hinge_rest.shape[1]
    begin = state.command[m].copy()
    if parameters.rigid[m]:
        for p in range(planes):
            state.travel[m] += abs(inputs[p] - begin[p])
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
            now = state.drive[m, p]
            ahead[p] = _advance_drive(law, now[0], now[1], now[2], command)
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
    return DriveLaw(law[0], law[1], law[2], law[3], law[4], law[5] != 0.0)


@compiled
def _increment(
    parameters: Parameters, state: ReducedState, work: Work, m: int, periods: int, sheath_bend: float
) -> None:
    """Bring all planes to equilibrium with the drive, some control periods later."""
    planes = parameters.hinge_rest.shape[1]
    seconds = periods * parameters.control_period
    state.time[m] += seconds
    drift = friction_drift(parameters, state, m)
    # As `friction_per_tension`, for the tension on each side instead of their mean.
    wrapped = parameters.sheath_friction[m] * drift * (sheath_bend + parameters.bend_offset[m])
    per_tension = math.tanh(wrapped / 2.0)
    turned = np.zeros((planes, state.hinge.shape[2]))
    if planes == 2:
        turned[0] = state.hinge[m, 1] ** 2
        turned[1] = state.hinge[m, 0] ** 2
    for p in range(planes):
        plane = Plane(
            state.element.shape[2] // 2,
            parameters.rest[m],
            parameters.wire_stiffness[m],
            parameters.wire_quadratic[m],
            parameters.wire_damping[m] / seconds,
            per_tension,
            parameters.floor[m] * drift,
            parameters.hinge_stiffness[m],
            parameters.hinge_cubic[m],
            parameters.hinge_rest[m, p],
            parameters.hinge_damping[m] / seconds,
            parameters.joint_friction[m],
            parameters.size,
            turned[p],
            parameters.arm[m],
            parameters.routing[m],
            PULLEY_STIFFNESS,
            state.drive[m, p, 2],
        )
        state.pulley[m, p], missing, _ = solve_plane(
            plane,
            work,
            state.element[m, p],
            state.hinge[m, p],
            state.pulley[m, p],
            state.slip[m, p],
            state.turn[m, p],
        )
        state.missing[m] = max(state.missing[m], missing) if missing < math.inf else math.inf
