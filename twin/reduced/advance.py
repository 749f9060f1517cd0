"""Advance of reduced twins in time: the drive, and increments of the endoscope that follows it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.drive import PULLEY_STIFFNESS, DriveLaw, advance_drive, delayed_command
from twin.mechanics.friction import friction_drift, friction_floor
from twin.mechanics.kernels import entry, inlined, kernel
from twin.preset.preset import Preset
from twin.reduced import parameters as at
from twin.reduced.chain import Array, Hinge, Plane, Segment, copy_row, copy_rows
from twin.reduced.one_plane import Work, new_work, solve_plane
from twin.reduced.parameters import Parameters, ReducedState, new_state
from twin.reduced.two_planes import BothPlanes, Start, new_both_planes, new_start, solve_both_planes

_advance_drive = kernel(advance_drive)
_delayed_command = inlined(delayed_command)
_friction_drift = inlined(friction_drift)
_friction_floor = inlined(friction_floor)


class Workspace(NamedTuple):
    """Scratch arrays for one endoscope at a time. What a None excludes is not compiled."""

    plane: Work | None  # with one bending plane
    both: BothPlanes | None  # with two
    start: Start | None  # with two
    ahead: Array  # (P, 4) each drive one control period later, and the travel of its pulley [m]


def new_workspace(parameters: Parameters) -> Workspace:
    """Return scratch arrays for endoscopes of one layout; each thread needs its own."""
    elements, groups = parameters.rest.shape[1] // 2 - 1, len(parameters.size)
    ahead = np.zeros((parameters.planes, 4))
    if parameters.planes == 1:
        return Workspace(new_work(elements, groups), None, None, ahead)
    return Workspace(None, new_both_planes(elements, groups), new_start(elements, groups), ahead)


class Trace(NamedTuple):
    """Positions of one endoscope at S samples, and how far its friction had drifted."""

    element: Array  # (S, P, 2 E) as of `ReducedState`; so are the next two
    hinge: Array  # (S, P, G)
    pulley: Array  # (S, P)
    drift: Array  # (S,) factor on the sheath's friction


def new_trace(parameters: Parameters, samples: int) -> Trace:
    """Return room for so many samples."""
    planes, groups = parameters.planes, len(parameters.size)
    return Trace(
        np.empty((samples, planes, parameters.rest.shape[1] - 2)),
        np.empty((samples, planes, groups)),
        np.empty((samples, planes)),
        np.empty(samples),
    )


@entry
def advance(
    parameters: Parameters, state: ReducedState, work: Workspace, inputs: Array, periods: int
) -> None:
    """Advance M endoscopes by one sample of some control periods, in place.

    `inputs` (M, 3) are pull [m], lateral pull [m] and bend of the sheath [rad] at the end of the sample.
    """
    for m in range(len(inputs)):
        advance_one(parameters, state, work, m, inputs, m, periods)


@entry
def keep(parameters: Parameters, state: ReducedState, m: int, trace: Trace, k: int) -> None:
    """Write where endoscope m is into row k of a trace."""
    _keep(parameters, state, m, trace, k)


@entry
def advance_record(
    parameters: Parameters,
    state: ReducedState,
    work: Workspace,
    m: int,
    inputs: Array,
    periods: NDArray[np.int64],
    trace: Trace,
) -> None:
    """Advance endoscope m along S samples, in place, and write the trace.

    `inputs` (S, 3) are as of `advance`, `periods` (S,) the control periods in each sample.
    """
    for k in range(len(inputs)):
        advance_one(parameters, state, work, m, inputs, k, periods[k])
        _keep(parameters, state, m, trace, k)


@inlined
def _keep(parameters: Parameters, state: ReducedState, m: int, trace: Trace, k: int) -> None:
    copy_rows(trace.element[k], state.element[m])
    copy_rows(trace.hinge[k], state.hinge[m])
    copy_row(trace.pulley[k], state.pulley[m])
    trace.drift[k] = _drift_of(parameters, state, m)


@kernel
def advance_one(
    parameters: Parameters,
    state: ReducedState,
    work: Workspace,
    m: int,
    inputs: Array,
    row: int,
    periods: int,
) -> None:
    """Advance endoscope m by one sample, in place, to the inputs of a row; see `advance`."""
    constants, drive, run, ahead = parameters.constants, state.drive, state.run, work.ahead
    planes, late = parameters.planes, parameters.late
    sticks = constants[m, at.HOLDS] > 1.0
    law = DriveLaw(
        constants[m, at.DRIVE],
        constants[m, at.DRIVE + 1],
        constants[m, at.DRIVE + 2],
        constants[m, at.DRIVE + 3],
        constants[m, at.DRIVE + 4],
        constants[m, at.DRIVE + 5] != 0.0,
        constants[m, at.DRIVE + 6],
    )
    waiting, first = 0, 1
    if constants[m, at.RIGID] and not sticks:  # the increment at the end of the sample is the only one
        waiting, first = periods, periods + 1
        for p in range(planes):
            run[m, at.TRAVEL] += abs(inputs[row, p] - drive[m, p, 2])
            drive[m, p, 0] = inputs[row, p]
            drive[m, p, 2] = inputs[row, p]
    for p in range(planes):
        ahead[p, 3] = 0.0
    for k in range(first, periods + 2):
        # A drive may turn back within a sample: its travel until then is an increment of its own. So is every
        # control period of an endoscope that moves in steps, as in the twin in MuJoCo.
        ends, turns_back, share = k > periods, False, k / periods
        for p in range(0 if ends else planes):
            command = run[m, at.COMMAND + p] * (1.0 - share) + inputs[row, p] * share
            wanted = command
            if late > 0:
                wanted = _delayed_command(law.delay, state.past[m, p], command)
                for older in range(late - 1, -1, -1):
                    state.past[m, p, older] = state.past[m, p, older - 1] if older > 0 else command
            wanted -= constants[m, at.ZERO + p]
            motor, stride, gear = drive[m, p, 0], drive[m, p, 1], drive[m, p, 2]
            ahead[p, 0], ahead[p, 1], ahead[p, 2] = _advance_drive(law, motor, stride, gear, wanted)
            turns_back = turns_back or (ahead[p, 2] - gear) * ahead[p, 3] < 0.0
        if ends or turns_back or (sticks and waiting > 0):
            done = (k - 1) / periods
            bend = inputs[row, 2] if ends else run[m, at.COMMAND + 2] * (1.0 - done) + inputs[row, 2] * done
            _increment(parameters, state, work, m, waiting, bend)
            waiting = 0
            for p in range(planes):
                ahead[p, 3] = 0.0
        waiting += 1
        for p in range(0 if ends else planes):
            step = ahead[p, 2] - drive[m, p, 2]
            run[m, at.TRAVEL] += abs(step)
            ahead[p, 3] += step
            for column in range(3):
                drive[m, p, column] = ahead[p, column]
    for column in range(3):
        run[m, at.COMMAND + column] = inputs[row, column]


@inlined
def _drift_of(parameters: Parameters, state: ReducedState, m: int) -> float:
    """Return the factor on the sheath's friction by warm-up and wear."""
    constants, time, travel = parameters.constants, state.run[m, at.TIME], state.run[m, at.TRAVEL]
    warm_up, warm_up_time = constants[m, at.WARM_UP], constants[m, at.WARM_UP_TIME]
    return float(_friction_drift(warm_up, warm_up_time, constants[m, at.WEAR], time, travel))


