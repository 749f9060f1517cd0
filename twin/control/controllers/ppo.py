"""A policy that PPO trained on `EndoTwin/Tracking-v0` (Schulman et al. 2017): it has no model inside."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path

from twin.control.controller import Controller, Sensed
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec, register_controller
from twin.control.tracking_view import OBSERVED, Observation, TrackingView
from twin.errors import InputError
from twin.estimation.learned.trained_file import TrainedFile, check_network, read_trained_file
from twin.estimation.registry import Style
from twin.files.json_text import validated
from twin.files.trained_schema import TrackingFile

AGENT = "tracking"
INPUT, OUTPUT = "observation", "action"
_TRAINER = "`rl.tracking_training`"


@dataclasses.dataclass(frozen=True)
class TrackingPolicy:
    """A trained actor: an observation in, an action out.

    Attributes:
        network: the trained file.
        sample_time: T that it was trained at [s].
        speed_mm_s: speed limit that it was trained with [mm / s].
    """

    network: TrainedFile
    sample_time: float
    speed_mm_s: float

    def __call__(self, observation: Observation) -> float:
        """Return the action for one observation of `TrackingView`."""
        (action,) = self.network.run(**{INPUT: observation[None]})
        return float(action[0, 0])

    def check(self, sample_time: float, speed_mm_s: float) -> None:
        """Refuse a loop of another sample time or speed limit: both are in the scale of every action."""
        for name, given, trained, unit in (
            ("sample time", sample_time, self.sample_time, "s"),
            ("speed limit", speed_mm_s, self.speed_mm_s, "mm/s"),
        ):
            if not math.isclose(given, trained):
                raise InputError(
                    f"{name} = {given:g} {unit}: {self.network.path} was trained with {trained:g} {unit}, "
                    "and runs with no other"
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
    """The actor closes the loop; what it sees and commands is that of its training."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self._policy = load_tracking_policy(knowledge.trained_tracking)
        self._policy.check(knowledge.sample_time, knowledge.limits.speed_mm_s)
        self._view = TrackingView(knowledge.line, knowledge.limits, knowledge.sample_time)
        self._smooth_deg = self._before_mm = self._change_mm = 0.0

    def _start(self, reference_deg: float) -> None:
        self._smooth_deg, self._change_mm = 0.0, 0.0

    def _wanted_mm(self, sensed: Sensed) -> float:
        self._before_mm = self.pull_mm
        error = sensed.measurement_deg - sensed.reference_deg
        if math.isfinite(error):
            self._smooth_deg = self._view.smoothed(self._smooth_deg, error)
        else:  # nothing is measured, which the training never met: what was, without its noise
            error = self._smooth_deg
        now = sensed.reference_deg, sensed.next_deg
        observation = self._view.observation(error, self._smooth_deg, *now, self.pull_mm, self._change_mm)
        return self._view.wanted_mm(self._policy(observation), self.pull_mm, *now)

    def _commanded(self) -> None:
        self._change_mm = self.pull_mm - self._before_mm


def _sample_time_of(path: Path) -> float:
    return load_tracking_policy(path).sample_time


PPO = register_controller(
    ControllerSpec(
        "ppo",
        4.5,
        "the measurement, by a policy that PPO trained",
        TrackingLaw,
        needs="tracking_policy",
        sample_time_of=_sample_time_of,
        style=Style("#2b8c8c", "dashdot", ""),
    )
)
