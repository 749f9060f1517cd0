"""Watch over the residual of a live stream: one that lasts, and is not usual, says that the filter is astray.

Lies of some degrees pass every gate. A filter that adapts takes them for noise or for a bias, and is then
sure of itself for longer than they lasted.
"""

import collections
import math
import statistics

from twin.estimation.stream_clock import samples_within

AVERAGE_S = 0.7  # over which a residual is averaged: noise averages out, an error of the estimate does not
RISE_S = 8.0  # in which a larger average becomes usual but for 1 / e
FALL_S = 15.0  # in which a larger one is forgotten but for 1 / e
FIRST_DEG = 27.0  # average that is usual at the start: a first estimate is 20 deg off
FACTOR = 2.7  # times the usual average
LEAST_DEG = 0.4  # and so much beyond it
DOUBT_S = 10.0  # behind a lie, in which no larger average becomes usual
REST = 3  # times as long a large residual alone raises no new doubt
LASTING_S = 1.0  # for which it must be beyond that: longer than noise stays in the average


class ResidualWatch:
    """Average residual, and the usual magnitude of that average."""

    def __init__(self, sample_time: float):
        """Begin with nothing known."""
        self._average, self._rise, self._fall = (
            1 - math.exp(-sample_time / seconds) for seconds in (AVERAGE_S, RISE_S, FALL_S)
        )
        self._enough = samples_within(LASTING_S, sample_time)
        self._latest: collections.deque[float] = collections.deque(maxlen=self._enough)
        self._usual_deg = FIRST_DEG
        self._doubt = math.ceil(min(DOUBT_S / sample_time, 1e9))
        self._since_doubt = 0  # samples
        self.clear()

    def clear(self) -> None:
        """Begin a new average: the estimate has begun anew."""
        self._average_deg = 0.0
        self._far_in_a_row = 0
        self._latest.clear()

    def doubt(self) -> None:
        """Take what comes next for a consequence of a lie: it is not usual."""
        self._since_doubt = 0

    @property
    def offset_deg(self) -> float:
        """Measurement minus estimate, now, on a line through the last second; zero if nothing was measured.

        A line, as a filter that comes back leaves a residual that shrinks fast. In [deg].
        """
        if len(self._latest) < 2:
            return sum(self._latest)
        slope, start = statistics.linear_regression(range(len(self._latest)), self._latest)
        return start + slope * (len(self._latest) - 1)

    def is_astray(self, residual_deg: float) -> bool:
        """Take in the residual of a sample and return whether it has been far too large for a while."""
        self._latest.append(residual_deg)
        self._average_deg += self._average * (residual_deg - self._average_deg)
        magnitude = abs(self._average_deg)
        far_deg = LEAST_DEG + FACTOR * self._usual_deg
        is_far = magnitude > far_deg
        self._far_in_a_row = self._far_in_a_row + 1 if is_far else 0
        further = magnitude - self._usual_deg
        self._since_doubt += 1
        if magnitude > 2 * far_deg and self._since_doubt > REST * self._doubt:
            self.doubt()  # a lie that passed the gate; or a model is wrong from now on, which becomes usual
        if further < 0 or self._since_doubt > self._doubt:
            self._usual_deg += further * (self._rise if further > 0 else self._fall)
        return self._far_in_a_row >= self._enough
