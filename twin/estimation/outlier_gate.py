"""Gate for measurements of a live stream: how far from the last estimate one may be to be believed.

The filter's own innovation would need a second prediction for each sample. The distance from the last
estimate is there for nothing; it holds one sample's motion too, which is small beside an outlier.
"""

import math

from twin.estimation.health import StreamLimits

FIRST_DEG = 27.0  # distance that is expected before anything is known: a first estimate is 20 deg off
FORGET_S = 2.5  # in which a large distance is forgotten but for 1 / e
LEARN_S = 1.0  # in which a larger one is learned but for 1 / e: one outlier must not let in the next
WIDEN_S = 2.0  # without a measurement, after which nothing is known again


class OutlierGate:
    """Gate that is as wide as the distances of late allow, within the limits of a stream."""

    def __init__(self, sample_time: float, limits: StreamLimits):
        """Begin wide open."""
        self._limits = limits
        self._forget = 1 - math.exp(-sample_time / FORGET_S)
        self._learn = 1 - math.exp(-sample_time / LEARN_S)
        self._usual_deg = FIRST_DEG
        self._near_deg = min(limits.outlier_deg, limits.outlier_most_deg)  # the gate is never narrower

    @property
    def width_deg(self) -> float:
        """Distance up to which a measurement is believed [deg]."""
        limits = self._limits
        return min(limits.outlier_deg + limits.outlier_factor * self._usual_deg, limits.outlier_most_deg)

    @property
    def agreement_deg(self) -> float:
        """Distance up to which two measurements agree that were refused one after the other [deg]."""
        return min(self._limits.outlier_deg + self._usual_deg, self._limits.outlier_most_deg)

    def passes(self, distance_deg: float) -> bool:
        """Return whether a measurement so far from the last estimate is believed; if so, learn from it."""
        if distance_deg > self._near_deg and distance_deg > self.width_deg:
            return False
        further = distance_deg - self._usual_deg
        self._usual_deg += further * (self._learn if further > 0 else self._forget)
        return True

    def widen(self, elapsed_s: float) -> None:
        """Open the gate for a time without measurements, in which the estimate may have gone astray."""
        opened = self._usual_deg + FIRST_DEG * elapsed_s / WIDEN_S
        self._usual_deg = max(min(opened, FIRST_DEG), self._usual_deg)
