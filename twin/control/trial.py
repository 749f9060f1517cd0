"""A trial: one controller on one plant along one reference under one noise, sample by sample."""

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.control.controller import ControlKnowledge, Sensed, find_controllers
from twin.errors import InputError
from twin.preset.preset import Preset, at_sample_time, check_sample_time
from twin.preset.sensor import SensorModel
from twin.signals.sensor import samples_late
from twin.simulation import check_physics, simulate


class Plant:
    """One endoscope, stepped from sample to sample along straight lines between commands.

    A run of `twin.simulate` along the same commands is the same, bit for bit.
    """

    def __init__(self, preset: Preset, sample_time: float, physics: str = "mujoco") -> None:
        if preset.bending_planes != 1:
            raise InputError(f"{preset.name!r} has two bending planes: control is of one")
        check_physics(physics)
        preset = at_sample_time(preset, sample_time)
        self.preset, self._sample_time, self._physics = preset, sample_time, physics
        self._periods = check_sample_time(preset, sample_time)
        self.endoscope: Any
        if physics == "reduced":
            from twin.reduced.twins import ReducedEndoscope

            self.endoscope = ReducedEndoscope(preset, sample_time)
            self._periods = 1  # it is in equilibrium only at samples, and computes the path between them
        else:
            from twin.physics import Endoscope

            self.endoscope = Endoscope.from_preset(preset, drawn=False)
        self.pull_mm, self.sheath_bend = preset.command_zero * 1e3, preset.sheath_bend  # the latest

    def start(self, pull_mm: float) -> float:
        """Go from rest to a pull [mm], as the records of `simulate` begin; returns the bend [deg]."""
        self.endoscope.reset()
        self.pull_mm, self.sheath_bend = pull_mm, self.preset.sheath_bend
        at_samples: list[Any] = []
        simulate(
            self.preset,
            np.full(2, pull_mm * 1e-3),  # a record is no shorter
            self._sample_time,
            physics=self._physics,
            endoscope=self.endoscope,
            on_sample=lambda endoscope: at_samples.append(endoscope.save_state()),
        )
        self.endoscope.restore_state(at_samples[0])
        return self.bend_deg()

    def step(self, pull_mm: float, sheath_bend: float | None = None, tip_force: float = 0.0) -> float:
        """Go to the next command [mm] in one sample; returns the bend [deg].

        The sheath bends to another angle meanwhile [rad]; in MuJoCo, a force pushes the tip sideways [N].
        """
        bend = self.sheath_bend if sheath_bend is None else sheath_bend
        if self._physics == "mujoco":
            self.endoscope.push_tip(tip_force)
        elif tip_force:
            raise InputError(f"force of {tip_force:g} N at the tip: needs MuJoCo, not {self._physics!r}")
        before, now = self.pull_mm * 1e-3, pull_mm * 1e-3
        for period in range(1, self._periods):
            share = period / self._periods
            self.endoscope.advance(
                before * (1 - share) + now * share, 0.0, self.sheath_bend * (1 - share) + bend * share
            )
        self.endoscope.advance(now, 0.0, bend)
        self.pull_mm, self.sheath_bend = pull_mm, bend
        return self.bend_deg()

    def bend_deg(self) -> float:
        """Return the bending angle [deg]."""
        return float(np.degrees(self.endoscope.bend()))

    def save_state(self) -> tuple[Any, float, float]:
        """Return the complete state."""
        return self.endoscope.save_state(), self.pull_mm, self.sheath_bend

    def restore_state(self, state: tuple[Any, float, float]) -> None:
        """Restore a state of `save_state`; the run continues bit for bit."""
        endoscope, self.pull_mm, self.sheath_bend = state
        self.endoscope.restore_state(endoscope)


Array = NDArray[np.float64]
HOLD_S = 3.0  # at the start, in which the reference stands still; it is not scored
LATE_S = 20.0  # at the end, in which late errors are measured
HELD_S = 0.5  # for which a reference is constant before it counts as held
RESOLUTION_MM = 0.01  # travel that a motor resolves: 1 mrad of a pulley of 10 mm


@dataclasses.dataclass(frozen=True)
class ControlCase:
    """Plant, reference and noise of a trial."""

    preset: Preset  # the endoscope that is controlled
    reference_deg: Array  # (N,) wanted angle
    noise_deg: Array  # (N,) added to the true angle; NaN where nothing is measured
    sheath_bend: Array = dataclasses.field(default_factory=lambda: np.empty(0))  # (N,) [rad]; or empty
    tip_force: Array = dataclasses.field(default_factory=lambda: np.empty(0))  # (N,) sideways [N]; or empty
    physics: str = "mujoco"


