"""Recording of a live stream: an MCAP file that grows while an estimator runs, and survives a kill.

A live stream may contain anything: time stamps that repeat, go back or are of another clock, commands and
angles that are missing or absurd. The recording has the form of a measured log, whatever comes:

| in the stream | in the recording |
|---|---|
| a sample that the estimator took in | a message on each of the four topics, at one time |
| its pull is missing or implausible | `/command` holds the last one |
| its angle is missing or implausible | no message on `/measurement` |
| an angle was wanted at it, by the sample before or an earlier one | a message on `/reference` |
| it is ignored: its time stamp is late, of another clock or none; or no pull has come yet | `/health` alone |
"""

import collections
import contextlib
import errno
import math
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from twin import __version__
from twin.files.atomic import PartialFile
from twin.live.reading import Health
from twin.recording.chunks import CHUNK_SIZE, GrowingChunk
from twin.recording.container import Container
from twin.recording.endotwin_pb2 import Command, Estimate, Measurement
from twin.recording.endotwin_pb2 import Health as HealthMessage
from twin.recording.messages import (
    HEALTH_TOPIC,
    LARGEST_TIME,
    REFERENCE_TOPIC,
    estimate_message,
    estimate_topic,
    health_message,
)
from twin.recording.reader import HINT
from twin.recording.writer import METADATA_RECORD, metadata_texts
from twin.signals.sensor import LARGEST_BEND_DEG, LARGEST_PULL_MM, LARGEST_TIME_S

if TYPE_CHECKING:
    from twin.live.reading import StreamSample

SIGN = "endotwin live"
"""Library in the header of each live recording, which distinguishes it from other MCAP files."""
FLUSH_S = 0.75  # longest time that a sample waits to be written [s]; at most a second is lost in a kill
_MANY = 1000  # samples, about a full chunk: they are written at once
_MOST = 8192  # samples that wait; with more, `add` waits for the disk
_SEQUENCES = 2**32
_STAMP_REFUSED = Health.NO_TIME | Health.LATE | Health.CLOCK_JUMP
_LONGEST_STEP_S = 10.0  # between two samples of one clock
_LEAST_STEP = 10_000  # [ns] between two samples of a recording: seconds since 1970 resolve 0.2 us


class LiveMessages:
    """Messages of the samples of one stream, in order; `samples` had a command, those `ignored` had none."""

    def __init__(self, method: str, *, controlled: bool = False) -> None:
        self._estimate = estimate_topic(method)
        self.schemas: dict[str, Any] = {
            "/command": Command,
            "/measurement": Measurement,
            self._estimate: Estimate,
            HEALTH_TOPIC: HealthMessage,
        }
        if controlled:
            self.schemas[REFERENCE_TOPIC] = Estimate
        self.samples = self.ignored = 0
        self._clock = RecordClock()
        self._pull_mm: float | None = None
        self._reference_deg = math.nan  # of the sample that comes next

    def of(self, sample: "StreamSample") -> tuple[int, int, dict[str, Any]] | None:
        """Return log time, publish time [ns] and messages by topic of the next sample; None before a stamp.

        The log time never goes back; the publish time is the sender's stamp, if it has one that fits.
        """
        reading = sample.reading
        time_s = _within(sample.time_s, LARGEST_TIME_S)
        pull_mm = _within(sample.pull_mm, LARGEST_PULL_MM)
        measured_deg = _within(sample.measurement_deg, LARGEST_BEND_DEG)
        at = self._clock.at(time_s, reading.health)
        if not math.isnan(pull_mm) and Health.IMPLAUSIBLE_PULL not in reading.health:
            self._pull_mm = pull_mm
        messages = {HEALTH_TOPIC: health_message(reading)}
        if at is None or self._pull_mm is None:
            self.ignored += 1
            at = self._clock.latest if at is None else at
        else:
            self.samples += 1
            messages["/command"] = Command(pull_mm=self._pull_mm)
            messages[self._estimate] = estimate_message(reading.bend_deg, *(reading.interval_deg or ()))
            if not math.isnan(measured_deg):
                messages["/measurement"] = Measurement(measured_deg=measured_deg)
            if not math.isnan(self._reference_deg):
                messages[REFERENCE_TOPIC] = estimate_message(self._reference_deg)
            if REFERENCE_TOPIC in self.schemas:
                wanted = _within(sample.reference_deg, LARGEST_BEND_DEG)
                self._reference_deg = self._reference_deg if math.isnan(wanted) else wanted
        if at is None:
            return None
        return at, round(time_s * 1e9) if time_s >= 0 else at, messages


def _within(value: float, largest: float) -> float:
    """Return a number, NaN unless its magnitude is at most `largest`; integers may exceed all floats."""
    return float(value) if abs(value) <= largest else math.nan


