"""Advance of reduced twins in time: the drive, and one increment or more of the endoscope behind it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.compiled import compiled, entry
from twin.mechanics.drive import DriveLaw, advance_drive, delayed_command
from twin.reduced.chain import Array, write_row, write_rows
from twin.reduced.increment import drift_of, increment
from twin.reduced.parameters import Parameters
from twin.reduced.state import ReducedState
from twin.reduced.workspace import Workspace

_advance_drive = compiled(advance_drive)
_delayed_command = compiled(delayed_command)


@entry
def advance(
    parameters: Parameters, state: ReducedState, work: Workspace, inputs: Array, periods: int
) -> None:
    """Advance endoscopes by one sample, in place.

    Args:
        parameters: of M endoscopes.
        state: theirs.
        work: scratch arrays.
        inputs: (M, 3) pull [m], lateral pull [m] and bend of the sheath [rad] at the end of the sample.
        periods: control periods in it.
    """
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


@entry
def keep(parameters: Parameters, state: ReducedState, m: int, trace: Trace, k: int) -> None:
    """Write where an endoscope is into row k of a trace."""
    write_rows(trace.element[k], state.element[m])
    write_rows(trace.hinge[k], state.hinge[m])
    write_row(trace.pulley[k], state.pulley[m])
    trace.drift[k] = drift_of(parameters, state, m)


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
    """Advance one endoscope along a whole record, in place.

    Args:
        parameters: of M endoscopes.
        state: theirs.
        work: scratch arrays.
        m: which one.
        inputs: (S, 3) pull [m], lateral pull [m] and bend of the sheath [rad] at the end of each sample.
        periods: (S,) control periods in each sample.
        trace: of S samples; written.
    """
    for k in range(len(inputs)):
        advance_one(parameters, state, work, m, inputs[k], periods[k])
        keep(parameters, state, m, trace, k)


@compiled
def advance_one(
    parameters: Parameters, state: ReducedState, work: Workspace, m: int, inputs: Array, periods: int
) -> None:
    """Advance one endoscope by one sample, in place; see `advance`."""
    planes = parameters.hinge_rest.shape[1]
    begin, way, ahead = work.begin, work.way, work.ahead
    write_row(begin, state.command[m])
    sticks = parameters.holds[m] > 1.0
    if parameters.rigid[m] and not sticks:
        for p in range(planes):
            state.travel[m] += abs(inputs[p] - state.drive[m, p, 2])
            state.drive[m, p, 0] = inputs[p]
            state.drive[m, p, 2] = inputs[p]
        increment(parameters, state, work, m, periods, inputs[2])
        write_row(state.command[m], inputs)
        return

    # A drive may turn back within a sample: its way until then is an increment of its own. So is every
    # control period of an endoscope that moves in steps, as in the twin in MuJoCo.
    law = _law(parameters, m)
    way[:] = 0.0
    waiting = 0
    for k in range(1, periods + 1):
        share = k / periods
        turns_back = False
        for p in range(planes):
            command = begin[p] * (1.0 - share) + inputs[p] * share
            now, past = state.drive[m, p], state.past[m, p]
            wanted = _delayed_command(law.delay, past, command) - parameters.zero[m, p]
            for late in range(len(past) - 1, -1, -1):
                past[late] = past[late - 1] if late > 0 else command
            ahead[p, 0], ahead[p, 1], ahead[p, 2] = _advance_drive(law, now[0], now[1], now[2], wanted)
            turns_back = turns_back or (ahead[p, 2] - now[2]) * way[p] < 0.0
        if turns_back or (sticks and waiting > 0):
            done = (k - 1) / periods
            bend = begin[2] * (1.0 - done) + inputs[2] * done
            increment(parameters, state, work, m, waiting, bend)
            way[:] = 0.0
            waiting = 0
        waiting += 1
        for p in range(planes):
            step = ahead[p, 2] - state.drive[m, p, 2]
            state.travel[m] += abs(step)
            way[p] += step
            write_row(state.drive[m, p], ahead[p])
    increment(parameters, state, work, m, waiting, inputs[2])
    write_row(state.command[m], inputs)


@compiled
def _law(parameters: Parameters, m: int) -> DriveLaw:
    law = parameters.drive[m]
    return DriveLaw(law[0], law[1], law[2], law[3], law[4], law[5] != 0.0, law[6])
