"""Checks of the samples of a live stream: time stamps, outliers, stuck sensors, biases that pass the gate.

Implausible samples are refused. Refused samples that agree for a while are a change and not a fault, so that
no real jump blocks a stream.
"""

import collections
import dataclasses
import math
import numbers
import reprlib
import statistics
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.live.reading import Health
from twin.signals.sensor import LARGEST_BEND_DEG, LARGEST_PULL_MM, LARGEST_TIME_S

FEWEST, MOST = 5, 500
"""Least and largest number of samples that must agree before they are accepted, at any sample time."""
OFFSET_SHARE = 1.5
"""Times the largest error that an interval includes: weights of twins have taken a part of an offset."""
OFFSET_S, OFFSET_DEG, OFFSET_DEVIATIONS = 1.0, 0.6, 2.0
"""Time for which measurements are off all twins, and by how much at least, in degrees and deviations."""
FIRST_DEG = 27.0  # distance that is expected before anything is known: a first estimate may be 20 deg off
_GOOD = Health.GOOD  # looked up once: an attribute of an enumeration takes as long as ten sums


@dataclasses.dataclass(frozen=True)
class StreamLimits:
    """Limits of plausible samples; a healthy stream never reaches them."""

    bend_deg: float = LARGEST_BEND_DEG  # magnitude of a measurement [deg]
    pull_mm: float = LARGEST_PULL_MM  # magnitude of a pull [mm]
    time_s: float = LARGEST_TIME_S  # magnitude of a time stamp [s]
    pause_s: float = 86_400.0  # longest pause of a stream; a stamp farther ahead is of another clock [s]
    pull_jump_mm: float = 0.5  # move of the pull between two samples, whatever the time between them [mm]
    pull_speed_mm_s: float = 12.0  # speed of the pull beyond that; our commands stay below 10 mm/s [mm / s]
    outlier_deg: float = 10.0  # distance from the last estimate that is never too far [deg]
    outlier_factor: float = 3.0  # how much farther, relative to the recent usual distance
    outlier_most_deg: float = 90.0  # distance that is always too far; an error at the start is not [deg]
    agreement_s: float = 0.5  # time for which refused values must agree before they are accepted [s]

    def __post_init__(self) -> None:
        for name, limit in vars(self).items():
            if not 0 <= limit <= math.inf:
                raise InputError(f"{name} = {limit}: must be a number that is not negative")


class OffsetDetector:
    """Detection of measurements that stay off all twins: a sensor that has moved, or another endoscope.

    Measurements cannot distinguish the two. So the error is reported, for the interval to include both.
    """

    def __init__(self, sample_time: float):
        self._lasting = max(round(OFFSET_S / sample_time), 2)
        self._far = self._near = 0  # samples in a row
        self._off = False
        self.offset_deg = 0.0  # largest error since it is off: the weights of twins adapt to an offset [deg]

    def is_off(self, error_deg: float, deviation_deg: float) -> bool:
        """Take in what no twin explains and its standard deviation [deg]; return whether it is an offset."""
        limit = max(OFFSET_DEG, OFFSET_DEVIATIONS * deviation_deg)
        self._far = self._far + 1 if abs(error_deg) > limit else 0
        self._near = self._near + 1 if abs(error_deg) < limit / 2 else 0
        self._off = self._far >= self._lasting or (self._off and self._near < 5 * self._lasting)
        if not self._off and not self._far:
            self.offset_deg = 0.0
        elif abs(error_deg) > abs(self.offset_deg):
            self.offset_deg = error_deg
        return self._off


def real_number(name: str, value: Any) -> float:
    """Return a real number of any type as a float."""
    number = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if not isinstance(number, numbers.Real):
        shown = " ".join(reprlib.repr(value).split())[:40]
        raise InputError(f"{name} = {shown}: must be a number, not {type(value).__name__[:40]}")
    try:
        return float(number)
    except OverflowError:  # an integer beyond all floats
        return math.inf if value > 0 else -math.inf


def samples_within(seconds: float, sample_time: float) -> int:
    """Return the number of samples in a time, between `FEWEST` and `MOST`."""
    return round(min(max(seconds / sample_time, FEWEST), MOST))


