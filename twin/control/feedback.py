"""Linear map and PI on an estimate of the bend: what feedback adds to the line of the nominal twin."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from twin.control.controller import Controller, Sensed
from twin.control.knowledge import ControlKnowledge
from twin.control.limits import CommandLimits
from twin.control.line import Line
from twin.control.registry import Setting

PI_SETTINGS = {
    "proportional_mm_per_deg": Setting(0.02, 0.001, 0.3),
    "integral_mm_per_deg_s": Setting(0.1, 0.005, 20.0),
}
"""Gains of every controller with a PI law: one search for all."""


class LinearFeedback:
    """The line's pull for the next reference, and PI on the error of an estimate.

    While the command is at a limit in its direction, the integral grows by what can be commanded of it and no
    further (anti-windup; Astrom and Hagglund 2006, section 3.5). Were it to stand still, an error that
    adds more in a sample than the limit of speed would stay for good.
    """

    def __init__(
        self, limits: CommandLimits, sample_time: float, line: Line, gains: Mapping[str, float]
    ) -> None:
        """Prepare a run.

        Args:
            limits: of the command.
            sample_time: T [s].
            line: of the nominal endoscope.
            gains: by the names of `PI_SETTINGS`.
        """
        self._limits, self._sample_time, self._line = limits, sample_time, line
        self._proportional = gains["proportional_mm_per_deg"]
        self._integral = gains["integral_mm_per_deg_s"]
        self._sum_mm = 0.0

    def begin(self, pull_mm: float, reference_deg: float, bend_deg: float) -> None:
        """Begin at a command, without a jump: what line and error would add to it is in the integral."""
        error = reference_deg - bend_deg
        of_error = self._proportional * error if math.isfinite(error) else 0.0
        self._sum_mm = pull_mm - self._line.pull_mm(reference_deg) - of_error

    def wanted_mm(self, pull_mm: float, bend_deg: float, reference_deg: float, next_deg: float) -> float:
        """Return the pull that is wanted at the next sample [mm]; NaN where the estimate is none.

        Args:
            pull_mm: command that stands [mm].
            bend_deg: estimate [deg].
            reference_deg: wanted angle now [deg].
            next_deg: wanted angle at the next sample [deg].
        """
        error = reference_deg - bend_deg
        if not math.isfinite(error):
            return math.nan
        of_line = self._line.pull_mm(next_deg) + self._proportional * error
        grown = self._sum_mm + self._integral * self._sample_time * error
        bounded = self._limits.within(of_line + grown, pull_mm, self._sample_time)
        if (of_line + grown - bounded) * error > 0:  # of its growth, what can be commanded
            low, high = sorted((self._sum_mm, grown))
            grown = min(max(bounded - of_line, low), high)
        self._sum_mm = grown
        return of_line + self._sum_mm


class Believed(Protocol):
    """A running estimator: `OnlineEstimator`, or a filter of the measurement alone."""

    bend_deg: float

    def push(self, time_s: float, pull_mm: float, measurement_deg: float) -> Any:
        """Take in a sample; `bend_deg` is the estimate then."""


class EstimateFeedback(Controller):
    """`LinearFeedback` on the estimate of an estimator of its own."""

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
        self.feedback = LinearFeedback(knowledge.limits, knowledge.sample_time, knowledge.line, settings)
        self._make_estimator = make_estimator
        self.estimator: Believed

    def _start(self, reference_deg: float) -> None:
        self.feedback.begin(self.pull_mm, reference_deg, reference_deg)
        self.estimator = self._make_estimator(reference_deg)
        self.bend_deg = reference_deg

    def _wanted_mm(self, sensed: Sensed) -> float:
        self.estimator.push(sensed.time_s, self.pull_mm, sensed.measurement_deg)
        self.bend_deg = self.estimator.bend_deg
        return self.feedback.wanted_mm(self.pull_mm, self.bend_deg, sensed.reference_deg, sensed.next_deg)
