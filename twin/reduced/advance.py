"""Advance of reduced twins in time: the drive, and increments of the endoscope that follows it."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.drive import DriveLaw, advance_drive, delayed_command
from twin.mechanics.friction import friction_drift, friction_floor
from twin.mechanics.kernels import copy_row, copy_rows, entry, kernel
from twin.preset.preset import Preset
from twin.reduced import parameters as at
from twin.reduced.one_plane import Array, Hinge, Plane, Segment, Work, solve_plane
from twin.reduced.parameters import Parameters, ReducedState, new_state
from twin.reduced.two_planes import BothPlanes, Positions, solve_both_planes

_advance_drive = kernel(advance_drive)
_delayed_command = kernel(delayed_command)
_friction_drift = kernel(friction_drift)
_friction_floor = kernel(friction_floor)


class Workspace(NamedTuple):
    """Scratch arrays for one endoscope at a time; each thread needs its own."""

    plane: Work | None  # with one bending plane; what a None excludes is not compiled
    both: BothPlanes | None  # with two
    ahead: Array  # (P, 5) each drive one control period later, and the travel of its pulley [m]

    @classmethod
    def of(cls, parameters: Parameters) -> Self:
        """Return scratch arrays for endoscopes of one layout."""
        layout = parameters.rest.shape[1] // 2 - 1, len(parameters.size)
        ahead = np.zeros((parameters.planes, 5))
        if parameters.planes == 1:
            return cls(Work.of(*layout), None, ahead)
        return cls(None, BothPlanes.of(*layout), ahead)


class Trace(NamedTuple):
    """Positions of one endoscope at S samples, and how far its friction had drifted."""

    element: Array  # (S, P, 2 E) as in `ReducedState`; so are the next two
    hinge: Array  # (S, P, G)
    pulley: Array  # (S, P)
    drift: Array  # (S,) factor on the sheath's friction

    @classmethod
    def of(cls, parameters: Parameters, samples: int) -> Self:
        """Return room for so many samples."""
        planes, groups = parameters.planes, len(parameters.size)
        shapes = (planes, parameters.rest.shape[1] - 2), (planes, groups), (planes,), ()
        return cls(*(np.empty((samples, *shape)) for shape in shapes))


@entry
def advance(
    parameters: Parameters,
    state: ReducedState,
    work: Workspace,
    first: int,
    inputs: Array,
    periods: NDArray[np.int64],
    trace: Trace,
) -> None:
    """Advance some endoscopes, from the first of them on, along S samples, in place.

    `inputs` (S, M, 3) are pull [m], lateral pull [m] and bend of the sheath [rad] of each at the end of the
    samples, `periods` (S,) the control periods in each sample: with none, an endoscope stays where it is.
    A trace that has room is written, of the last endoscope.
    """
    for m in range(inputs.shape[1]):
        for k in range(len(inputs)):
            if periods[k] > 0:
                advance_one(parameters, state, work, first + m, inputs[k, m], periods[k])
            if len(trace.drift) > 0:
                copy_rows(trace.element[k], state.element[first + m])
                copy_rows(trace.hinge[k], state.hinge[first + m])
                copy_row(trace.pulley[k], state.pulley[first + m])
                trace.drift[k] = _drift_of(parameters, state, first + m)


@kernel
def advance_one(
    parameters: Parameters, state: ReducedState, work: Workspace, m: int, inputs: Array, periods: int
) -> None:
    """Advance endoscope m by one sample, in place, to its inputs (3,); see `advance`."""
    constants, drive, run, past = parameters.constants[m], state.drive[m], state.run[m], state.past[m]
    ahead, planes, late = work.ahead, parameters.planes, parameters.late
    sticks = constants[at.HOLDS] > 1.0
    c = constants[at.DRIVE :]
    law = DriveLaw(c[0], c[1], c[2], c[3], c[4], c[5], c[6] != 0.0, c[7])
    waiting, first = 0, 1
    if constants[at.RIGID] and not sticks:  # the increment at the end of the sample is the only one
        waiting, first = periods, periods + 1
        for p in range(planes):
            run[at.TRAVEL] += abs(inputs[p] - drive[p, 2])
            drive[p, 0] = inputs[p]
            drive[p, 2] = inputs[p]
    for p in range(planes):
        ahead[p, 4] = 0.0
    for k in range(first, periods + 2):
        # A drive may turn back within a sample: its travel until then is an increment of its own. So is every
        # control period of an endoscope that moves in steps, as in the twin in MuJoCo.
        ends, turns_back, share = k > periods, False, k / periods
        for p in range(0 if ends else planes):
            command = run[at.COMMAND + p] * (1.0 - share) + inputs[p] * share
            wanted = command
            if late > 0:
                wanted = _delayed_command(law.delay, past[p], command)
                for older in range(late - 1, -1, -1):
                    past[p, older] = past[p, older - 1] if older > 0 else command
            wanted -= constants[at.ZERO + p]
            motor, stride, gear, start = drive[p, 0], drive[p, 1], drive[p, 2], drive[p, 3]
            ahead[p, 0], ahead[p, 1], ahead[p, 2], ahead[p, 3] = _advance_drive(
                law, motor, stride, gear, start, wanted
            )
            turns_back = turns_back or (ahead[p, 2] - gear) * ahead[p, 4] < 0.0
        if ends or turns_back or (sticks and waiting > 0):
            done = (k - 1) / periods
            bend = inputs[2] if ends else run[at.COMMAND + 2] * (1.0 - done) + inputs[2] * done
            _increment(parameters, state, work, m, waiting, bend)
            waiting = 0
            for p in range(planes):
                ahead[p, 4] = 0.0
        waiting += 1
        for p in range(0 if ends else planes):
            step = ahead[p, 2] - drive[p, 2]
            run[at.TRAVEL] += abs(step)
            ahead[p, 4] += step
            for column in range(4):
                drive[p, column] = ahead[p, column]
    for column in range(3):
        run[at.COMMAND + column] = inputs[column]


@kernel
def _drift_of(parameters: Parameters, state: ReducedState, m: int) -> float:
    """Return the factor on the sheath's friction by warm-up and wear."""
    c, run = parameters.constants[m], state.run[m]
    warm_up, warm_up_time, wear = c[at.WARM_UP], c[at.WARM_UP_TIME], c[at.WEAR]
    return float(_friction_drift(warm_up, warm_up_time, wear, run[at.TIME], run[at.TRAVEL]))


