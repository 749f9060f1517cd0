"""Linear map and PID on the measurement, clipped and low-passed: control without a model of hysteresis."""

import math
from collections.abc import Mapping

from twin.control.controller import Sensed
from twin.control.feedback import PI_SETTINGS, EstimateFeedback
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec, Setting, register_controller
from twin.estimation.registry import Style


class LowPass:
    """First-order low-pass of a measurement whose distance from the last output is clipped.

    Attributes:
        bend_deg: filtered measurement [deg].
        rate_deg_s: its derivative [deg / s].
    """

    def __init__(self, bend_deg: float, sample_time: float, cutoff_hz: float, clip_deg: float) -> None:
        self.bend_deg, self.rate_deg_s = bend_deg, 0.0
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
        def make_filter(bend_deg: float) -> LowPass:
            return LowPass(bend_deg, knowledge.sample_time, settings["cutoff_hz"], settings["clip_deg"])

        super().__init__(knowledge, make_filter, settings)
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
        style=Style("#d9822b", "solid", ""),
    )
)
