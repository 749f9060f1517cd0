"""Batch simulation of endoscopes of one layout on all cores: presets and commands in, `Episode`s out.

The physics is that of `simulate`, bit for bit; `mujoco.batch` steps the endoscopes on a pool of threads, and
what follows the load is computed for all of them together.
"""

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS, Batch
from numpy.typing import NDArray

from twin.episode import Episode
from twin.mechanics.command import ALIKE, check_alike, commands_of
from twin.mechanics.drive import Drive
from twin.physics.division import STEPPED, Division, write_time_step
from twin.physics.endoscope import release_shares
from twin.physics.layout import Index, Layout
from twin.physics.load import REWRITTEN, Loads, views
from twin.physics.model import compiled_model, model_xml
from twin.physics.simulation import Recorder
from twin.preset.preset import Preset, at_sample_time

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
    """Simulate many endoscopes at once, each along its own command; see `twin.simulate_batch`."""
    presets = [at_sample_time(preset, sample_time) for preset in presets]
    commands = commands_of(presets, pulls, sample_time, lateral_pulls, sheath_bends)
    endoscopes = EndoscopeBatch(presets, threads)
    records = [Recorder(command, endoscopes.layout) for command in commands]

    # Commands of different lengths end together, so that the samples of all are due at the same periods.
    periods = commands[0].between.shape[1]
    tracks = [np.concatenate([command.before, command.between[1:].reshape(-1, 3)]) for command in commands]
    longest = max(map(len, tracks))
    start = longest - np.array([len(track) for track in tracks])
    first_sample = longest - np.array([(len(command.pull) - 1) * periods for command in commands])
    inputs = np.zeros((longest, len(commands), 3))
    for index, track in enumerate(tracks):
        inputs[start[index] :, index] = track
    for done in range(longest + 1):
        if done > 0:
            endoscopes.advance(inputs[done - 1], start < done)
        if (longest - done) % periods == 0:
            friction = endoscopes.sheath_friction()
            for index in np.flatnonzero(first_sample <= done).tolist():
                sample = int(done - first_sample[index]) // periods
                records[index].add(sample, endoscopes.qpos[index], friction[index])
            if on_sample is not None:
                on_sample(done // periods, longest // periods)
    return [
        None if failed else record.episode(xml)
        for record, xml, failed in zip(records, endoscopes.xml, endoscopes.failed, strict=True)
    ]


class EndoscopeBatch:
    """Batch of B simulated endoscopes that are stepped together."""

    def __init__(self, presets: Sequence[Preset], threads: int = 0) -> None:
        check_alike(presets, (*ALIKE, "time_step"))
        self.presets = list(presets)
        built = {preset: model_xml(preset) for preset in set(presets)}
        compiled = {preset: compiled_model(xml, drawn=False) for preset, xml in built.items()}
        self.xml = [built[preset] for preset in presets]
        models = [compiled[preset] for preset in presets]
        self.layout = Layout.of(models[0], presets[0])
        self._batch = Batch(models[0], len(presets), threads)
        for name in _fields_that_differ(models):
            self._batch.expand(name)[:] = [_field(model, name) for model in models]
        rewritten = views(self.layout, [self._batch.expand(name) for name in REWRITTEN])
        self.qpos: Array = self._batch.bind("qpos")
        self._loads = Loads(presets, self.layout, rewritten, self.qpos, self._batch.bind("qvel"))
        self._constraint = (
            self._batch.bind("qfrc_constraint") if self._loads.needs_constraint_feedback else np.empty(0)
        )
        self._time, self._act = self._batch.bind("time"), self._batch.bind("act")
        self._ctrl = self._batch.bind("ctrl")
        self._drives = [[Drive(preset, zero) for zero in preset.command_zeros] for preset in presets]
        self._rigid = all(drive.rigid for drives in self._drives for drive in drives)
        self._travel = np.zeros(len(presets))
        self._divisions = [Division(preset) for preset in presets]
        self._parts, self._steps = np.zeros((2, len(presets)), dtype=int)
        self._time_step, *stepped = (self._batch.expand(name) for name in ("opt.timestep", *STEPPED))
        self._stepped = list(zip(*stepped, strict=True))  # of each endoscope
        self.failed = np.zeros(len(presets), dtype=bool)  # (B,) whether it has diverged; it then stands still
        self._warning = self._batch.warning.reshape(len(presets), -1)
        everyone = np.arange(len(presets))
        self._divide(everyone)
        self._follow_load(np.array([preset.sheath_bend for preset in presets]), everyone)
        self._let_go(models)

    def sheath_friction(self) -> Array:
        """Return the breakaway friction force of each sheath element [N], (B, wires, elements)."""
        return self._loads.rewritten.sheath.copy()

    def advance(self, inputs: Array, active: NDArray[np.bool_]) -> None:
        """Advance the active (B,) endoscopes by one control period, as `Endoscope.advance`; the others rest.

        `inputs` (B, 3) are pull, lateral pull and bend of the sheath.
        """
        moving = np.flatnonzero(active & ~self.failed)
        strides = np.zeros((len(self.presets), len(self.layout.pulley)))
        for plane in range(strides.shape[1]):
            target = inputs[:, plane]
            if not self._rigid:
                target, commands = self._act[:, plane].copy(), inputs[:, plane].tolist()
                for index in moving.tolist():
                    target[index] = self._drives[index][plane].advance(commands[index])
            strides[moving, plane] = target[moving] - self._act[moving, plane]
            speed = strides[:, plane, None] / self.presets[0].control_period
            self._ctrl[:, 2 * plane : 2 * plane + 2] = speed
        of_each = strides.tolist()
        for index in moving.tolist():
            self._divisions[index].advance(of_each[index])
        self._divide(moving)
        for parts in np.unique(self._parts[moving]).tolist():
            together = moving[self._parts[moving] == parts]
            ids = None if len(together) == len(self.presets) else together
            travel = np.abs(strides[together]).sum(axis=1) / parts
            for _ in range(parts):
                self._follow_load(inputs[:, 2], together)
                self._travel[together] += travel
                self._batch.step(ids=ids, nstep=self._steps[together[0]])
                if self._loads.needs_constraint_feedback:
                    self._loads.observe_constraints(self._constraint, together)
        self.failed |= self._warning.any(axis=1)

    def _divide(self, moving: Index) -> None:
        """Set the time steps of some endoscopes to the parts of their control periods."""
        for index in moving.tolist():
            division = self._divisions[index]
            if self._parts[index] == division.parts:
                continue
            self._parts[index] = division.parts
            self._steps[index], time_step = division.steps()
            self._time_step[index] = time_step
            write_time_step(self.presets[index], self.layout, self._stepped[index], time_step)
            self._loads.divide(index, self._steps[index] * time_step, time_step)

    def _let_go(self, models: Sequence[mujoco.MjModel]) -> None:
        curved = np.array([any(preset.initial_bends) for preset in self.presets])
        if not curved.any():
            return
        inputs = np.zeros((len(self.presets), 3))
        for index, preset in enumerate(self.presets):
            inputs[index, : preset.bending_planes] = preset.command_zeros
            inputs[index, 2] = preset.sheath_bend
        hinge = self.layout.hinge
        curve = np.array([model.qpos_spring[hinge] for model in models])
        spring = self._batch.expand("qpos_spring")
        for share in release_shares(self.presets[0]):
            spring[:, hinge] = share * curve
            self.advance(inputs, curved)
        self._time[curved] = 0.0
        self._loads.reset()

    def _follow_load(self, sheath_bend: Array, moving: Index) -> None:
        drift = self._loads.drift(self._time, self._travel) if self._loads.drifts else None
        self._loads.follow(sheath_bend, drift, moving)


def _fields_that_differ(models: Sequence[mujoco.MjModel]) -> list[str]:
    first, others = models[0], {id(model): model for model in models[1:]}.values()
    return [
        name
        for name in sorted(MODEL_FIELDS)
        if any(not np.array_equal(_field(model, name), _field(first, name)) for model in others)
    ]


def _field(model: mujoco.MjModel, name: str) -> Array:
    field: Array = getattr(model.opt, name[4:]) if name.startswith("opt.") else getattr(model, name)
    return field
