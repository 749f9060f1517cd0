"""Inverse of RAM (twins)' weighted members (`twin/control/compensator.py`), watched by the monitor."""

from collections.abc import Mapping

from twin.control.compensator import COMPENSATOR_SETTINGS, Compensator
from twin.control.controller import Controller, Sensed
from twin.control.controllers.active_model_pi import ACTIVE_MODEL_PI
from twin.control.feedback import PI_SETTINGS
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec, register_controller, tuned
from twin.estimation.registry import Style
from twin.live.assured import AssuredEstimator, prepare_runtime


class MembersInverse(Controller):
    """Inverse of the weighted members while they are trusted, else PI on the fallback; held while blind."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self._make_runtime = prepare_runtime(
            knowledge.trained, noise_variance=knowledge.noise_variance, sample_time=knowledge.sample_time
        )
        self._gains = tuned(PI_SETTINGS, knowledge.settings.get(ACTIVE_MODEL_PI.name, {}))
        self._settings, self._line = settings, knowledge.line
        self.runtime: AssuredEstimator

    def _start(self, reference_deg: float) -> None:
        self.runtime = self._make_runtime(reference_deg)
        self._compensator = Compensator(self.runtime, self.limits, self._line, self._settings, self._gains)
        self.bend_deg = reference_deg

    def _wanted_mm(self, sensed: Sensed) -> float:
        self.bend_deg = self.runtime.push(sensed.time_s, self.pull_mm, sensed.measurement_deg).bend_deg
        wanted = self._compensator.wanted_mm(
            self.pull_mm, sensed.reference_deg, sensed.next_deg, sensed.coming_deg
        )
        self.falls_back, self.holds = self._compensator.falls_back, self._compensator.holds
        return wanted


MEMBERS_INVERSE = register_controller(
    ControllerSpec(
        "members-inverse",
        6,
        "members and estimate of RAM (twins)",
        MembersInverse,
        COMPENSATOR_SETTINGS,
        needs="policy",
        falls_back_on=ACTIVE_MODEL_PI.name,
        ours=True,
        style=Style("#a3195b", "solid", "", 1.6),
    )
)