class StreamClock:
    """Time of a stream by its stamps.

    A stamp that is not later than the last, or farther ahead than the longest pause, is refused: if the later
    stamps continue the old clock, nothing has happened. If they continue each other for a second, the sender
    has another clock, and the stream follows it.
    """

    AGREEMENT_S = 1.0  # stamps that go back for less time than this may be late packets, sent again in order
    USUAL_STEPS = 10.0  # sample times, or seconds, between two stamps of one clock that agree, at most

    def __init__(self, sample_time: float, limits: StreamLimits):
        self.fault = _GOOD  # of the last stamp
        self._sample_time = sample_time
        self._pause_s, self._most_s = limits.pause_s, limits.time_s
        self._now_s = math.nan  # until the first stamp
        self._other_s = math.nan  # last stamp of another clock
        self._agreeing = 0
        self._enough = samples_within(self.AGREEMENT_S, sample_time)

    def elapsed(self, time_s: float) -> float:
        """Return the time from the last accepted stamp to this one [s]; NaN if this one is refused."""
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
        return self._elapsed_on_another_clock(time_s, elapsed)

    def _elapsed_on_another_clock(self, time_s: float, elapsed: float) -> float:
        self.fault = Health.LATE if elapsed <= 0 else Health.CLOCK_JUMP
        usual = self.USUAL_STEPS * max(self._sample_time, 1.0)
        agrees = self._agreeing > 0 and 0 < time_s - self._other_s <= usual
        self._agreeing = self._agreeing + 1 if agrees else 1
        self._other_s = time_s
        if self._agreeing < self._enough:
            return math.nan
        self.fault = Health.CLOCK_RESET
        self._now_s, self._agreeing = time_s, 0
        # As long as it took to accept it; after a jump ahead, as long as the stamps state.
        return max(elapsed, self._enough * self._sample_time)


class OutlierGate:
    """Gate of measurements by their distance from the last estimate, as wide as recent distances.

    The filter's own innovation would need a second prediction for each sample. The distance from the last
    estimate costs nothing; it contains one sample's motion too, which is small compared with an outlier.
    """

    FORGET_S = 2.5  # time constant of forgetting a large distance
    LEARN_S = 1.0  # of learning a larger one: one outlier must not let in the next
    WIDEN_S = 2.0  # without a measurement, after which nothing is known again

    def __init__(self, sample_time: float, limits: StreamLimits):
        self._limits = limits
        self._forget = 1 - math.exp(-sample_time / self.FORGET_S)
        self._learn = 1 - math.exp(-sample_time / self.LEARN_S)
        self._usual_deg = FIRST_DEG
        self._near_deg = min(limits.outlier_deg, limits.outlier_most_deg)  # the gate is never narrower

    def width_deg(self, factor: float) -> float:
        """Least width of the gate plus a multiple of the usual distance, at most the largest width [deg]."""
        return min(self._limits.outlier_deg + factor * self._usual_deg, self._limits.outlier_most_deg)

    def passes(self, distance_deg: float) -> bool:
        """Return whether a measurement at this distance is accepted, and learn from it if so."""
        if distance_deg > self._near_deg and distance_deg > self.width_deg(self._limits.outlier_factor):
            return False
        further = distance_deg - self._usual_deg
        self._usual_deg += further * (self._learn if further > 0 else self._forget)
        return True

    def widen(self, elapsed_s: float) -> None:
        """Open the gate for a time without measurements, in which the estimate may have drifted."""
        opened = self._usual_deg + FIRST_DEG * elapsed_s / self.WIDEN_S
        self._usual_deg = max(min(opened, FIRST_DEG), self._usual_deg)


Refused = tuple[float, float]
"""Pull [mm] and measurement [deg] of a sample that was refused for one of them; NaN is no measurement."""


class AgreeingRun:
    """Consecutive refused samples that agree; a run that is long enough is accepted."""

    def __init__(self, enough: int):
        self._samples: collections.deque[Refused] = collections.deque(maxlen=enough)
        self._last = math.nan
        self.begun = False  # whether it contains a sample

    def is_accepted(self, value: float, tolerance: float, sample: Refused) -> bool:
        """Take in a sample that was refused for a value and return whether the run is long enough.

        Two consecutive values agree within the tolerance.
        """
        if self._samples and abs(value - self._last) > tolerance:
            self._samples.clear()
        self._last = value
        self._samples.append(sample)
        self.begun = True
        return len(self._samples) == self._samples.maxlen

    def clear(self) -> None:
        """Forget the run."""
        self._samples.clear()
        self.begun = False

    def restart(self) -> tuple[Refused, list[Refused]] | None:
        """Return where an estimator restarts, and the samples after it; None where nothing was measured.

        It restarts in the middle of the run, at the median of its measurements: a single one would pass its
        noise to filters that trust their first angle.
        """
        samples, middle = list(self._samples), len(self._samples) // 2
        measured = [measurement for _, measurement in samples if math.isfinite(measurement)]
        if not measured:
            return None
        return (samples[middle][0], statistics.median(measured)), samples[middle + 1 :]


