"""Hysteresis compensation with a running estimator: its members are inverted while it is trusted.

RAM (twins) predicts by twins that follow the command. The command of the next sample is the pull u with

    sum_m w_m [theta_m(u) - theta_m] = r_next - r + share (r - estimate),      share = 1 - exp(-rate T),

where w are the weights that the filter gives the members now, r the reference. Asking for all of the
estimated error would follow the noise of the estimate. For the same reason the command only turns round,
across the dead band of a reversal, where the reference does, or for an error of more than a share of the 95 %
interval.

Where the reference is known ahead, the same members predict which travels of the command would take too long,
and these begin early (`twin/control/anticipation.py`).

While the runtime does not trust RAM (twins), a linear map and PI on the fallback's estimate take over,
without a jump. While measurements are missing or stuck, the command is held.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.control.anticipation import Anticipation, Array
from twin.control.controller import LEAD, NO_PREVIEW, CommandLimits, Line, Sensed, Setting, fit_line, tuned
from twin.control.controllers.feedback import PI_SETTINGS, LinearFeedback
from twin.errors import InputError
from twin.estimation.deployment import deployment_of
from twin.estimation.learned.ram_twins import MemberWeights, RamTwins
from twin.estimation.learned.step import StepState
from twin.estimation.learned.trained_file import read_trained_file
from twin.live.assured import AssuredEstimator
from twin.live.reading import WRONG_SENSOR, Alarm, Health, Source
from twin.preset.file import preset_of

COMPENSATOR_SETTINGS = {"rate_per_s": Setting(20.0, 2.0, 100.0), "turning_share": Setting(1.5, 0.3, 3.0)}
"""Rate at which the estimated error is removed [1 / s], and error from which on the command turns round, in
halves of the estimate's 95 % interval [-]."""
_SILENT = Alarm.TIMEOUT | WRONG_SENSOR


class Compensator:
    """Commands of one endoscope, on the estimate of a running estimator."""

    def __init__(
        self,
        runtime: AssuredEstimator,
        limits: CommandLimits,
        line: Line,
        settings: Mapping[str, float],
        gains: Mapping[str, float],
    ) -> None:
        advanced = runtime.advanced.estimator
        if not isinstance(advanced, RamTwins):
            raise InputError(f"{runtime.method} has no twins to invert: commands are made on RAM (twins)")
        self._runtime, self._limits = runtime, limits
        self._members, self._weights = advanced.members, MemberWeights(advanced)
        self._share = -math.expm1(-settings["rate_per_s"] * runtime.sample_time)
        self._turning_share = settings["turning_share"]
        self._feedback = LinearFeedback(limits, runtime.sample_time, line, gains)
        self._lead = round(gains.get(LEAD, 0.0) / runtime.sample_time)
        self._anticipation = Anticipation(limits, runtime.sample_time)
        self._direction = 0.0  # of the latest command
        self.falls_back = False  # whether PI on the fallback's estimate is in charge
        self.holds = False  # whether the command is held, as no measurement comes that can be used

    def wanted_mm(
        self, pull_mm: float, reference_deg: float, next_deg: float, reference_preview_deg: Array = NO_PREVIEW
    ) -> float:
        """Return the pull that is wanted at the next sample [mm], within stroke and speed.

        Arguments are the command that stands, the wanted angles now, at the next sample and, where they are
        known ahead, from there on (H,).
        """
        runtime = self._runtime
        reading, state = runtime.reading, runtime.present
        went_on = self.falls_back and not self.holds
        self.falls_back, self.holds = reading.source is not Source.ADVANCED, bool(reading.alarms & _SILENT)
        if self.holds:
            return pull_mm
        if not self.falls_back and isinstance(state, StepState):
            weights = self._weights.of(state)
            now = float(weights @ state.following.of_filters()[0])

            def along(pulls_mm: Array, samples: NDArray[np.int64]) -> Array:
                moved: Array = self._members.bends_along(state.following, pulls_mm, samples) @ weights - now
                return moved

            bend, low, high = reading[:3]
            ahead = self._anticipation.wanted_mm(pull_mm, bend, reference_deg, reference_preview_deg, along)
            if not math.isnan(ahead):
                self._direction = ahead - pull_mm or self._direction
                return ahead
            of_reference = next_deg - reference_deg
            moved = of_reference + self._share * (reference_deg - bend)
            small = abs(next_deg - bend) < self._turning_share * (high - low) / 2
            if small and moved * self._direction < 0 <= of_reference * self._direction:
                return pull_mm
            self._direction = moved
            within = self._limits.reach(pull_mm, runtime.sample_time)
            return self._members.common_pull_mm(state.following, weights, now + moved, within)
        self.falls_back, self._direction = True, 0.0
        self._anticipation.forget()
        sensed = Sensed(math.nan, math.nan, reference_deg, next_deg, reference_preview_deg).ahead(self._lead)
        if not went_on:
            self._feedback.begin(pull_mm, sensed.reference_deg, reading.bend_deg)
        return self._feedback.wanted_mm(pull_mm, reading.bend_deg, sensed.reference_deg, sensed.next_deg)