@dataclasses.dataclass(frozen=True)
class ControlTrial:
    """Course of a trial, N samples."""

    reference_deg: Array  # (N,) wanted angle
    pull_mm: Array  # (N,) command
    truth_deg: Array  # (N,) true angle
    measured_deg: Array  # (N,) measured angle
    estimate_deg: Array  # (N,) angle that the controller estimated; NaN where it uses none
    fell_back: NDArray[np.bool_]  # (N,) whether its fallback was in charge
    sample_time: float  # T [s]

    @property
    def scored(self) -> slice:
        """Samples after the hold at the start."""
        return slice(round(HOLD_S / self.sample_time), None)

    @property
    def error_deg(self) -> Array:
        """Errors of the scored samples [deg]."""
        return (self.truth_deg - self.reference_deg)[self.scored]

    @property
    def rmse_deg(self) -> float:
        """Root mean square of the error [deg]."""
        return float(np.sqrt(np.mean(self.error_deg**2)))

    @property
    def late_error_deg(self) -> Array:
        """Errors of the last `LATE_S` [deg]: after all that happens in a condition."""
        return self.error_deg[-round(LATE_S / self.sample_time) :]

    @property
    def travel_mm(self) -> float:
        """Travel of the command in the scored samples [mm]: it wears the sheath."""
        return float(np.abs(np.diff(self.pull_mm[self.scored])).sum())

    @property
    def holding_reversals_per_s(self) -> float:
        """Reversals of the command while the reference is held [1 / s]; NaN where it never is.

        A travel back of less than `RESOLUTION_MM` is none: it is taken out by a play of that width.
        """
        count = max(round(HELD_S / self.sample_time), 1)
        constant = np.diff(self.reference_deg[self.scored]) == 0
        held = np.convolve(constant, np.ones(count))[: len(constant)] == count
        if not held.any():
            return math.nan
        half = RESOLUTION_MM / 2
        played = itertools.accumulate(
            self.pull_mm[self.scored], lambda stands, pull: min(max(stands, pull - half), pull + half)
        )
        moves = np.diff(np.array([*played]))
        moving = np.flatnonzero(moves)
        turned = moving[1:][moves[moving[1:]] * moves[moving[:-1]] < 0]
        return float(held[turned].sum() / (held.sum() * self.sample_time))


def run_trial(controller: str, knowledge: ControlKnowledge, case: ControlCase) -> ControlTrial:
    """Run a controller on a plant."""
    (spec,) = find_controllers([controller])
    driven, T = spec.make(knowledge), knowledge.sample_time
    plant = Plant(case.preset, T, case.physics)
    if spec.oracle:
        driven.observe(plant)
    wanted, count = case.reference_deg, len(case.reference_deg)
    sensor, known = SensorModel.of(case.preset), SensorModel.of(knowledge.preset)
    late, ahead = samples_late(sensor.lag_s, T), round(knowledge.preview_s / T)
    pull, bend, measured, estimate = np.empty((4, count))
    fell_back = np.zeros(count, dtype=bool)
    first = knowledge.limits.nearest(knowledge.line.pull_mm(float(wanted[0])))
    pull[0], bend[0] = first, plant.start(first)
    driven.start(first, float(wanted[0]))
    for k in range(count):
        measured[k] = sensor.scale * bend[max(k - late, 0)] + sensor.zero_deg + case.noise_deg[k]
        following = float(wanted[min(k + 1, count - 1)])
        coming = wanted[k + 1 : k + 1 + ahead]
        angle = known.angle_deg(float(measured[k]))
        command = driven.step(Sensed(k * T, angle, float(wanted[k]), following, coming))
        estimate[k], fell_back[k] = driven.estimate_deg, driven.falls_back
        if k + 1 < count:
            sheath = float(case.sheath_bend[k + 1]) if len(case.sheath_bend) else None
            force = float(case.tip_force[k + 1]) if len(case.tip_force) else 0.0
            pull[k + 1], bend[k + 1] = command, plant.step(command, sheath, force)
    return ControlTrial(wanted, pull, bend, measured, estimate, fell_back, T)
