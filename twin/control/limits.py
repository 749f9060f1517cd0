"""Limits of the command: a stroke and a speed that no controller leaves."""

import dataclasses
import math

from twin.errors import InputError


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
        """Refuse an empty stroke and a speed that is not positive.

        Raises:
            ValueError: a limit is no finite number, the stroke is empty, or the speed is not positive.
        """
        if not (math.isfinite(self.low_mm + self.high_mm) and self.low_mm < self.high_mm):
            raise InputError(
                f"stroke [{self.low_mm:g}, {self.high_mm:g}] mm: the first must be below the second"
            )
        if not 0 < self.speed_mm_s < math.inf:
            raise InputError(f"speed = {self.speed_mm_s:g} mm/s: must be positive and finite")

    def reach(self, pull_mm: float, sample_time: float) -> tuple[float, float]:
        """Return the lowest and the highest pull [mm] one sample after another one."""
        way = self.speed_mm_s * sample_time
        return (
            min(max(pull_mm - way, self.low_mm), self.high_mm),
            max(min(pull_mm + way, self.high_mm), self.low_mm),
        )

    def within(self, wanted_mm: float, pull_mm: float, sample_time: float) -> float:
        """Return the pull nearest to a wanted one [mm] that can follow `pull_mm`; NaN stays where it is."""
        if math.isnan(wanted_mm):
            wanted_mm = pull_mm
        low, high = self.reach(pull_mm, sample_time)
        return min(max(wanted_mm, low), high)
