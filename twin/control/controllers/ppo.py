"""A policy that PPO trained on `EndoTwin/Tracking-v0` (Schulman et al. 2017): it has no model inside."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.control.controller import (
    CommandLimits,
    ControlKnowledge,
    Controller,
    ControllerSpec,
    Line,
    Sensed,
    register_controller,
)
from twin.errors import InputError
from twin.estimation.learned.trained_file import TrainedFile, check_network, read_trained_file
from twin.estimation.registry import Style
from twin.files.json_text import validated
from twin.files.trained_schema import TrackingFile

Observation = NDArray[np.float32]

ERROR_DEG, RATE_DEG_S, OFFSET_MM = 5.0, 10.0, 0.5
"""Error [deg], rate of the reference [deg / s] and offset [mm] that are 1 in an observation."""
SMOOTHING_S = 0.2  # time constant of the low-passed error: it averages noise over tens of samples
OBSERVED = 6  # numbers of an observation
OBSERVATION_LIMIT = 10.0  # never reached on a sound endoscope, it only bounds the space


@dataclasses.dataclass(frozen=True)
class TrackingView:
    """Scales of observation and action, of the nominal endoscope on one stroke.

    An observation is six numbers, of about unit size:

    0. measured angle less reference [`ERROR_DEG`];
    1. the same, low-passed with `SMOOTHING_S`;
    2. reference, from the middle of what the nominal endoscope reaches [half of that];
    3. rate of the reference towards the next sample [`RATE_DEG_S`];
    4. offset: command less the line's pull for the reference [`OFFSET_MM`];
    5. latest change of the command [speed limit times T].
    """

    line: Line  # of the nominal endoscope on the stroke
    limits: CommandLimits  # of the command
    sample_time: float  # T [s]

    @property
    def way_mm(self) -> float:
        """Farthest travel of the command in one sample [mm]."""
        return self.limits.speed_mm_s * self.sample_time

    def smoothed(self, smooth_deg: float, error_deg: float) -> float:
        """Return the low-passed error one sample after `smooth_deg`, with a measured error [deg]."""
        share = 1 - np.exp(-self.sample_time / SMOOTHING_S)
        return smooth_deg + float(share) * (error_deg - smooth_deg)

    def observation(
        self,
        error_deg: float,
        smooth_deg: float,
        reference_deg: float,
        next_deg: float,
        pull_mm: float,
        change_mm: float,
    ) -> Observation:
        """Return what a policy sees at a sample, (6,), from angles [deg] and the command [mm]."""
        low, high = self.line.reached_deg
        seen = [
            error_deg / ERROR_DEG,
            smooth_deg / ERROR_DEG,
            (reference_deg - (low + high) / 2) / ((high - low) / 2),
            (next_deg - reference_deg) / self.sample_time / RATE_DEG_S,
            self._offset_mm(pull_mm, reference_deg) / OFFSET_MM,
            change_mm / self.way_mm,
        ]
        return np.clip(seen, -OBSERVATION_LIMIT, OBSERVATION_LIMIT).astype(np.float32)

    def wanted_mm(self, action: float, pull_mm: float, reference_deg: float, next_deg: float) -> float:
        """Return the pull that an action asks for at the next sample, not bounded yet [mm].

        The action is the change of the offset [speed limit times T], clipped to [-1, 1].
        """
        share = min(max(action, -1.0), 1.0)
        # The offset follows from the command, so that it does not wind up at a limit.
        return self.line.pull_mm(next_deg) + self._offset_mm(pull_mm, reference_deg) + share * self.way_mm

    def _offset_mm(self, pull_mm: float, reference_deg: float) -> float:
        return pull_mm - self.line.pull_mm(reference_deg)


AGENT = "tracking"
INPUT, OUTPUT = "observation", "action"
_TRAINER = "`rl.tracking_training`"


@dataclasses.dataclass(frozen=True)
class TrackingPolicy:
    """A trained actor: an observation in, an action out."""

    network: TrainedFile  # the trained file
    sample_time: float  # T that it was trained at [s]
    speed_mm_s: float  # speed limit that it was trained with [mm / s]

    def __call__(self, observation: Observation) -> float:
        """Return the action for one observation of `TrackingView`."""
        (action,) = self.network.run(**{INPUT: observation[None]})
        return float(action[0, 0])

    def check(self, sample_time: float, speed_mm_s: float) -> None:
        """Refuse a loop of another sample time or speed limit: both are in the scale of every action."""
        if not np.allclose((sample_time, speed_mm_s), (self.sample_time, self.speed_mm_s), 1e-9, 0):
            raise InputError(
                f"sample time = {sample_time:g} s, speed limit = {speed_mm_s:g} mm/s: {self.network.path} "
                f"was trained with {self.sample_time:g} s and {self.speed_mm_s:g} mm/s: it runs with no other"
            )


def load_tracking_policy(path: Path) -> TrackingPolicy:
    """Read a trained policy."""
    network = read_trained_file(path, AGENT, _TRAINER)
    try:
        said = validated(TrackingFile, network.description)
        check_network(network, {INPUT: (2, OBSERVED)}, {OUTPUT: (2, 1)})
    except ValueError as error:
        raise InputError(f"{path} is not a policy written by {_TRAINER}: {error}") from error
    return TrackingPolicy(network, said.sample_time, said.speed_mm_s)


class TrackingLaw(Controller):
    """The actor closes the loop, with the observations and actions of its training."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self._policy = load_tracking_policy(knowledge.trained("tracking_policy"))
        self._policy.check(knowledge.sample_time, knowledge.limits.speed_mm_s)
        self._view = TrackingView(knowledge.line, knowledge.limits, knowledge.sample_time)
        self._smooth_deg = self._before_mm = self._change_mm = 0.0

    def _start(self, reference_deg: float) -> None:
        self._smooth_deg = self._change_mm = 0.0

    def _wanted_mm(self, sensed: Sensed) -> float:
        self._before_mm = self.pull_mm
        error = sensed.measurement_deg - sensed.reference_deg
        if math.isfinite(error):
            self._smooth_deg = self._view.smoothed(self._smooth_deg, error)
        else:  # no measurement, which is in no training: the low-passed error
            error = self._smooth_deg
        now = sensed.reference_deg, sensed.next_deg
        observation = self._view.observation(error, self._smooth_deg, *now, self.pull_mm, self._change_mm)
        return self._view.wanted_mm(self._policy(observation), self.pull_mm, *now)

    def _commanded(self) -> None:
        self._change_mm = self.pull_mm - self._before_mm


PPO = register_controller(
    ControllerSpec(
        "ppo",
        4.5,
        "the measurement, by a policy that PPO trained",
        TrackingLaw,
        needs="tracking_policy",
        sample_time_of=lambda path: load_tracking_policy(path).sample_time,
        style=Style("#2b8c8c", "dashdot"),
    )
)