class BiasDetector:
    """Detector of an unusual residual that lasts: the filter is biased by faulty measurements.

    Faults of some degrees pass every gate. A filter that adapts takes them for noise or for a bias, and is
    then confident for longer than they lasted. The average residual is compared with its usual magnitude.
    """

    AVERAGE_S = 0.7  # of the average: noise averages out, an error of the estimate does not
    RISE_S = 8.0  # time constant in which a larger average becomes usual
    FALL_S = 15.0  # and in which it is forgotten
    FACTOR = 2.7  # times the usual average
    LEAST_DEG = 0.4  # and so much beyond it
    DOUBT_S = 10.0  # after a fault, in which no larger average becomes usual
    REST = 3  # times as long a large residual alone causes no new doubt
    LASTING_S = 1.0  # for which it must be beyond that: longer than noise stays in the average

    def __init__(self, sample_time: float):
        self._average, self._rise, self._fall = (
            1 - math.exp(-sample_time / seconds) for seconds in (self.AVERAGE_S, self.RISE_S, self.FALL_S)
        )
        self._enough = samples_within(self.LASTING_S, sample_time)
        self._latest: collections.deque[float] = collections.deque(maxlen=self._enough)
        self._usual_deg = FIRST_DEG
        self._doubt = math.ceil(min(self.DOUBT_S / sample_time, 1e9))
        self._since_doubt = 0  # samples
        self.clear()

    def clear(self) -> None:
        """Reset the average, after a restart of the estimate."""
        self._average_deg = 0.0
        self._far_in_a_row = 0
        self._latest.clear()

    def doubt(self) -> None:
        """Treat the next residuals as a consequence of a fault: they are not usual."""
        self._since_doubt = 0

    @property
    def offset_deg(self) -> float:
        """Present residual by a line through the last second, 0 without measurements [deg].

        A line, as a filter that recovers leaves a residual that shrinks fast.
        """
        if len(self._latest) < 2:
            return sum(self._latest)
        slope, start = statistics.linear_regression(range(len(self._latest)), self._latest)
        return start + slope * (len(self._latest) - 1)

    def is_biased(self, residual_deg: float) -> bool:
        """Take in measurement minus estimate [deg] and return whether it has been too large for a while."""
        self._latest.append(residual_deg)
        self._average_deg += self._average * (residual_deg - self._average_deg)
        magnitude = abs(self._average_deg)
        far_deg = self.LEAST_DEG + self.FACTOR * self._usual_deg
        self._far_in_a_row = self._far_in_a_row + 1 if magnitude > far_deg else 0
        further = magnitude - self._usual_deg
        self._since_doubt += 1
        if magnitude > 2 * far_deg and self._since_doubt > self.REST * self._doubt:
            self.doubt()  # a fault that passed the gate, or a model that is wrong from now on: becomes usual
        if further < 0 or self._since_doubt > self._doubt:
            self._usual_deg += further * (self._rise if further > 0 else self._fall)
        return self._far_in_a_row >= self._enough


class StuckSensor:
    """Detector of a sensor that repeats one number although it never does so at rest.

    A sensor with noise never repeats a number: two repeats are enough. A quantised one does, and the length
    of its usual runs is learned.
    """

    REPEATS = 2  # of one number, which a sensor with noise never does
    USUAL = 0.06  # share of repeated numbers from which a sensor is quantised
    LEARN = 0.02  # of that share, by one number: a sensor that is stuck now and then is not quantised
    LEARN_LENGTH = 0.1  # of the length of runs
    LONGEST_RUN = 100
    LEAST = 1e-9  # probability below which a run of equal numbers is not chance, where runs are usual

    def __init__(self) -> None:
        self._last = math.nan
        self._repeats = 0
        self._repeated = 0.0  # share of numbers that were repeated
        self._length = 1.0  # usual length of a run of those
        self._longest = self.REPEATS

    def is_stuck(self, measurement_deg: float) -> bool:
        """Take in a measurement, NaN where there is none; return whether its run is too long for chance."""
        if measurement_deg != measurement_deg:
            return False
        if measurement_deg == self._last:
            self._repeats += 1
            return self._repeats >= self._longest
        self._last = measurement_deg
        if self._repeats or self._repeated:
            self._learn()
        return False

    def _learn(self) -> None:
        self._repeated += self.LEARN * ((self._repeats > 0) - self._repeated)
        if self._repeats:
            length = min(self._repeats + 1, self.LONGEST_RUN)
            self._length += self.LEARN_LENGTH * (length - self._length)
        self._repeats = 0
        self._longest = self.REPEATS
        if self._repeated > self.USUAL:  # lengths are geometric: a run goes on with 1 - 1 / length
            goes_on = 1 - 1 / max(self._length, 1.1)
            self._longest = max(self.REPEATS, math.ceil(math.log(self.LEAST) / math.log(goes_on)))
