"""Anticipation of a known reference: long travels of the command begin early.

Where friction holds the bend, the command travels millimetres before the bend moves on. The earlier it
begins, the further the bend is ahead of the reference at first, and the less it is late afterwards. The error
is least where the two are equal, and that is when the command begins, at its speed limit.

A model predicts the bends: copies of the members of RAM (twins), or of the endoscope for an oracle.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.control.controller import CommandLimits

Array = NDArray[np.float64]
Along = Callable[[Array, NDArray[np.int64]], Array]
"""From pulls (N,) [mm], one after the other, and the samples (N,) that each takes: bends (N,) then [deg]."""

LATE_DEG, IN_TIME_DEG = 0.3, 0.1  # errors for which the command begins ahead of the reference, and continues
LOOKS_EVERY_S = 0.06
LOOKS_AHEAD_S = (0.06, 0.12, 0.2, 0.3, 0.42, 0.56, 0.72, 0.9)  # where model and reference are compared


class Anticipation:
    """Decision, from sample to sample, whether the command is to go ahead of its reference."""

    def __init__(self, limits: CommandLimits, sample_time: float) -> None:
        self._limits, self._way_mm = limits, limits.speed_mm_s * sample_time
        self._every = max(round(LOOKS_EVERY_S / sample_time), 1)
        looks = np.round(np.array(LOOKS_AHEAD_S) / sample_time).astype(np.int64)
        self._looks = np.unique(np.maximum(looks, 1))
        self.forget()

    def forget(self) -> None:
        """Forget what was begun."""
        self.direction = 0.0  # in which it goes, or waits for the reference, 1 or -1; 0: it does neither
        self._goes, self._waits = False, 0

    def wanted_mm(
        self,
        pull_mm: float,
        bend_deg: float,
        reference_deg: float,
        reference_preview_deg: Array,
        along: Along,
    ) -> float:
        """Return the pull that is wanted at the next sample [mm]; NaN where nothing is to be done ahead.

        The preview (H,) begins with the next sample. `along` asks the model, and nothing moves; its bends
        count from the one that it has now.
        """
        if len(reference_preview_deg) < self._looks[0] or not np.isfinite(reference_preview_deg).all():
            self.forget()
            return math.nan
        if not self._waits:
            # It begins only for a motion of the reference, never for an existing error of the bend.
            at = bend_deg if self.direction else reference_deg
            self._look(pull_mm, at, reference_preview_deg, along)
            self._waits = self._every
        self._waits -= 1
        ahead, left = bend_deg - reference_preview_deg[0], reference_preview_deg[-1] - bend_deg
        if not self._goes and not (self.direction * ahead > 0 and self.direction * left > 0):
            self.direction = 0.0
        if not self.direction:
            return math.nan
        return pull_mm + self.direction * self._way_mm * self._goes

    def _look(self, pull_mm: float, bend_deg: float, reference_preview_deg: Array, along: Along) -> None:
        """Compare the reference with the bend at the speed limit, and begin, continue or wait."""
        looks = self._looks[self._looks <= len(reference_preview_deg)]
        direction = self.direction or math.copysign(1.0, reference_preview_deg[-1] - bend_deg)
        low, high = self._limits.low_mm, self._limits.high_mm
        pulls = np.clip(pull_mm + direction * self._way_mm * looks, low, high)
        # No endoscope bends against its pull; weighted members may, where some of them move first.
        brought = np.maximum(direction * along(pulls, np.diff(looks, prepend=0)), 0.0)
        ahead = brought - direction * (reference_preview_deg[looks - 1] - bend_deg)
        latest = int(np.argmin(ahead))
        behind = -float(ahead[latest])
        if self.direction:
            self._goes = behind > IN_TIME_DEG
        elif behind > LATE_DEG:
            first = direction * (bend_deg - reference_preview_deg[0])
            if behind >= max(first, float(ahead[:latest].max(initial=0.0))):
                self.direction, self._goes = direction, True
