"""A sample of a live stream and its reading: estimate, interval, source, faults and alarms."""

import collections
import enum
import functools
import math
from typing import Any, NamedTuple, Protocol

UNKNOWN_DEG = 180.0  # half width of an interval of an estimate about which nothing is known
_ROUNDING_DEG = 1e-6


class Health(enum.Flag):
    """Faults of one sample of a live stream, any number of them together; `Health.GOOD` is none."""

    GOOD = 0  # no fault
    NO_TIME = enum.auto()  # the time stamp is not finite or beyond all dates: the sample is ignored
    LATE = enum.auto()  # it is not later than the one before: the sample is ignored
    CLOCK_JUMP = enum.auto()  # it is farther ahead than the longest pause: the sample is ignored
    CLOCK_RESET = enum.auto()  # the stream goes on by another clock, on which samples have agreed
    GAP = enum.auto()  # samples are missing before this one; predictions took their place
    NO_PULL = enum.auto()  # the pull is not finite: it goes on at its recent speed
    IMPLAUSIBLE_PULL = enum.auto()  # it is beyond its limit, or too far from the last one: as without a pull
    NO_MEASUREMENT = enum.auto()  # the measurement is not finite: it is missing
    IMPLAUSIBLE_MEASUREMENT = enum.auto()  # it is beyond its limit: it counts as missing
    OUTLIER = enum.auto()  # it is too far from the last estimate: it counts as missing
    REFUSED = enum.auto()  # a step led to an impossible state, and was not taken
    RESTARTED = enum.auto()  # the estimator restarted at this sample
    WAITING = enum.auto()  # no pull has come yet: the stream has not begun


class Alarm(enum.Flag):
    """Alarms of one sample, any number of them together; `Alarm.NONE` is none.

    Those from INNOVATION to LOST are about the trained estimator: three samples in a row with any of them
    switch to the fallback, one where it restarted. The others are about the sample. While STUCK, or one from
    SIGN on, lasts, the sensor is not used.
    """

    NONE = 0  # no alarm
    INNOVATION = enum.auto()  # over 2.5 s it predicts worse than the fallback, or is off by a constant
    DISAGREEMENT = enum.auto()  # it is farther from the fallback than both intervals allow
    RANGE = enum.auto()  # its estimate is far beyond the angles that it was trained on
    RATE = enum.auto()  # its estimate moves faster than the endoscope and the noise can
    COMMAND = enum.auto()  # the command is beyond the distances or the speed that it was trained on
    INTERVAL = enum.auto()  # its interval is not a number, or wider than 90 deg to each side
    LOST = enum.auto()  # it restarted where the fallback need not, or a step led to an impossible state
    STUCK = enum.auto()  # the sensor stands still though the endoscope moves, or repeats one number
    TIMEOUT = enum.auto()  # no measurement has come for too long
    INPUT = enum.auto()  # this sample was faulty (`Reading.health`), or is far from both predictions
    BEGINNING = enum.auto()  # too few samples have come to judge
    OFFSET = enum.auto()  # measurements have been off all twins for a second: the interval includes both
    SIGN = enum.auto()  # the sensor moves against the endoscope
    GAIN = enum.auto()  # it shows a share of the angle, or more than it
    DRIFT = enum.auto()  # its zero moves on
    BIAS = enum.auto()  # its zero has moved, or it is wrong in a way that has no name yet


WRONG_SENSOR = Alarm.STUCK | Alarm.SIGN | Alarm.GAIN | Alarm.DRIFT | Alarm.BIAS
"""Alarms while which the sensor is not used."""


class Source(enum.Enum):
    """Source of an estimate: the trained estimator, the trusted filter, a mean of both, or twins alone."""

    ADVANCED = "advanced"
    FALLBACK = "fallback"
    BLEND = "blend"
    TWINS = "twins"  # by the command alone, as the sensor is wrong


