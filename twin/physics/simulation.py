"""Simulation of endoscopes along command signals: arrays in, an `Episode` for each out."""

import dataclasses
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import DivergedError
from twin.mechanics.command import ALIKE, Command, check_alike, commands_of, record_of
from twin.physics.endoscope import Endoscope
from twin.physics.model import model_xml
from twin.physics.stepping import State, Stepper
from twin.preset.preset import Preset, at_sample_time

Array = NDArray[np.float64]

MUJOCO = mujoco.__version__  # version of MuJoCo that simulates


def simulate(
    preset: Preset,
    pull: Array,
    sample_time: float,
    *,
    lateral_pull: Array | None = None,
    sheath_bend: Array | float | None = None,
    state: State | None = None,
    endoscope: Endoscope | None = None,
    on_sample: Callable[[Endoscope], None] | None = None,
) -> Episode:
    """Simulate an endoscope along a command signal; see `twin.simulate`."""
    command = Command.of(preset, pull, sample_time, lateral_pull, sheath_bend)
    if endoscope is None and on_sample is not None:
        endoscope = Endoscope.from_preset(preset)
    stepper = Stepper.of(preset) if endoscope is None else endoscope.stepper
    if state is not None:
        stepper.restore_state(state)
    if endoscope is None or on_sample is None:
        return _episode(stepper, command, approach=state is None)
    notify = on_sample
    return _episode(stepper, command, approach=state is None, on_sample=lambda: notify(endoscope))


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
    """Simulate many endoscopes at once, each along its own command; see `twin.simulate_batch`.

    The records are those of `simulate`, bit for bit, for any number of threads.
    """
    presets = [at_sample_time(preset, sample_time) for preset in presets]
    commands = commands_of(presets, pulls, sample_time, lateral_pulls, sheath_bends)
    check_alike(presets, (*ALIKE, "time_step"))
    total, records = sum(len(command.pull) for command in commands), []

    def run(command: Command) -> Episode | None:
        try:
            return _episode(Stepper.of(command.preset), command)
        except DivergedError:
            return None

    done = 0
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        for command, record in zip(commands, pool.map(run, commands), strict=True):
            records.append(record)
            done += len(command.pull)
            if on_sample is not None:
                on_sample(done, total)
    return records


def _episode(
    stepper: Stepper, command: Command, *, approach: bool = True, on_sample: Callable[[], None] | None = None
) -> Episode:
    """Drive an endoscope along a command, from rest to its first sample if it is to approach that."""
    layout, samples = stepper.layout, len(command.pull)
    qpos, friction = np.empty((samples, len(stepper.motion.qpos))), np.empty((samples, *layout.element.shape))
    if approach:
        stepper.advance(command.before)
    qpos[0], friction[0] = stepper.motion.qpos, stepper.motion.forces.sheath
    if on_sample is not None:
        on_sample()
    stride = 1 if on_sample is not None else max(samples - 1, 1)
    for first in range(1, samples, stride):
        rows = slice(first, first + stride)
        stepper.advance(command.between[rows].reshape(-1, 3), (qpos[rows], friction[rows]))
        if on_sample is not None:
            on_sample()

    # Contiguous, so that sums round as `Endoscope.bend` does.
    joint_angle = np.ascontiguousarray(qpos[:, layout.hinge])
    tension, slack = stepper.wires.tension_and_slack(qpos)
    record = record_of(
        command,
        bend=joint_angle.sum(axis=2),
        joint_angle=joint_angle,
        wire_tension=tension,
        sheath_friction=friction,
        wire_slack=slack,
        pulley=qpos[:, layout.pulley[0]],
        metadata={"mujoco": MUJOCO},
    )
    return dataclasses.replace(record, attachments={"endoscope.xml": model_xml(stepper.preset).encode()})
