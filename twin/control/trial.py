"""A trial: one controller on one plant along one reference under one noise, sample by sample."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.control.controller import Sensed
from twin.control.knowledge import ControlKnowledge
from twin.control.plant import Plant
from twin.control.reference import HOLD_S
from twin.control.registry import find_controllers
from twin.preset.preset import Preset
from twin.signals.sensor import samples_late

Array = NDArray[np.float64]
LATE_S = 20.0


@dataclasses.dataclass(frozen=True)
class ControlCase:
    """Plant, reference and noise of a trial.

    Attributes:
        preset: the endoscope that is controlled.
        reference_deg: (N,) wanted angle [deg].
        noise_deg: (N,) added to the true angle; NaN where nothing is measured [deg].
        sheath_bend: (N,) bend of the sheath during the trial [rad]; empty where it stays.
        tip_force: (N,) that pushes the tip sideways [N]; empty where nothing touches it.
        physics: of the plant.
    """

    preset: Preset
    reference_deg: Array
    noise_deg: Array
    sheath_bend: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    tip_force: Array = dataclasses.field(default_factory=lambda: np.empty(0))
    physics: str = "mujoco"


@dataclasses.dataclass(frozen=True)
class ControlTrial:
    """Course of a trial, N samples.

    Attributes:
        reference_deg: (N,) wanted angle [deg].
        pull_mm: (N,) command [mm].
        bend_deg: (N,) true angle [deg].
        measured_deg: (N,) measured angle [deg].
        estimate_deg: (N,) what the controller believed; NaN where it does not ask [deg].
        fell_back: (N,) whether its fallback was in charge.
        sample_time: T [s].
    """

    reference_deg: Array
    pull_mm: Array
    bend_deg: Array
    measured_deg: Array
    estimate_deg: Array
    fell_back: NDArray[np.bool_]
    sample_time: float

    @property
    def scored(self) -> slice:
        """Samples behind the hold at the start."""
        return slice(round(HOLD_S / self.sample_time), None)

    @property
    def error_deg(self) -> Array:
        """Errors of the scored samples [deg]."""
        return (self.bend_deg - self.reference_deg)[self.scored]

    @property
    def rmse_deg(self) -> float:
        """Root mean square of the error [deg]."""
        return float(np.sqrt(np.mean(self.error_deg**2)))

    @property
    def worst_deg(self) -> float:
        """Largest error [deg]."""
        return float(np.abs(self.error_deg).max())

    @property
    def late_error_deg(self) -> Array:
        """Errors of the last `LATE_S` [deg]: behind all that a condition lets happen on the way."""
        return self.error_deg[-round(LATE_S / self.sample_time) :]

    @property
    def travel_mm(self) -> float:
        """Distance that the command went in the scored samples [mm]: it wears the sheath."""
        return float(np.abs(np.diff(self.pull_mm[self.scored])).sum())


def run_trial(controller: str, knowledge: ControlKnowledge, case: ControlCase) -> ControlTrial:
    """Run a controller on a plant."""
    (spec,) = find_controllers([controller])
    driven, T = spec.make(knowledge), knowledge.sample_time
    plant = Plant(case.preset, T, case.physics)
    if spec.oracle:
        driven.tell(plant)
    wanted, count = case.reference_deg, len(case.reference_deg)
    late = samples_late(case.preset.sensor_latency, T)
    ahead = round(knowledge.preview_s / T)
    pull, bend, measured, estimate = np.empty((4, count))
    fell_back = np.zeros(count, dtype=bool)
    first = knowledge.limits.nearest(knowledge.line.pull_mm(float(wanted[0])))
    pull[0], bend[0] = first, plant.start(first)
    driven.start(first, float(wanted[0]))
    for k in range(count):
        measured[k] = bend[max(k - late, 0)] + case.noise_deg[k]
        following = float(wanted[min(k + 1, count - 1)])
        coming = wanted[k + 1 : k + 1 + ahead]
        command = driven.step(Sensed(k * T, float(measured[k]), float(wanted[k]), following, coming))
        estimate[k], fell_back[k] = driven.bend_deg, driven.falls_back
        if k + 1 < count:
            sheath = float(case.sheath_bend[k + 1]) if len(case.sheath_bend) else None
            force = float(case.tip_force[k + 1]) if len(case.tip_force) else 0.0
            pull[k + 1], bend[k + 1] = command, plant.step(command, sheath, force)
    return ControlTrial(wanted, pull, bend, measured, estimate, fell_back, T)