@inlined
def _increment(
    parameters: Parameters, state: ReducedState, work: Workspace, m: int, periods: int, sheath_bend: float
) -> None:
    """Bring endoscope m to equilibrium with its drive, some control periods after the last increment."""
    constants, run = parameters.constants, state.run
    seconds = periods * parameters.control_period
    run[m, at.TIME] += seconds
    drift = _drift_of(parameters, state, m)
    # As `friction_per_tension`, for the tension on each side instead of their mean.
    wrapped = constants[m, at.SHEATH_FRICTION] * drift * (sheath_bend + constants[m, at.BEND_OFFSET])
    own, growth, exponent = constants[m, at.FLOOR], constants[m, at.GROWTH], constants[m, at.EXPONENT]
    plane = Plane(
        state.element.shape[2] // 2,
        parameters.rest[m],
        Segment(
            constants[m, at.WIRE_STIFFNESS],
            constants[m, at.WIRE_QUADRATIC],
            constants[m, at.WIRE_DAMPING] / seconds,
        ),
        math.tanh(wrapped / 2.0),
        float(_friction_floor(own, growth, exponent, sheath_bend)) * drift,
        Hinge(
            constants[m, at.HINGE_STIFFNESS],
            constants[m, at.HINGE_CUBIC],
            constants[m, at.HINGE_REST],
            constants[m, at.HINGE_DAMPING] / seconds,
        ),
        parameters.joint_friction[m],
        parameters.size,
        constants[m, at.ARM],
        constants[m, at.ROUTING],
        PULLEY_STIFFNESS,
        state.drive[m, 0, 2],
        constants[m, at.HOLDS],
    )
    rest = (constants[m, at.HINGE_REST], constants[m, at.HINGE_REST + 1])
    missing = _solve(work.plane, work.both, work.start, plane, rest, state, m, periods)
    run[m, at.MISSING_FORCE] = max(run[m, at.MISSING_FORCE], missing) if missing < math.inf else math.inf


@inlined
def _solve(
    work: Work | None,
    both: BothPlanes | None,
    start: Start | None,
    plane: Plane,
    rest: tuple[float, float],
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
    if both is not None and start is not None:
        missing = solve_both_planes(
            plane,
            rest,
            (plane.target, state.drive[m, 1, 2]),
            both,
            start,
            state.element[m],
            state.hinge[m],
            state.pulley[m],
            state.slip[m],
            state.turn[m],
            periods,
        )
    return missing


def state_at_rest(presets: Sequence[Preset], parameters: Parameters) -> ReducedState:
    """Return the state of endoscopes that nothing has pulled yet.

    A section that is curved by itself is built straight, and let go slowly: one increment without viscosity.
    """
    state = new_state(parameters, np.array([preset.sheath_bend for preset in presets]))
    if any(any(preset.initial_bends) for preset in presets):
        constants = parameters.constants.copy()
        constants[:, [at.WIRE_DAMPING, at.HINGE_DAMPING]] = 0.0
        slow = parameters._replace(constants=constants)
        advance(slow, state, new_workspace(parameters), state.command.copy(), 1)
        state.time[:] = 0.0
        state.slip[:] = state.turn[:] = 0
    return state
