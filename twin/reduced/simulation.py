"""Simulation by the reduced twin along command signals, and its derivatives with respect to parameters."""

import dataclasses
import functools
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.mechanics.command import Command, commands_of, record_of
from twin.mechanics.friction import group_of_hinge
from twin.preset.preset import Preset, at_sample_time, parameter_limits
from twin.reduced.advance import Trace, Workspace, advance, state_at_rest
from twin.reduced.parameters import (
    MISSING_LIMIT_N,
    Parameters,
    ReducedState,
    not_converged,
    parameters_of,
    sheath_friction,
    tension_and_slack,
)
from twin.reduced.twins import ReducedEndoscope

Array = NDArray[np.float64]

SHARE = 1e-4  # step of a parameter: far above what equilibrium leaves open, far below a loop


def simulate_batch(
    presets: Sequence[Preset],
    pulls: Sequence[Array],
    sample_time: float,
    *,
    sheath_bends: Sequence[Array | float | None] | None = None,
    lateral_pulls: Sequence[Array | None] | None = None,
    threads: int = 0,
    on_sample: Callable[[int, int], None] | None = None,
) -> list[Episode | None]:
    """Simulate many endoscopes by the reduced twin, each along its own command; see `twin.simulate_batch`.

    The records are the same bits for any number of threads.
    """
    presets = [at_sample_time(preset, sample_time) for preset in presets]
    commands = commands_of(presets, pulls, sample_time, lateral_pulls, sheath_bends)
    parameters = parameters_of(presets)
    state = state_at_rest(presets, parameters)
    total, done = sum(len(command.pull) for command in commands), 0
    records: list[Episode | None] = []

    def run(m: int) -> Episode | None:
        """Return the record of one endoscope."""
        _approach(parameters, state, m, commands[m])
        return _record(parameters, state, m, commands[m])

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        waiting = [pool.submit(run, m) for m in range(len(commands))]
        for record in waiting:
            records.append(record.result())
            done += len(commands[len(records) - 1].pull)
            if on_sample is not None:
                on_sample(done, total)
    return records


def simulate(
    preset: Preset,
    pull: Array,
    sample_time: float,
    *,
    lateral_pull: Array | None = None,
    sheath_bend: Array | float | None = None,
    state: ReducedState | None = None,
    endoscope: ReducedEndoscope | None = None,
    on_sample: Callable[[ReducedEndoscope], None] | None = None,
) -> Episode:
    """Simulate one endoscope by the reduced twin along a command signal; see `twin.simulate`."""
    command = Command.of(preset, pull, sample_time, lateral_pull, sheath_bend)
    endoscope = endoscope or ReducedEndoscope.from_preset(preset)
    parameters, own = endoscope.twins.parameters, endoscope.twins.state
    if state is not None:
        endoscope.restore_state(state)
    else:
        _approach(parameters, own, 0, command)
    notify = None if on_sample is None else functools.partial(on_sample, endoscope)
    record = _record(parameters, own, 0, command, notify)
    if record is None:
        raise not_converged(preset, float(own.missing[0]))
    return record


def _approach(parameters: Parameters, state: ReducedState, m: int, command: Command) -> None:
    """Advance one endoscope from rest to the first sample of its command, in steps as long as a sample."""
    each, path = command.between.shape[1], command.before
    stops = np.arange((len(path) - 1) % each + 1, len(path) + 1, each)
    state.command[m, 2] = command.sheath_bend[0]
    inputs, periods = path[stops - 1][:, None], np.diff(stops, prepend=0)
    advance(parameters, state, Workspace.of(parameters), m, inputs, periods, Trace.of(parameters, 0))


def _record(
    parameters: Parameters,
    state: ReducedState,
    m: int,
    command: Command,
    on_sample: Callable[[], None] | None = None,
) -> Episode | None:
    """Advance one endoscope from the first sample of its command along the others; return the record."""
    samples = np.stack([command.pull, command.lateral_pull, command.sheath_bend], axis=1)
    state.command[m] = samples[0]
    periods = np.full(len(samples), command.between.shape[1])
    periods[0] = 0
    trace, work = Trace.of(parameters, len(samples)), Workspace.of(parameters)
    stride = len(samples) if on_sample is None else 1
    for start in range(0, len(samples), stride):
        rows = slice(start, start + stride)
        part = Trace(*(kept[rows] for kept in trace))
        advance(parameters, state, work, m, samples[rows, None], periods[rows], part)
        if on_sample is not None:
            on_sample()
    if not state.missing[m] <= MISSING_LIMIT_N:
        return None
    return _episode(parameters.only(m), command, *(kept[:, None] for kept in trace))