class Reading(NamedTuple):
    """Estimate at one sample.

    Attributes:
        bend_deg: estimate; never NaN [deg].
        low_deg: lower end of its 95 % interval; 180 deg below the estimate where it is unknown [deg].
        high_deg: upper end of it; 180 deg above where it is unknown [deg].
        source: of the estimate.
        health: faults of the sample.
        alarms: reasons not to trust the trained estimator, or the sample.
    """

    bend_deg: float
    low_deg: float
    high_deg: float
    source: Source
    health: Health
    alarms: Alarm

    @property
    def interval_deg(self) -> tuple[float, float] | None:
        """95 % interval, low and high [deg]; None where it is unknown."""
        known = abs(self.high_deg - self.low_deg) < 2 * UNKNOWN_DEG - _ROUNDING_DEG
        return (self.low_deg, self.high_deg) if known else None


class StreamSample(NamedTuple):
    """One sample and its reading.

    Attributes:
        time_s: time stamp as it came [s].
        pull_mm: commanded pulling distance, NaN where there was none [mm].
        measurement_deg: measured angle, NaN where there was none [deg].
        reading: at this sample.
        reference_deg: angle that is wanted at the next sample, NaN where none is given [deg].
    """

    time_s: float
    pull_mm: float
    measurement_deg: float
    reading: Reading
    reference_deg: float = math.nan


class Sink(Protocol):
    """Consumer of samples, such as a recording or a viewer."""

    def add(self, sample: StreamSample, /) -> None:
        """Take in one sample without waiting; raise `OSError` if it cannot be written."""

    def close(self) -> None:
        """Complete the output."""


@functools.lru_cache(maxsize=4096)
def flag_names(flags: Health | Alarm) -> list[str]:
    """Return the names of the flags that are set."""
    return [str(flag.name) for flag in flags]


_WRONG = flag_names(WRONG_SENSOR)


class RunCounts:
    """Counts of the samples of a run; a sink."""

    def __init__(self) -> None:
        self.samples = self.faulty = 0  # all, and those with any fault
        self.sources: collections.Counter[Source] = collections.Counter()  # by source of the estimate
        self.faults: collections.Counter[str] = collections.Counter()  # by fault
        self.alarms: collections.Counter[str] = collections.Counter()  # by alarm
        self.began_s: dict[str, float] = {}  # time stamp at which each alarm was first raised [s]

    def add(self, sample: StreamSample) -> None:
        """Count one sample."""
        reading = sample.reading
        self.samples += 1
        self.faulty += bool(reading.health)
        self.sources[reading.source] += 1
        self.faults.update(flag_names(reading.health))
        for name in flag_names(reading.alarms):
            self.alarms[name] += 1
            self.began_s.setdefault(name, sample.time_s)

    def close(self) -> None:
        """Do nothing: the counts stay."""

    def share(self, source: Source) -> float:
        """Return the share of the samples whose estimate has this source; 0 without samples."""
        return self.sources[source] / max(self.samples, 1)

    def to_dict(self) -> dict[str, Any]:
        """Return the counts as plain values."""
        return {
            "samples": self.samples,
            "fallback_share": self.share(Source.FALLBACK),
            "blend_share": self.share(Source.BLEND),
            "faulty": self.faulty,
            "faults": dict(self.faults),
            "alarms": dict(self.alarms),
            "alarms_began_s": self.began_s,
        }

    def __str__(self) -> str:
        """One line for a person."""
        text = f"{self.samples} samples, {self.share(Source.FALLBACK):.1%} by the fallback"
        if self.sources[Source.BLEND]:
            text += f", {self.share(Source.BLEND):.1%} blended"
        if by_twins := self.share(Source.TWINS):
            wrong = [f"{name} from {self.began_s[name]:g} s" for name in _WRONG if name in self.began_s]
            text += f", {by_twins:.1%} by twins as the sensor was wrong ({', '.join(wrong)})"
        text += f", {self.faulty} with faults"
        if self.faults:
            text += f" ({', '.join(f'{name} {count}' for name, count in self.faults.most_common())})"
        return text
