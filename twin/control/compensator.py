"""Hysteresis compensation beside a running estimator: its members are inverted while it is trusted.

RAM (twins) predicts by twins that follow the command. The command of the next sample is the pull u with

    sum_m w_m [theta_m(u) - theta_m] = r_next - r + share (r - estimate),      share = 1 - exp(-rate T),

where w are the weights that the filter gives the members now, r the reference. Only what the reference
moves and a share of the estimated error are asked for: one that asked for the whole error would follow the
noise of the estimate. Nor does the command turn round, and cross the dead band of a reversal, for less than
the estimate can tell: unless the reference turns, it must be off by a share of its 95 % interval.

Where the reference is known ahead, the same members say which way of the command takes longer than there is
time for, and that one is begun early (`twin/control/anticipation.py`).

While the runtime does not trust RAM (twins), linear map and PI on its estimate, the fallback's then, are
in charge, without a jump. While the sensor is silent or stuck, the command is held.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.control.anticipation import NOTHING_COMES, Anticipation, Array
from twin.control.feedback import LinearFeedback
from twin.control.limits import CommandLimits
from twin.control.line import Line
from twin.control.registry import Setting
from twin.errors import InputError
from twin.estimation.learned.member_weights import MemberWeights
from twin.estimation.learned.ram_twins import RamTwins, TwinsState
from twin.live.assured import AssuredEstimator
from twin.live.reading import Alarm, Source

COMPENSATOR_SETTINGS = {"rate_per_s": Setting(20.0, 2.0, 100.0), "turning_share": Setting(1.5, 0.3, 3.0)}
"""Rate at which the estimated error is removed [1 / s], and error from which on the command turns round, in
halves of the estimate's 95 % interval [-]."""
_SILENT = Alarm.TIMEOUT | Alarm.STUCK


class Compensator:
    """Commands of one endoscope beside the runtime that estimates its bend.

    Attributes:
        falls_back: whether PI on the fallback's estimate is in charge.
        holds: whether the command is held, as no measurement comes.
    """

    def __init__(
        self,
        runtime: AssuredEstimator,
        limits: CommandLimits,
        line: Line,
        settings: Mapping[str, float],
        gains: Mapping[str, float],
    ) -> None:
        """Prepare a run."""
        advanced = runtime.advanced.estimator
        if not isinstance(advanced, RamTwins):
            raise InputError(f"{runtime.method} has no twins to invert: commands are made on RAM (twins)")
        self._runtime, self._limits = runtime, limits
        self._members, self._weights = advanced.members, MemberWeights(advanced)
        self._share = -math.expm1(-settings["rate_per_s"] * runtime.sample_time)
        self._turning_share = settings["turning_share"]
        self._feedback = LinearFeedback(limits, runtime.sample_time, line, gains)
        self._anticipation = Anticipation(limits, runtime.sample_time)
        self._direction = 0.0  # of the latest command
        self.falls_back = self.holds = False

    def wanted_mm(
        self, pull_mm: float, reference_deg: float, next_deg: float, coming_deg: Array = NOTHING_COMES
    ) -> float:
        """Return the pull that is wanted at the next sample [mm], within stroke and speed.

        Args:
            pull_mm: command that stands [mm].
            reference_deg: wanted angle now [deg].
            next_deg: wanted angle at the next sample [deg].
            coming_deg: (H,) wanted angles from the next sample on, where they are known ahead [deg].
        """
        runtime = self._runtime
        reading, state = runtime.reading, runtime.advanced.state
        went_on = self.falls_back and not self.holds
        self.falls_back, self.holds = reading.source is not Source.ADVANCED, bool(reading.alarms & _SILENT)
        if self.holds:
            return pull_mm
        if not self.falls_back and isinstance(state, TwinsState):
            ahead = self._ahead_mm(state, pull_mm, reference_deg, coming_deg)
            return self._inverse_mm(state, pull_mm, reference_deg, next_deg) if math.isnan(ahead) else ahead
        self.falls_back, self._direction = True, 0.0
        self._anticipation.forget()
        if not went_on:
            self._feedback.begin(pull_mm, reference_deg, reading.bend_deg)
        return self._feedback.wanted_mm(pull_mm, reading.bend_deg, reference_deg, next_deg)

    def _ahead_mm(self, state: TwinsState, pull_mm: float, reference_deg: float, coming_deg: Array) -> float:
        """Return the pull of a way that is begun ahead of its reference [mm]; NaN where none is."""
        weights = self._weights.of(state)
        now = float(weights @ state.following.of_filters()[0])

        def along(pulls_mm: Array, samples: NDArray[np.int64]) -> Array:
            moved: Array = self._members.bends_along(state.following, pulls_mm, samples) @ weights - now
            return moved

        bend = self._runtime.reading.bend_deg
        ahead = self._anticipation.wanted_mm(pull_mm, bend, reference_deg, coming_deg, along)
        if ahead != pull_mm and not math.isnan(ahead):
            self._direction = ahead - pull_mm
        return ahead

    def _inverse_mm(self, state: TwinsState, pull_mm: float, reference_deg: float, next_deg: float) -> float:
        """Return the pull that moves the weighted members by what is asked of them [mm]."""
        bend, low, high = self._runtime.reading[:3]
        moved = next_deg - reference_deg + self._share * (reference_deg - bend)
        if (
            moved * self._direction < 0 <= (next_deg - reference_deg) * self._direction
            and abs(next_deg - bend) < self._turning_share * (high - low) / 2
        ):
            return pull_mm
        self._direction = moved
        weights = self._weights.of(state)
        now = float(weights @ state.following.of_filters()[0])
        within = self._limits.reach(pull_mm, self._runtime.sample_time)
        return self._members.common_pull_mm(state.following, weights, now + moved, within)
