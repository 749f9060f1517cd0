"""Clock of a live stream: which time stamps go on from the last, and when another clock is believed."""

import math

from twin.estimation.health import Health, StreamLimits

FEWEST, MOST = 5, 500
"""Samples that must agree before they are believed, whatever the sample time."""
# Stamps that go back for less time than this may be late packets, sent again in order.
CLOCK_AGREEMENT_S = 1.0
_GOOD = Health.GOOD  # looked up once: an attribute of an enumeration takes as long as ten sums
USUAL_STEPS = 10.0  # sample times, or seconds, that two stamps of one clock lie apart at most, to agree


def samples_within(seconds: float, sample_time: float) -> int:
    """Return how many samples fit into a time, but no fewer and no more than can be waited for."""
    return round(min(max(seconds / sample_time, FEWEST), MOST))


class StreamClock:
    """Time of a stream by its stamps.

    A stamp that is no later than the last, or farther ahead than a pause may be long, is refused: where the
    stamps after it go on from the old clock, nothing has happened. Where they go on among themselves for a
    second, the sender has another clock, and the stream goes on by it.

    Attributes:
        fault: what was wrong with the last stamp.
    """

    def __init__(self, sample_time: float, limits: StreamLimits):
        """Prepare for stamps of samples that come every `sample_time` [s]."""
        self.fault = _GOOD
        self._sample_time = sample_time
        self._pause_s, self._most_s = limits.pause_s, limits.time_s
        self._now_s = math.nan  # until the first stamp
        self._other_s = math.nan  # last stamp of another clock
        self._agreeing = 0
        self._enough = samples_within(CLOCK_AGREEMENT_S, sample_time)

    def elapsed(self, time_s: float) -> float:
        """Take in a stamp and return the time since the last that counted [s]; NaN if this one does not.

        Args:
            time_s: the stamp [s].
        """
        self.fault = _GOOD
        elapsed = time_s - self._now_s
        if 0 < elapsed <= self._pause_s and abs(time_s) <= self._most_s:
            self._now_s = time_s
            self._agreeing = 0
            return elapsed
        if not abs(time_s) <= self._most_s:
            self.fault = Health.NO_TIME
            return math.nan
        if math.isnan(self._now_s):
            self._now_s = time_s
            return 0.0
        return self._of_another_clock(time_s, elapsed)

    def _of_another_clock(self, time_s: float, elapsed: float) -> float:
        self.fault = Health.LATE if elapsed <= 0 else Health.CLOCK_JUMP
        usual = USUAL_STEPS * max(self._sample_time, 1.0)
        agrees = self._agreeing > 0 and 0 < time_s - self._other_s <= usual
        self._agreeing = self._agreeing + 1 if agrees else 1
        self._other_s = time_s
        if self._agreeing < self._enough:
            return math.nan
        self.fault = Health.CLOCK_RESET
        self._now_s, self._agreeing = time_s, 0
        # As long as it took to believe it; after a jump ahead, as long as the sender says.
        return max(elapsed, self._enough * self._sample_time)