@kernel
def _increment(
    parameters: Parameters, state: ReducedState, work: Workspace, m: int, periods: int, sheath_bend: float
) -> None:
    """Bring endoscope m to equilibrium with its drive, some control periods after the last increment."""
    c, run = parameters.constants[m], state.run[m]
    seconds = periods * parameters.control_period
    run[at.TIME] += seconds
    drift = _drift_of(parameters, state, m)
    # As `friction_per_tension`, for the tension on each side instead of their mean.
    wrapped = c[at.SHEATH_FRICTION] * drift * (sheath_bend + c[at.BEND_OFFSET])
    plane = Plane(
        state.element.shape[2] // 2,
        parameters.rest[m],
        Segment(c[at.WIRE_STIFFNESS], c[at.WIRE_QUADRATIC], c[at.WIRE_DAMPING] / seconds, c[at.WIRE_TOE]),
        math.tanh(wrapped / 2.0),
        float(_friction_floor(c[at.FLOOR], c[at.GROWTH], c[at.EXPONENT], sheath_bend)) * drift,
        Hinge(c[at.HINGE_STIFFNESS], c[at.HINGE_CUBIC], c[at.HINGE_DAMPING] / seconds),
        parameters.joint_friction[m],
        parameters.size,
        c[at.ARM],
        c[at.ROUTING],
        (c[at.HINGE_REST], c[at.HINGE_REST + 1]),
        (state.drive[m, 0, 2], state.drive[m, parameters.planes - 1, 2]),
        c[at.HOLDS],
    )
    missing = _solve(work.plane, work.both, plane, state, m)
    run[at.MISSING_FORCE] = max(run[at.MISSING_FORCE], missing) if missing < math.inf else math.inf


@kernel
def _solve(work: Work | None, both: BothPlanes | None, plane: Plane, state: ReducedState, m: int) -> float:
    """Solve for one plane or for both; return the largest force that is missing [N].

    Numba leaves out a branch where it knows the type None: so one solver is compiled, and not both.
    """
    missing = 0.0
    element, hinge, pulley = state.element[m], state.hinge[m], state.pulley[m]
    slip, turn = state.slip[m], state.turn[m]
    if work is not None:
        pulley[0], missing = solve_plane(plane, work, element[0], hinge[0], pulley[0], slip[0], turn[0])
    if both is not None:
        missing = solve_both_planes(plane, both, Positions(element, hinge, pulley, slip, turn))
    return missing


def state_at_rest(presets: Sequence[Preset], parameters: Parameters) -> ReducedState:
    """Return the state of endoscopes that nothing has pulled yet.

    A section that is curved by itself is built straight, and let go slowly: one increment without viscosity.
    """
    state = new_state(parameters, np.array([preset.sheath_bend for preset in presets]))
    if any(any(preset.initial_bends) for preset in presets):
        constants = parameters.constants.copy()
        constants[:, [at.WIRE_DAMPING, at.HINGE_DAMPING]] = 0.0
        slow, work, still = parameters._replace(constants=constants), Workspace.of(parameters), state.command
        advance(slow, state, work, 0, still[None].copy(), np.ones(1, np.int64), Trace.of(parameters, 0))
        state.time[:] = 0.0
        state.slip[:] = state.turn[:] = 0
    return state
