"""Learning curves for TensorBoard: events beside `progress.csv`, as its rows come."""

import contextlib
import csv
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import require_extra
from twin.files.run_folder import CURVE_FILE

if TYPE_CHECKING:
    from tensorboard.summary.writer.event_file_writer import EventFileWriter

EVENTS_FOLDER = "tensorboard"
_TAG = "training/"


class Board:
    """Events of runs, each in a folder of its own in that of the run.

    A row is written once: a run that was stopped goes back to its checkpoint, and tells some rows again.
    """

    def __init__(self, folders: Sequence[Path]):
        require_extra("tensorboard", "--tensorboard")
        self._runs = [_Events(folder) for folder in folders]

    def __call__(self) -> None:
        """Write the rows that are new; a disk that is full is no reason to stop a training."""
        for events in self._runs:
            with contextlib.suppress(OSError):
                events.follow()

    def close(self) -> None:
        """End."""
        for events in self._runs:
            with contextlib.suppress(OSError):
                events.close()


class _Events:
    """Events of one run.

    Attributes:
        last: samples of the latest row that has been written.
        read: when the curve that was read last had been written [ns].
        writer: of events, once there is one.
    """

    def __init__(self, folder: Path):
        self.curve, self.folder = folder / CURVE_FILE, folder / EVENTS_FOLDER
        self.last = -1
        self.read = 0
        self.writer: EventFileWriter | None = None

    def follow(self) -> None:
        from tensorboard.compat.proto.event_pb2 import Event
        from tensorboard.compat.proto.summary_pb2 import Summary
        from tensorboard.summary.writer.event_file_writer import EventFileWriter

        written = self.curve.stat().st_mtime_ns if self.curve.is_file() else 0
        if written == self.read:
            return
        self.read = written
        if self.writer is None:
            self.last = _last_step(self.folder)
            self.writer = EventFileWriter(str(self.folder))
        with self.curve.open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if int(row["samples"]) > self.last]
        for row in rows:
            self.last = int(row.pop("samples"))
            values = [
                Summary.Value(tag=_TAG + name, simple_value=float(value))
                for name, value in row.items()
                if value and math.isfinite(float(value))
            ]
            self.writer.add_event(Event(wall_time=time.time(), step=self.last, summary=Summary(value=values)))
        self.writer.flush()

    def close(self) -> None:
        if self.writer is not None:
            self.writer.close()


def _last_step(folder: Path) -> int:
    """Return the samples of the latest row that a folder has events of; -1 if there is none."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    if not folder.is_dir():
        return -1
    told = EventAccumulator(str(folder), size_guidance={"scalars": 1})
    told.Reload()
    steps = [event.step for tag in told.Tags()["scalars"] for event in told.Scalars(tag)]
    return max(steps, default=-1)
