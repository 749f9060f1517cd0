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
        self._last = dict.fromkeys(folders, -1)  # samples of the latest row that has been written
        self._writers: dict[Path, EventFileWriter] = {}

    def __call__(self) -> None:
        """Write the rows that are new; a disk that is full is no reason to stop a training."""
        for folder in self._last:
            with contextlib.suppress(OSError):
                self._follow(folder)

    def close(self) -> None:
        """End."""
        for writer in self._writers.values():
            with contextlib.suppress(OSError):
                writer.close()

    def _follow(self, folder: Path) -> None:
        from tensorboard.compat.proto.event_pb2 import Event
        from tensorboard.compat.proto.summary_pb2 import Summary
        from tensorboard.summary.writer.event_file_writer import EventFileWriter

        if not (folder / CURVE_FILE).is_file():
            return
        if folder not in self._writers:
            for former in (folder / EVENTS_FOLDER).glob("events.out.tfevents.*"):
                former.unlink()
            self._writers[folder] = EventFileWriter(str(folder / EVENTS_FOLDER))
        with (folder / CURVE_FILE).open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if int(row["samples"]) > self._last[folder]]
        for row in rows:
            step = self._last[folder] = int(row.pop("samples"))
            values = [
                Summary.Value(tag=f"training/{name}", simple_value=float(value))
                for name, value in row.items()
                if value and math.isfinite(float(value))
            ]
            event = Event(wall_time=time.time(), step=step, summary=Summary(value=values))
            self._writers[folder].add_event(event)
        self._writers[folder].flush()
