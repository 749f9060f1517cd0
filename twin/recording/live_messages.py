"""Messages of a live stream: each sample, what an estimator made of it, and the time that it is recorded at.

A live stream may hold anything: time stamps that repeat, go back or are of another clock, commands and angles
that are missing or absurd. What is recorded has the form of a measured log, whatever comes:

| in the stream | in the record |
|---|---|
| a sample that the estimator took in | a message on each of the four topics, at one time |
| its pull is missing or implausible | `/command` holds the last one, as the estimator does |
| its angle is missing or implausible | no message on `/measurement` |
| an angle was wanted at it, as the sample before or an earlier one said | a message on `/reference` |
| it is ignored: its time stamp is late, of another clock or none; or no pull has come yet | `/health` alone |
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from twin.live.reading import Health
from twin.recording.endotwin_pb2 import Command, Estimate, Measurement
from twin.recording.endotwin_pb2 import Health as HealthMessage
from twin.recording.estimate import (
    HEALTH_TOPIC,
    REFERENCE_TOPIC,
    estimate_message,
    estimate_topic,
    health_message,
)
from twin.recording.messages import LARGEST_TIME
from twin.signals.sensor import LARGEST_BEND_DEG, LARGEST_PULL_MM, LARGEST_TIME_S

if TYPE_CHECKING:
    from twin.live.reading import Reading

_STAMP_REFUSED = Health.NO_TIME | Health.LATE | Health.CLOCK_JUMP
_LONGEST_STEP_S = 10.0  # between two samples of one clock; a longer one is no step
_LEAST_STEP = 10_000  # [ns] between two samples of a record: seconds since 1970 are told apart by 0.2 us


class LiveSample(Protocol):
    """One sample of a live stream, and what a running estimator made of it."""

    @property
    def time_s(self) -> float:
        """Time stamp, whatever the sender's clock says [s]."""

    @property
    def pull_mm(self) -> float:
        """Commanded pulling distance, NaN where there is none [mm]."""

    @property
    def measurement_deg(self) -> float:
        """Measured angle, NaN where there is none [deg]."""

    @property
    def reference_deg(self) -> float:
        """Angle that is wanted at the next sample, NaN where none is told [deg]."""

    @property
    def reading(self) -> "Reading":
        """Estimate, its interval and health."""


class TimedMessages(NamedTuple):
    """Messages of one sample.

    Attributes:
        log_time: time of the record, which never goes back [ns].
        publish_time: time stamp of the sender; `log_time` where it has none that fits [ns].
        messages: Protobuf message of each topic that has one.
    """

    log_time: int
    publish_time: int
    messages: dict[str, Any]


class LiveMessages:
    """Messages of the samples of one stream, in the order in which they come.

    Attributes:
        schemas: message class of each topic.
        samples: number of samples that had a command.
        ignored: number of those that had none: of health alone, or without any time.
    """

    def __init__(self, method: str, *, controlled: bool = False) -> None:
        """Prepare a stream.

        Args:
            method: name of the estimator.
            controlled: whether samples may tell which angle is wanted.
        """
        self._estimate = estimate_topic(method)
        self.schemas: dict[str, Any] = {
            "/command": Command,
            "/measurement": Measurement,
            self._estimate: Estimate,
            HEALTH_TOPIC: HealthMessage,
        }
        if controlled:
            self.schemas[REFERENCE_TOPIC] = Estimate
        self.samples = 0
        self.ignored = 0
        self._clock = RecordClock()
        self._pull_mm: float | None = None
        self._reference_deg = math.nan  # of the sample that comes next

    def of(self, sample: LiveSample) -> TimedMessages | None:
        """Return the messages of the next sample; None before the first time stamp."""
        reading = sample.reading
        time_s = _within(sample.time_s, LARGEST_TIME_S)
        pull_mm = _within(sample.pull_mm, LARGEST_PULL_MM)
        measurement_deg = _within(sample.measurement_deg, LARGEST_BEND_DEG)
        time = self._clock.at(time_s, reading.health)
        if not math.isnan(pull_mm) and Health.IMPLAUSIBLE_PULL not in reading.health:
            self._pull_mm = pull_mm
        messages = {HEALTH_TOPIC: health_message(reading)}
        if time is None or self._pull_mm is None:
            self.ignored += 1
            time = self._clock.latest if time is None else time
        else:
            self.samples += 1
            messages["/command"] = Command(pull_mm=self._pull_mm)
            messages[self._estimate] = estimate_message(reading.bend_deg, *(reading.interval_deg or ()))
            if not math.isnan(measurement_deg):
                messages["/measurement"] = Measurement(measured_deg=measurement_deg)
            if not math.isnan(self._reference_deg):
                messages[REFERENCE_TOPIC] = estimate_message(self._reference_deg)
            if REFERENCE_TOPIC in self.schemas:
                told = _within(sample.reference_deg, LARGEST_BEND_DEG)
                self._reference_deg = self._reference_deg if math.isnan(told) else told
        if time is None:
            return None
        return TimedMessages(time, round(time_s * 1e9) if time_s >= 0 else time, messages)


def _within(value: float, largest: float) -> float:
    """Return a number, NaN unless its magnitude is at most `largest`; integers may exceed all floats."""
    return float(value) if abs(value) <= largest else math.nan


class RecordClock:
    """Log times of a stream: its time stamps, as long as they go on.

    A stamp that the estimator refused has no time of its own. Where the estimator believes another clock
    (`Health.CLOCK_RESET`), or has begun anew on an earlier one, the record goes on without a jump: by one
    step for each sample since the last that counted. A record begins at its first stamp, at 0 if that is
    negative. Samples that follow each other within 10 us are moved apart.

    Attributes:
        latest: the latest log time [ns]; None before the first.
    """

    def __init__(self) -> None:
        """Begin before the first stamp."""
        self.latest: int | None = None
        self._offset = 0  # [ns] from the stamps of the sender's clock to log times
        self._before_s = 0.0  # the stamp before, believed or not
        self._stamp = 0  # [ns] the last that counted
        self._step = _LEAST_STEP  # [ns] between the last two stamps of one clock
        self._since = 0  # stamps since the last that counted

    def at(self, time_s: float, health: Health = Health.GOOD) -> int | None:
        """Return the log time of a sample, later than all before [ns]; None if its stamp does not count.

        Args:
            time_s: its stamp [s].
            health: its faults, as the estimator found them.
        """
        self._since += 1
        step_s, self._before_s = time_s - self._before_s, time_s
        if 0 < step_s <= _LONGEST_STEP_S:
            self._step = max(_LEAST_STEP, round(step_s * 1e9))
        if not abs(time_s) <= LARGEST_TIME_S or health & _STAMP_REFUSED:
            return None
        stamp = round(time_s * 1e9)
        if self.latest is None:
            time = max(0, stamp)
            self._offset = time - stamp
        elif Health.CLOCK_RESET in health or stamp <= self._stamp:
            time = self.latest + self._since * self._step
            self._offset = time - stamp
        else:
            time = max(stamp + self._offset, self.latest + _LEAST_STEP)
        if time > LARGEST_TIME:  # in three hundred years
            return None
        self.latest, self._stamp, self._since = time, stamp, 0
        return time
