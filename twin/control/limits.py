"""Limits of the command: a stroke and a speed that no controller leaves."""

import dataclasses
import math
from typing import Self

from twin.errors import InputError

MARGIN = 1.5
"""Command beyond a stroke on either side, as a share of its width: the most that an endoscope of the
ureteroscope's ranges needs to follow the references of a stroke is 1.4."""


@dataclasses.dataclass(frozen=True)
class CommandLimits:
    """Stroke and speed of the commanded pulling distance.

    Attributes:
        low_mm: lowest pulling distance [mm].
        high_mm: highest [mm].
        speed_mm_s: fastest change [mm / s].
    """

    low_mm: float
    high_mm: float
    speed_mm_s: float

    def __post_init__(self) -> None:
        """Refuse an empty stroke and a speed that is not positive."""
        if not (math.isfinite(self.low_mm + self.high_mm) and self.low_mm < self.high_mm):
            raise InputError(
                f"stroke [{self.low_mm:g}, {self.high_mm:g}] mm: the first must be below the second"
            )
        if not 0 < self.speed_mm_s < math.inf:
            raise InputError(f"speed = {self.speed_mm_s:g} mm/s: must be positive and finite")

    def wider(self, share: float) -> Self:
        """Return limits that reach beyond either end by a share of the stroke's width."""
        beyond = share * (self.high_mm - self.low_mm)
        return dataclasses.replace(self, low_mm=self.low_mm - beyond, high_mm=self.high_mm + beyond)

    def nearest(self, pull_mm: float) -> float:
        """Return the pull within the stroke that is nearest to one [mm]."""
        return min(max(pull_mm, self.low_mm), self.high_mm)

    def reach(self, pull_mm: float, sample_time: float) -> tuple[float, float]:
        """Return the lowest and the highest pull [mm] one sample after another one."""
        way = self.speed_mm_s * sample_time
        return self.nearest(pull_mm - way), self.nearest(pull_mm + way)

    def within(self, wanted_mm: float, pull_mm: float, sample_time: float) -> float:
        """Return the pull nearest to a wanted one [mm] that can follow `pull_mm`; NaN stays where it is."""
        if math.isnan(wanted_mm):
            wanted_mm = pull_mm
        low, high = self.reach(pull_mm, sample_time)
        return min(max(wanted_mm, low), high)
