"""Takers of the samples of `endotwin run`: a recording, a viewer, the pace of a log."""

import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scripts.command import complain

if TYPE_CHECKING:
    from twin.stream import Sink, StreamSample


class Sinks:
    """Several sinks as one; one that fails is left out from then on, and the stream goes on.

    Attributes:
        failed: number of those that failed.
    """

    def __init__(self, *sinks: "Sink | None", on_failure: Callable[[Exception], None]):
        self._sinks = [sink for sink in sinks if sink is not None]
        self._on_failure = on_failure
        self.failed = 0

    def add(self, sample: "StreamSample") -> None:
        """Hand a sample to each."""
        for sink in [*self._sinks]:
            try:
                sink.add(sample)
            except OSError as error:
                self._fail(sink, error)

    def close(self) -> None:
        """Close each."""
        while self._sinks:
            sink = self._sinks[-1]
            try:
                sink.close()
            except (OSError, ValueError) as error:
                self._fail(sink, error)
            else:
                self._sinks.pop()

    def _fail(self, sink: "Sink", error: Exception) -> None:
        self._sinks.remove(sink)
        self.failed += 1
        self._on_failure(error)
        with contextlib.suppress(OSError, ValueError):
            sink.close()


class Pace:
    """Sink that waits, so that a log takes as long as it took when it was recorded."""

    def __init__(self) -> None:
        self._offset_s: float | None = None

    def add(self, sample: "StreamSample") -> None:
        """Wait until the time of a sample."""
        now = time.monotonic()
        if self._offset_s is None:
            self._offset_s = now - sample.time_s
        time.sleep(max(sample.time_s + self._offset_s - now, 0.0))

    def close(self) -> None:
        """Do nothing."""


def live_recording(
    path: Path | None, method: str, facts: dict[str, Any], *, controlled: bool
) -> "Sink | None":
    """Begin the recording of a live stream, if one is asked for.

    Raises:
        ValueError: the name is taken by what no live recording left, or another run is writing it.
        OSError: the file cannot be made.
    """
    if path is None:
        return None
    from twin.recording.live import LiveRecording

    return LiveRecording(path, method, {"run": facts}, controlled=controlled).__enter__()


def live_viewer(host: str, port: int, method: str, *, controlled: bool) -> "Sink":
    """Begin to serve viewers, and say where.

    Raises:
        ImportError: the extra `live` is not installed.
        ValueError: the address is none of this machine, or in use.
    """
    from scripts.live import LiveViewer

    viewer = LiveViewer(host, port, method, controlled=controlled)
    complain(f"endotwin run: open {viewer.url} in Foxglove or Lichtblick")
    return viewer
