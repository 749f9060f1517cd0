"""Inverses: of the identified model and of the nominal twin as feed-forward, and of weighted members."""

import math
from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from twin.control.compensator import COMPENSATOR_SETTINGS, Compensator
from twin.control.controller import (
    ControlKnowledge,
    Controller,
    ControllerSpec,
    Sensed,
    register_controller,
    tuned,
)
from twin.control.controllers.feedback import ACTIVE_MODEL_PI, PI_SETTINGS
from twin.estimation.registry import Style
from twin.live.assured import REST, AssuredEstimator, prepare_runtime
from twin.preset.sensor import SensorModel
from twin.reduced.members import Following, Members, MemberSet
from twin.signals.sensor import samples_late

CLOSE_MM = 1e-6


class ModelInverse(Controller):
    """The model is driven along with the endoscope; each command is the root of its next step."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self.model = knowledge.model

    def _start(self, reference_deg: float) -> None:
        self._bend, self._before = np.array([reference_deg]), self.pull_mm
        self._memory = self.model.start(np.array([self.pull_mm]))

    def _wanted_mm(self, sensed: Sensed) -> float:
        low, high = self.limits.reach(self.pull_mm, self.sample_time)

        def missing(pull_mm: float) -> float:
            return float(self._after(pull_mm)[0][0]) - sensed.next_deg

        if math.isnan(sensed.next_deg):
            return math.nan
        of_low, of_high = missing(low), missing(high)
        if of_low >= 0 or of_high <= 0:
            return low if of_low >= 0 else high
        return float(brentq(missing, low, high, xtol=CLOSE_MM))

    def _commanded(self) -> None:
        self._bend, self._memory = self._after(self.pull_mm)
        self._before = self.pull_mm

    def _after(self, pull_mm: float) -> tuple[np.ndarray, np.ndarray]:
        return self.model.step(self._bend, self._memory, np.array([pull_mm]), np.array([self._before]))


MODEL_INVERSE = register_controller(
    ControllerSpec(
        "model-inverse",
        1,
        "the identified Coleman-Hodgdon model",
        ModelInverse,
        style=Style("#8c6d31", "dashed"),
    )
)


class TwinInverse(Controller):
    """The nominal twin is driven along with the endoscope; each command brings its next bend."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self._members = Members(MemberSet.still([knowledge.preset]), knowledge.sample_time)
        self._following: Following

    def _start(self, reference_deg: float) -> None:
        self._following = self._members.start(np.array([self.pull_mm]))

    def _wanted_mm(self, sensed: Sensed) -> float:
        within = self.limits.reach(self.pull_mm, self.sample_time)
        return self._members.common_pull_mm(self._following, np.ones(1), sensed.next_deg, within)

    def _commanded(self) -> None:
        self._following = self._members.step(self._following, np.array([self.pull_mm]))


TWIN_INVERSE = register_controller(
    ControllerSpec(
        "twin-inverse", 2, "the nominal reduced twin", TwinInverse, style=Style("#4d7f4d", "dashed")
    )
)


class MembersInverse(Controller):
    """Inverse of the members while they are trusted, else PI on the fallback; held without measurements."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        trained, variance = knowledge.trained("policy"), knowledge.noise_variance
        lag_s = samples_late(knowledge.preset.sensor_latency, self.sample_time) * self.sample_time
        self._make_runtime = prepare_runtime(
            trained,
            noise_variance=variance,
            sample_time=self.sample_time,
            # Zero and scale are corrected before; trials begin at rest.
            sensor=SensorModel(lag_s=lag_s, zero_deviation_deg=0.0),
            start=REST,
        )
        self._gains = tuned(PI_SETTINGS, knowledge.settings.get(ACTIVE_MODEL_PI.name, {}))
        self._settings, self._line = settings, knowledge.line
        self.runtime: AssuredEstimator

    def _start(self, reference_deg: float) -> None:
        self.runtime = self._make_runtime(reference_deg)
        self._compensator = Compensator(self.runtime, self.limits, self._line, self._settings, self._gains)
        self.estimate_deg = reference_deg

    def _wanted_mm(self, sensed: Sensed) -> float:
        self.estimate_deg = self.runtime.push(sensed.time_s, self.pull_mm, sensed.measurement_deg).bend_deg
        wanted = self._compensator.wanted_mm(
            self.pull_mm, sensed.reference_deg, sensed.next_deg, sensed.reference_preview_deg
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
        leads=False,
        falls_back_on=ACTIVE_MODEL_PI.name,
        ours=True,
        style=Style("#a3195b", "solid", 1.6),
    )
)
