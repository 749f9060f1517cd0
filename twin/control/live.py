"""Commands beside a live stream: each sample with a reference is answered by the pull to command next."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin.control.anticipation import NOTHING_COMES
from twin.control.compensator import COMPENSATOR_SETTINGS, Compensator
from twin.control.feedback import PI_SETTINGS
from twin.control.limits import CommandLimits
from twin.control.line import fit_line
from twin.control.registry import tuned
from twin.errors import InputError
from twin.estimation.deployment import deployment_of
from twin.estimation.learned.trained_file import read_trained_file
from twin.live.assured import AssuredEstimator
from twin.live.reading import Health
from twin.preset.file import preset_of
from twin.preset.preset import Preset

_IGNORED = Health.NO_TIME | Health.LATE | Health.CLOCK_JUMP


class LiveCommands:
    """Commands of one endoscope, for a motor driver that says in each sample where its command stands.

    A sample without a pull counts as one at the latest command; one without a reference keeps the latest. One
    that the runtime ignores, as it is late or its time is none, is answered by the latest command. While the
    sensor is silent or stuck (alarms TIMEOUT and STUCK), the command that stands is held.

    Attributes:
        limits: of the command.
        command_mm: latest command; NaN before the first [mm].
        falls_back: whether the fallback's law is in charge.
    """

    def __init__(self, runtime: AssuredEstimator, compensator: Compensator, limits: CommandLimits) -> None:
        self.limits, self.command_mm = limits, math.nan
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

    def after(self, pull_mm: float, reference_deg: float, coming_deg: Sequence[float] = ()) -> float:
        """Return the pull to command at the next sample [mm]; NaN before the first pull and reference.

        Args:
            pull_mm: command that stands at the sample which the runtime has just taken in, NaN if not told
                [mm].
            reference_deg: angle that is wanted at the next sample; NaN if not told [deg].
            coming_deg: angles that are wanted at the samples after that, as far as they are known [deg].
        """
        if self._runtime.reading.health & _IGNORED:
            return self.command_mm
        stands = self.command_mm if math.isnan(pull_mm) else pull_mm
        now = self._reference_deg
        if not math.isnan(reference_deg):
            self._reference_deg = reference_deg
        if math.isnan(stands) or math.isnan(self._reference_deg):
            return self.command_mm
        wanted = self._compensator.wanted_mm(
            stands,
            self._reference_deg if math.isnan(now) else now,
            self._reference_deg,
            np.array([self._reference_deg, *coming_deg]) if len(coming_deg) else NOTHING_COMES,
        )
        self.command_mm = self.limits.within(wanted, stands, self._runtime.sample_time)
        return self.command_mm


def prepare_commands(
    path: Path,
    runtime: AssuredEstimator,
    stroke_mm: tuple[float, float],
    speed_mm_s: float | None = None,
    rate_per_s: float = COMPENSATOR_SETTINGS["rate_per_s"].default,
) -> LiveCommands:
    """Return the commands beside a runtime.

    Args:
        path: its trained file, of RAM (twins).
        runtime: that takes in each sample before `after` is called.
        stroke_mm: lowest and highest command [mm].
        speed_mm_s: its fastest change; if not given, that of the training, or of the preset's servo where it
            is slower [mm / s].
        rate_per_s: at which the estimated error is removed [1 / s].
    """
    if not 0 < rate_per_s < math.inf:
        raise InputError(f"rate = {rate_per_s:g} 1/s: must be positive and finite")
    file = read_trained_file(path)
    deployment, preset = deployment_of(file), _preset_in(file.description, path)
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


def _preset_in(description: Mapping[str, Any], path: Path) -> Preset:
    values = description.get("preset")
    if not isinstance(values, Mapping):
        raise InputError(f"{path} does not hold its endoscope: commands are made on RAM (twins)")
    return preset_of("preset", values)
