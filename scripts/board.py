"""Learning curves for TensorBoard: events next to `progress.csv`, as its rows come."""

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


class Board:
    """Events of runs, each in a folder of its own in that of the run; a new board replaces them."""

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
            if events.writer is not None:
                with contextlib.suppress(OSError):
                    events.writer.close()


class _Events:
    """Events of one run."""

    def __init__(self, folder: Path):
        self.curve, self.folder = folder / CURVE_FILE, folder / EVENTS_FOLDER
        self.last = -1  # samples of the latest row that has been written
        self.writer: EventFileWriter | None = None

    def follow(self) -> None:
        from tensorboard.compat.proto.event_pb2 import Event
        from tensorboard.compat.proto.summary_pb2 import Summary
        from tensorboard.summary.writer.event_file_writer import EventFileWriter

        if not self.curve.is_file():
            return
        if self.writer is None:
            for former in self.folder.glob("events.out.tfevents.*"):
                former.unlink()
            self.writer = EventFileWriter(str(self.folder))
        with self.curve.open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if int(row["samples"]) > self.last]
        for row in rows:
            self.last = int(row.pop("samples"))
            values = [
                Summary.Value(tag=f"training/{name}", simple_value=float(value))
                for name, value in row.items()
                if value and math.isfinite(float(value))
            ]
            self.writer.add_event(Event(wall_time=time.time(), step=self.last, summary=Summary(value=values)))
        self.writer.flush()
