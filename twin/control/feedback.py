"""Linear map and PI on an estimate of the bend: what feedback adds to the line of the nominal twin."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from twin.control.controller import Controller, Sensed
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import Setting

PI_SETTINGS = {
    "proportional_mm_per_deg": Setting(0.02, 0.001, 0.3),
    "integral_mm_per_deg_s": Setting(0.1, 0.005, 3.0),
}
"""Gains of every controller with a PI law: one search for all."""


class Believed(Protocol):
    """A running estimator: `OnlineEstimator`, or a filter of the measurement alone."""

    bend_deg: float

    def push(self, time_s: float, pull_mm: float, measurement_deg: float) -> Any:
        """Take in a sample; `bend_deg` is the estimate then."""


class EstimateFeedback(Controller):
    """The line's pull for the next reference, and PI on the error of an estimate.

    The integral stands still while the command is at a limit in its direction (anti-windup by clamping;
    Astrom and Hagglund 2006, section 3.5).
    """

    def __init__(
        self,
        knowledge: ControlKnowledge,
        make_estimator: Callable[[float], Believed],
        settings: Mapping[str, float],
    ) -> None:
        """Prepare a run.

        Args:
            knowledge: before it.
            make_estimator: makes a running estimator from its first estimate [deg].
            settings: gains, by the names of `PI_SETTINGS`.
        """
        super().__init__(knowledge.limits, knowledge.sample_time)
        self.line = knowledge.line
        self._make_estimator = make_estimator
        self.estimator: Believed
        self._proportional = settings["proportional_mm_per_deg"]
        self._integral = settings["integral_mm_per_deg_s"]
        self._sum_mm = 0.0

    def _start(self, reference_deg: float) -> None:
        # Without a jump: what the line would command less what is commanded is in the integral.
        self._sum_mm = self.pull_mm - self.line.pull_mm(reference_deg)
        self.estimator = self._make_estimator(reference_deg)
        self.bend_deg = reference_deg

    def _wanted_mm(self, sensed: Sensed) -> float:
        self.estimator.push(sensed.time_s, self.pull_mm, sensed.measurement_deg)
        self.bend_deg = self.estimator.bend_deg
        error = sensed.reference_deg - self.bend_deg
        if not math.isfinite(error):
            return math.nan
        of_line = self.line.pull_mm(sensed.next_deg) + self._proportional * error
        grown = self._sum_mm + self._integral * self.sample_time * error
        bounded = self.limits.within(of_line + grown, self.pull_mm, self.sample_time)
        if (of_line + grown - bounded) * error <= 0:
            self._sum_mm = grown
        return of_line + self._sum_mm
