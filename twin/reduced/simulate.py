"""Simulation by the reduced twin along command signals: presets and arrays in, `Episode`s out."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.mechanics.batch import commands_of
from twin.mechanics.command import Command
from twin.mechanics.hinges import group_of_hinge
from twin.mechanics.record import record_of
from twin.preset.preset import Preset
from twin.reduced.advance import advance_record
from twin.reduced.parameters import Parameters, parameters_of
from twin.reduced.readings import sheath_friction, tension_and_slack
from twin.reduced.state import MISSING_LIMIT_N, ReducedState, new_state, not_converged

Array = NDArray[np.float64]


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
    """Simulate many endoscopes by the reduced twin, each along its own command.

    Args:
        presets: B endoscopes with equal numbers of planes, vertebrae and elements and equal control periods.
        pulls: B commands (N,) of wire a [m]; they may differ in length.
        sample_time: time between two samples [s], of all.
        sheath_bends: B bends of the sheath, (N,) or one angle [rad]; the presets', where None.
        lateral_pulls: B lateral commands (N,) [m].
        threads: number of threads; 0 for one per core. The records are the same bits for any number.
        on_sample: called with the number of samples done, of all records, and their total.

    Returns:
        B records; None in the place of an endoscope that did not converge to equilibrium.

    Raises:
        ValueError: the endoscopes differ in layout, gravity pulls at one, or a command cannot be.
    """
    commands = commands_of(presets, pulls, sample_time, lateral_pulls, sheath_bends)
    parameters = parameters_of(presets)
    state = new_state(parameters, np.array([command.sheath_bend[0] for command in commands]))
    total, done = sum(len(command.pull) for command in commands), 0
    records: list[Episode | None] = []
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        waiting = [pool.submit(_record, parameters, state, m, command) for m, command in enumerate(commands)]
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
) -> Episode:
    """Simulate one endoscope by the reduced twin; see `simulate_batch`.

    Raises:
        ValueError: as there.
        FloatingPointError: it did not converge to equilibrium.
    """
    command = Command.of(preset, pull, sample_time, lateral_pull, sheath_bend)
    parameters = parameters_of([preset])
    state = new_state(parameters, command.sheath_bend[:1])
    record = _record(parameters, state, 0, command)
    if record is None:
        raise not_converged(preset, float(state.missing[0]))
    return record


def _record(parameters: Parameters, state: ReducedState, m: int, command: Command) -> Episode | None:
    """Advance one endoscope along its command, and return the record."""
    inputs, periods = _samples(command)
    before, count = len(inputs) - len(command.pull), len(inputs)
    planes, groups = parameters.hinge_rest.shape[1], len(parameters.size)
    element = np.empty((count, planes, parameters.rest.shape[1] - 2))
    hinge, pulley, drift = np.empty((count, planes, groups)), np.empty((count, planes)), np.empty(count)
    advance_record(parameters, state, m, inputs, periods, element, hinge, pulley, drift)
    if not state.missing[m] <= MISSING_LIMIT_N:
        return None
    kept = (values[before:, None] for values in (element, hinge, pulley, drift))
    return _episode(_only(parameters, m), command, *kept)


def _samples(command: Command) -> tuple[Array, NDArray[np.int64]]:
    """Return inputs (S, 3) at the end of each sample, those of the way to the first too, and periods (S,)."""
    each = command.between.shape[1]
    way = command.before
    first = len(way) % each or min(each, len(way))
    stops = np.arange(first, len(way) + 1, each) if len(way) else np.zeros(0, dtype=int)
    ahead = way[stops - 1]
    periods = np.concatenate([np.diff(stops, prepend=0), np.full(len(command.pull), each)])
    start = np.array([[command.pull[0], command.lateral_pull[0], command.sheath_bend[0]]])
    return np.concatenate([ahead, start, command.between[1:, -1]]), periods.astype(np.int64)


def _only(parameters: Parameters, m: int) -> Parameters:
    """Return the parameters of one endoscope."""
    shared = ("size", "control_period")
    return Parameters(
        **{
            name: values if name in shared else values[m : m + 1]
            for name, values in parameters._asdict().items()
        }
    )


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