_IGNORED = Health.NO_TIME | Health.LATE | Health.CLOCK_JUMP


class LiveCommands:
    """Commands of one endoscope, for a motor driver that reports its command in each sample.

    A sample without a pull counts as one at the latest command; one without a reference keeps the latest. One
    that the runtime ignores, as it is late or has no valid time, is answered by the latest command. While the
    sensor is missing (TIMEOUT) or wrong (STUCK, SIGN, GAIN, DRIFT, BIAS), the present command is held.
    """

    def __init__(self, runtime: AssuredEstimator, compensator: Compensator, limits: CommandLimits) -> None:
        self.limits = limits
        self.command_mm = math.nan  # latest command; NaN before the first
        self._runtime, self._compensator = runtime, compensator
        self._reference_deg = math.nan

    @property
    def falls_back(self) -> bool:
        """True while the fallback's law is in charge."""
        return self._compensator.falls_back

    @property
    def holds(self) -> bool:
        """True while the command is held, as no measurement comes."""
        return self._compensator.holds

    def after(
        self, pull_mm: float, reference_deg: float, reference_preview_deg: Sequence[float] = ()
    ) -> float:
        """Return the pull to command at the next sample [mm]; NaN before the first pull and reference.

        Arguments are the command that stands at the runtime's latest sample, the wanted angle at the next
        one, NaN if unknown, and wanted angles after that, as far as they are known.
        """
        if self._runtime.reading.health & _IGNORED:
            return self.command_mm
        stands = self.command_mm if math.isnan(pull_mm) else pull_mm
        now = self._reference_deg
        if not math.isnan(reference_deg):
            self._reference_deg = reference_deg
        if math.isnan(stands) or math.isnan(self._reference_deg):
            return self.command_mm
        preview = NO_PREVIEW
        if len(reference_preview_deg):
            preview = np.array([self._reference_deg, *reference_preview_deg])
        now = self._reference_deg if math.isnan(now) else now
        wanted = self._compensator.wanted_mm(stands, now, self._reference_deg, preview)
        self.command_mm = self.limits.within(wanted, stands, self._runtime.sample_time)
        return self.command_mm


def prepare_commands(
    path: Path,
    runtime: AssuredEstimator,
    stroke_mm: tuple[float, float],
    speed_mm_s: float | None = None,
    rate_per_s: float = COMPENSATOR_SETTINGS["rate_per_s"].default,
) -> LiveCommands:
    """Return the commands on the estimate of a runtime, which takes in each sample before `after` is called.

    `path` is its trained file, of RAM (twins). By default the fastest change is that of the training, or of
    the preset's servo where it is slower; the estimated error is removed at `rate_per_s`.
    """
    if not 0 < rate_per_s < math.inf:
        raise InputError(f"rate = {rate_per_s:g} 1/s: must be positive and finite")
    file = read_trained_file(path)
    values = file.description.get("preset")
    if not isinstance(values, Mapping):
        raise InputError(f"{path} does not hold its endoscope: commands are made on RAM (twins)")
    deployment, preset = deployment_of(file), preset_of("preset", values)
    if speed_mm_s is None:
        speed_mm_s = deployment.pull_speed_mm_s
        if preset.servo_speed:
            speed_mm_s = min(speed_mm_s, preset.servo_speed * 1e3)
    limits = CommandLimits(*stroke_mm, speed_mm_s)
    low, high = deployment.pull_mm
    if not low <= limits.low_mm < limits.high_mm <= high:
        raise InputError(
            f"stroke [{limits.low_mm:g}, {limits.high_mm:g}] mm: must be within [{low:.3g}, {high:.3g}], "
            "the pulls that the file was trained for"
        )
    gains, settings = tuned(PI_SETTINGS, {}), tuned(COMPENSATOR_SETTINGS, {"rate_per_s": rate_per_s})
    compensator = Compensator(runtime, limits, fit_line(preset, stroke_mm), settings, gains)
    return LiveCommands(runtime, compensator, limits)
