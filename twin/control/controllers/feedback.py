"""Linear map of the nominal twin, alone and with PI or PID feedback on an estimate or the measurement."""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from twin.control.controller import (
    UNCOMPENSATED,
    CommandLimits,
    ControlKnowledge,
    Controller,
    ControllerSpec,
    Line,
    Sensed,
    Setting,
    register_controller,
)
from twin.estimation.estimator import Sensor
from twin.estimation.learned import ram_twins
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.registry import Style
from twin.live.online import OnlineEstimator

PI_SETTINGS = {
    "proportional_mm_per_deg": Setting(0.02, 0.001, 0.3),
    "integral_mm_per_deg_s": Setting(0.1, 0.005, 20.0),
}
"""Gains of every controller with a PI law: one search for all."""


class LinearFeedback:
    """The line's pull for the next reference, and PI on the error of an estimate.

    While the command is at a limit in its direction, the integral grows by what can be commanded of it and no
    further (anti-windup; Astrom and Hagglund 2006, section 3.5).
    """

    def __init__(
        self, limits: CommandLimits, sample_time: float, line: Line, gains: Mapping[str, float]
    ) -> None:
        """Prepare a run, with gains by the names of `PI_SETTINGS`; T in seconds."""
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
        """Return the pull that is wanted at the next sample [mm]; NaN where there is no estimate."""
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


class BendFilter(Protocol):
    """A running estimator: `OnlineEstimator`, or a filter of the measurement alone."""

    bend_deg: float

    def push(self, time_s: float, pull_mm: float, measurement_deg: float) -> Any:
        """Take in a sample; `bend_deg` is the estimate then."""


class EstimateFeedback(Controller):
    """`LinearFeedback` on the estimate of an estimator of its own."""

    def __init__(
        self,
        knowledge: ControlKnowledge,
        make_estimator: Callable[[float], BendFilter],
        settings: Mapping[str, float],
    ) -> None:
        """Prepare a run; `make_estimator` makes a running estimator from its first estimate [deg]."""
        super().__init__(knowledge.limits, knowledge.sample_time)
        self.feedback = LinearFeedback(knowledge.limits, knowledge.sample_time, knowledge.line, settings)
        self._make_estimator = make_estimator
        self.estimator: BendFilter

    def _start(self, reference_deg: float) -> None:
        self.feedback.begin(self.pull_mm, reference_deg, reference_deg)
        self.estimator = self._make_estimator(reference_deg)
        self.estimate_deg = reference_deg

    def _wanted_mm(self, sensed: Sensed) -> float:
        self.estimator.push(sensed.time_s, self.pull_mm, sensed.measurement_deg)
        self.estimate_deg = self.estimator.bend_deg
        return self.feedback.wanted_mm(self.pull_mm, self.estimate_deg, sensed.reference_deg, sensed.next_deg)


class LinearMap(Controller):
    """The nominal twin's line, without feedback."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self.line = knowledge.line

    def _wanted_mm(self, sensed: Sensed) -> float:
        return self.line.pull_mm(sensed.next_deg)


LINEAR = register_controller(
    ControllerSpec(
        UNCOMPENSATED, 0, "only the line of the nominal twin", LinearMap, style=Style("#9a9a9a", "dotted")
    )
)


class LowPass:
    """First-order low-pass of a measurement whose distance from the last output is clipped."""

    def __init__(self, bend_deg: float, sample_time: float, cutoff_hz: float, clip_deg: float) -> None:
        self.bend_deg, self.rate_deg_s = bend_deg, 0.0  # filtered measurement, its derivative
        self._share = -math.expm1(-2 * math.pi * cutoff_hz * sample_time)
        self._clip_deg, self._sample_time = clip_deg, sample_time

    def push(self, time_s: float, pull_mm: float, measurement_deg: float) -> None:
        """Take in a measurement; one that is missing leaves the output as it is."""
        if not math.isfinite(measurement_deg):
            self.rate_deg_s = 0.0
        else:
            off = min(max(measurement_deg - self.bend_deg, -self._clip_deg), self._clip_deg)
            self.bend_deg += self._share * off
            self.rate_deg_s = self._share * off / self._sample_time


class Pid(EstimateFeedback):
    """PI of `EstimateFeedback`, and a derivative of the filtered measurement."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        given = {name: settings[name] for name in ("cutoff_hz", "clip_deg")}
        low_pass = functools.partial(LowPass, sample_time=knowledge.sample_time, **given)
        super().__init__(knowledge, low_pass, settings)
        self.estimator: LowPass
        self._derivative = settings["derivative_mm_s_per_deg"]

    def _wanted_mm(self, sensed: Sensed) -> float:
        wanted = super()._wanted_mm(sensed)
        moving = (sensed.next_deg - sensed.reference_deg) / self.sample_time
        return wanted + self._derivative * (moving - self.estimator.rate_deg_s)


PID = register_controller(
    ControllerSpec(
        "pid",
        4,
        "the measurement",
        Pid,
        {
            **PI_SETTINGS,
            "derivative_mm_s_per_deg": Setting(0.001, 0.0001, 0.02),
            "cutoff_hz": Setting(2.0, 0.2, 10.0),
            "clip_deg": Setting(3.0, 0.5, 20.0),
        },
        style=Style("#d9822b", "solid"),
    )
)


def active_model_pi(knowledge: ControlKnowledge, settings: Mapping[str, float]) -> EstimateFeedback:
    """Return linear map and PI on the estimate of the tuned active model."""
    make_estimator = functools.partial(OnlineEstimator, knowledge.active_model, knowledge.sample_time)
    return EstimateFeedback(knowledge, make_estimator, settings)


ACTIVE_MODEL_PI = register_controller(
    ControllerSpec(
        "active-model-pi",
        3,
        "estimate of AM-tuned",
        active_model_pi,
        PI_SETTINGS,
        style=Style("#1f5fa8", "solid"),
    )
)


def ram_twins_pi(knowledge: ControlKnowledge, settings: Mapping[str, float]) -> EstimateFeedback:
    """Return linear map and PI on the estimate of RAM (twins), without an inverse."""
    file = read_trained_file(knowledge.trained("policy"), ram_twins.AGENT)
    estimator = ram_twins.load(file).at(knowledge.sample_time)
    estimator = estimator.with_sensor(Sensor(knowledge.noise_variance, 0.0))  # its zero is corrected before
    make_estimator = functools.partial(OnlineEstimator, estimator, knowledge.sample_time)
    return EstimateFeedback(knowledge, make_estimator, settings)


RAM_TWINS_PI = register_controller(
    ControllerSpec(
        "ram-twins-pi",
        5,
        "estimate of RAM (twins)",
        ram_twins_pi,
        PI_SETTINGS,
        needs="policy",
        style=Style("#c77cb0", "dashed"),
    )
)
