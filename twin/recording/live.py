"""Recording of a live stream: an MCAP file that grows while an estimator runs, and outlives a kill."""

import collections
import contextlib
import errno
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from twin import __version__
from twin.files.atomic import PartialFile
from twin.recording.chunks import CHUNK_SIZE, GrowingChunk
from twin.recording.container import Container
from twin.recording.live_messages import LiveMessages, LiveSample
from twin.recording.reader import HINT
from twin.recording.writer import METADATA_RECORD, metadata_texts

SIGN = "endotwin live"
"""Name of the library in the header of each live recording: how one is known from other MCAP files."""

FLUSH_S = 0.75
"""Longest time that a sample waits to be written [s]; at most a second is lost in a kill."""

_MANY = 1000  # samples, about a full chunk: they are written at once
_MOST = 8192  # samples that wait; whoever adds more waits for the disk
_SEQUENCES = 2**32


class LiveRecording:
    """Context manager: an MCAP file that takes samples of a live stream, and what an estimator made of them.

    ```
    with LiveRecording("run.mcap", "RAM (twins)", {}) as recording:
        recording.add(sample)
    ```

    While it runs, the file is `run.mcap.partial`; `close`, or the end of the block for whatever reason, makes
    it `run.mcap`: an indexed MCAP file, which `read_episode` reads as a measured log. What was `run.mcap`
    stays until then. A killed process leaves `run.mcap.partial`, whole but for the last second, which
    `recover_episode` and other readers of MCAP read; the next recording of that name leaves it alone and
    grows as `run.mcap.partial.2`. After a full disk too, what was written before is there. Without any
    message, no file is left and what was `run.mcap` stays.

    A thread of its own writes: `add` never waits for the disk, unless more than 8192 samples do.

    `live_messages` says which messages a sample has; a sample that the estimator ignored has one on /health.
    """

    def __init__(
        self,
        path: str | Path,
        method: str,
        metadata: Mapping[str, Any] | None = None,
        *,
        controlled: bool = False,
    ) -> None:
        """Name the file; nothing is opened yet.

        Args:
            path: the final name.
            method: name of the estimator.
            metadata: facts of the run, as of an episode. `source` is `measured`, `method` the method, and
                `name` the file's, if not given.
            controlled: whether samples may tell which angle is wanted.
        """
        self.path = Path(path)
        self._stream = LiveMessages(method, controlled=controlled)
        facts = {"source": "measured", "method": method, "name": self.path.stem, "endotwin": __version__}
        self._metadata = facts | dict(metadata or {})
        self._pending: collections.deque[_Pending] = collections.deque()
        self._wake, self._room, self._ending = threading.Event(), threading.Event(), threading.Event()
        self._failure: Exception | None = None
        self._thread: threading.Thread | None = None
        self._count = 0  # of samples, with or without messages
        self._messages = 0

    @property
    def samples(self) -> int:
        """Number of samples that were recorded with a command."""
        return self._stream.samples

    @property
    def ignored(self) -> int:
        """Number of samples that the estimator ignored: recorded by their health alone, or not at all."""
        return self._stream.ignored

    @property
    def partial(self) -> Path:
        """Name that the file has while it grows."""
        return self._file.partial

    def __enter__(self) -> "LiveRecording":
        """Make the file and begin to write.

        Raises:
            FileNotFoundError: the folder does not exist.
            ValueError: the name is taken by what no live recording left, another run is writing it, or the
                metadata is not JSON or a known key of it not of its kind.
            OSError: the disk is full or fails.
        """
        texts = metadata_texts(self._metadata)
        self._file = PartialFile(self.path, SIGN)
        try:
            self._container = Container(self._file, library=SIGN)
            self._container.add_metadata(METADATA_RECORD, texts)
            self._channels = {
                topic: self._container.add_channel(topic, message.DESCRIPTOR)
                for topic, message in self._stream.schemas.items()
            }
        except BaseException:
            self._file.remove()
            raise
        self._thread = threading.Thread(target=self._write, name="live recording", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Complete the file, whatever ended the block; an error of the block goes before one of the file.

        Raises:
            OSError: the disk is full or fails.
            ValueError: what no live recording left has taken the final name.
        """
        if error is None:
            self.close()
            return
        with contextlib.suppress(Exception):
            self.close()

    def add(self, sample: LiveSample) -> None:
        """Record the next sample.

        Raises:
            OSError: the disk is full or fails; the error names the file, which is there up to then.
        """
        self._refuse()
        timed = self._stream.of(sample)
        number, self._count = self._count, self._count + 1
        if timed is None:
            return
        payloads = [(self._channels[topic], m.SerializeToString()) for topic, m in timed.messages.items()]
        self._pending.append(_Pending(number % _SEQUENCES, timed.log_time, timed.publish_time, payloads))
        if len(self._pending) >= _MANY:
            self._wake.set()
        while len(self._pending) >= _MOST:
            self._room.wait(FLUSH_S)
            self._room.clear()
            self._refuse()

    def close(self) -> None:
        """Complete the file and give it its final name; a second call does nothing.

        Raises:
            OSError: the disk is full or fails.
            ValueError: what no live recording left has taken the final name.
        """
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
        """Write what is pending, again and again: the only thread that touches the file.

        Signals are exceptions in the main thread alone, so that none can come between two parts of a record.
        """
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


class _Pending(NamedTuple):
    """Messages that wait to be written: serialised, with the channel of each."""

    sequence: int
    log_time: int
    publish_time: int
    payloads: list[tuple[int, bytes]]