def _episode(
    parameters: Parameters, command: Command, element: Array, hinge: Array, pulley: Array, drift: Array
) -> Episode:
    """Return the record of one endoscope from its positions, each (N, 1, ...)."""
    tension, slack = tension_and_slack(parameters, element, hinge, pulley)
    return record_of(
        command,
        bend=(hinge[:, 0] * parameters.size).sum(axis=2),
        joint_angle=hinge[:, 0][:, :, group_of_hinge(command.preset.vertebrae)],
        wire_tension=tension[:, 0],
        sheath_friction=sheath_friction(parameters, tension, command.sheath_bend[:, None], drift)[:, 0],
        wire_slack=slack[:, 0],
        pulley=pulley[:, 0, 0],
        metadata={"physics": "reduced"},
    )


@dataclasses.dataclass(frozen=True)
class Derivatives:
    """A record and how it changes with the parameters of its endoscope."""

    record: Episode  # at the parameters themselves
    bend: Array  # (N, P) change of the bend with each parameter [rad per unit of the parameter]
    lateral_bend: Array  # (N, P) the same of the second plane; zero with one plane


def derivatives(
    preset: Preset,
    pull: Array,
    sample_time: float,
    names: Sequence[str],
    *,
    lateral_pull: Array | None = None,
    sheath_bend: Array | float | None = None,
    steps: Mapping[str, float] | None = None,
    threads: int = 0,
) -> Derivatives:
    """Return a record and its derivatives with respect to P parameters, by differences of second order.

    They are central, but one-sided where a parameter is at its limit. All records run side by side. A
    parameter is moved by its step, in its unit, or by a ten-thousandth of its value.
    """
    presets, shares = [preset], []
    for name in names:
        given = (steps or {}).get(name)
        moved, weights = _stencil(preset, name, given)
        presets += [preset.replace(**{name: value}) for value in moved]
        shares.append(weights)
    count = len(presets)
    records = simulate_batch(
        presets,
        [pull] * count,
        sample_time,
        lateral_pulls=[lateral_pull] * count,
        sheath_bends=[sheath_bend] * count,
        threads=threads,
    )
    whole = []
    for one, record in zip(presets, records, strict=True):
        if record is None:  # another run gives the error, with the force that is missing
            record = simulate(one, pull, sample_time, lateral_pull=lateral_pull, sheath_bend=sheath_bend)
        whole.append(record)
    bends = np.array([record.bend for record in whole])
    laterals = np.array([record.lateral_bend for record in whole])

    def weighed(of: Array) -> Array:
        """Return the weighed sums (N, P) of records (1 + 2 P, N): the first, and two for each parameter."""
        columns = [w[0] * of[0] + w[1] * of[2 * k + 1] + w[2] * of[2 * k + 2] for k, w in enumerate(shares)]
        return np.stack(columns, axis=1)

    return Derivatives(whole[0], weighed(bends), weighed(laterals if laterals.size else 0 * bends))


def _stencil(preset: Preset, name: str, step: float | None) -> tuple[list[float], Array]:
    """Return two values of a parameter next to its own, and the weights (3,) of the records at all three."""
    low, high = parameter_limits(name)
    if isinstance(getattr(preset, name), int):
        raise InputError(f"{name} is a whole number: it has no derivative")
    value = float(getattr(preset, name))
    if step is None:
        step = SHARE * abs(value)
    if not (step > 0 and np.isfinite(step)):
        raise InputError(f"{name} = {value:g} has a step of {step:g}: give a positive one in its unit")
    if low <= value - step and value + step <= high:
        return [value + step, value - step], np.array([0.0, 0.5, -0.5]) / step
    side = step if value + 2 * step <= high else -step
    if not low <= value + 2 * side <= high:
        raise InputError(
            f"{name} = {value:g} cannot take steps of {step:g}: its limits are {low:g} to {high:g}"
        )
    return [value + side, value + 2 * side], np.array([-1.5, 2.0, -0.5]) / side