class RecordClock:
    """Log times of a stream: its time stamps, as long as they go on.

    A stamp that the estimator refused has no time of its own. Where the estimator accepts another clock
    (`Health.CLOCK_RESET`), or has restarted on an earlier one, the recording goes on without a jump: by one
    step for each sample since the last that counted. A recording begins at its first stamp, at 0 if that is
    negative. Samples that follow each other within 10 us are moved apart.
    """

    def __init__(self) -> None:
        self.latest: int | None = None  # the latest log time [ns]
        self._offset = 0  # [ns] from the stamps of the sender's clock to log times
        self._before_s = 0.0  # the previous stamp, accepted or not
        self._stamp = 0  # [ns] the last that counted
        self._step = _LEAST_STEP  # [ns] between the last two stamps of one clock
        self._since = 0  # stamps since the last that counted

    def at(self, time_s: float, health: Health = Health.GOOD) -> int | None:
        """Return the log time of a stamp [s] with faults, after all others [ns]; None if it is refused."""
        self._since += 1
        step_s, self._before_s = time_s - self._before_s, time_s
        if 0 < step_s <= _LONGEST_STEP_S:
            self._step = max(_LEAST_STEP, round(step_s * 1e9))
        if not abs(time_s) <= LARGEST_TIME_S or health & _STAMP_REFUSED:
            return None
        stamp = round(time_s * 1e9)
        if self.latest is None:
            log_time = max(0, stamp)
            self._offset = log_time - stamp
        elif Health.CLOCK_RESET in health or stamp <= self._stamp:
            log_time = self.latest + self._since * self._step
            self._offset = log_time - stamp
        else:
            log_time = max(stamp + self._offset, self.latest + _LEAST_STEP)
        if log_time > LARGEST_TIME:  # in three hundred years
            return None
        self.latest, self._stamp, self._since = log_time, stamp, 0
        return log_time


class LiveRecording:
    """Context manager: an MCAP file of the samples of a live stream and of their readings.

    ```
    with LiveRecording("run.mcap", "RAM (twins)", {}) as recording:
        recording.add(sample)
    ```

    While it runs, the file is `run.mcap.partial`; `close`, or the end of the block, makes it `run.mcap`,
    which `read_episode` reads as a measured log. What was `run.mcap` stays until then. A killed process or
    a full disk leaves `run.mcap.partial`, complete but for the last second; the next recording of that name
    keeps it and grows as `run.mcap.partial.2`. Without any message, no file is left.

    A thread of its own writes: `add` never waits for the disk, unless more than 8192 samples do.
    """

    def __init__(
        self,
        path: str | Path,
        method: str,
        metadata: Mapping[str, Any] | None = None,
        *,
        controlled: bool = False,
    ) -> None:
        self.path = Path(path)
        self.stream = LiveMessages(method, controlled=controlled)
        facts = {"source": "measured", "method": method, "name": self.path.stem, "endotwin": __version__}
        self._metadata = facts | dict(metadata or {})
        self._pending: collections.deque[tuple[int, int, int, list[tuple[int, bytes]]]] = collections.deque()
        self._wake, self._room, self._ending = threading.Event(), threading.Event(), threading.Event()
        self._failure: Exception | None = None
        self._thread: threading.Thread | None = None
        self._count = 0  # of samples, with or without messages
        self._messages = 0

    def __enter__(self) -> "LiveRecording":
        texts = metadata_texts(self._metadata)
        self._file = PartialFile(self.path, SIGN)
        self.partial = self._file.partial
        try:
            self._container = Container(self._file, library=SIGN)
            self._container.add_metadata(METADATA_RECORD, texts)
            self._channels = {
                topic: self._container.add_channel(topic, message.DESCRIPTOR)
                for topic, message in self.stream.schemas.items()
            }
        except BaseException:
            self._file.remove()
            raise
        self._thread = threading.Thread(target=self._write, name="live recording", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with contextlib.suppress(*([] if error is None else [Exception])):  # that of the block goes first
            self.close()

    def add(self, sample: "StreamSample") -> None:
        """Record the next sample; an `OSError` names the file, which is complete up to then."""
        self._refuse()
        timed = self.stream.of(sample)
        number, self._count = self._count, self._count + 1
        if timed is None:
            return
        log_time, publish_time, messages = timed
        payloads = [(self._channels[topic], of.SerializeToString()) for topic, of in messages.items()]
        self._pending.append((number % _SEQUENCES, log_time, publish_time, payloads))
        if len(self._pending) >= _MANY:
            self._wake.set()
        while len(self._pending) >= _MOST:
            self._room.wait(FLUSH_S)
            self._room.clear()
            self._refuse()

    def close(self) -> None:
        """Complete the file and give it its final name; a second call does nothing."""
        if self._thread is None:
            return
        self._ending.set()
        self._wake.set()
        self._thread.join()
        self._thread = None
        self._refuse()

    def _refuse(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _write(self) -> None:
        """Write what is pending, again and again: in a thread of its own, which no signal interrupts."""
        synced = time.monotonic()
        try:
            ending = False
            while not ending:
                self._wake.wait(FLUSH_S)
                self._wake.clear()
                ending = self._ending.is_set()
                self._write_pending()
                if time.monotonic() - synced >= FLUSH_S:
                    self._file.sync()
                    synced = time.monotonic()
            if self._messages == 0:
                self._file.remove()
                return
            self._container.finish()
            self._file.complete()
        except Exception as failure:
            if isinstance(failure, OSError) and failure.errno == errno.ENOSPC:
                failure.strerror = f"{failure.strerror}{HINT}"
            self._failure = failure
            self._file.close()
        finally:
            self._room.set()

    def _write_pending(self) -> None:
        chunk = GrowingChunk()
        while self._pending:
            sequence, log_time, publish_time, payloads = self._pending.popleft()
            for channel, data in payloads:
                chunk.add(channel, sequence, log_time, publish_time, data)
                self._messages += 1
            if chunk.size >= CHUNK_SIZE:
                self._container.add_chunk(chunk.content())
                chunk = GrowingChunk()
                self._room.set()
        if chunk.size:
            self._container.add_chunk(chunk.content())
        self._room.set()
