"""Learning curves for TensorBoard: events beside `progress.csv`, as its rows come."""

import csv
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
    """Events of runs, each in a folder of its own in that of the run.

    A run that has events already, as it was stopped, gets those of the rows that follow.

    Raises:
        ImportError: TensorBoard is not installed.
    """

    def __init__(self, folders: Sequence[Path]):
        require_extra("tensorboard", "--tensorboard")
        self._folders = [_Events(folder) for folder in folders]

    def __call__(self) -> None:
        """Write the rows that are new."""
        for events in self._folders:
            events.follow()

    def close(self) -> None:
        """Write what is left and end."""
        self()
        for events in self._folders:
            events.close()


class _Events:
    """Events of one run.

    Attributes:
        shown: number of rows that have been written.
        read: when the file that was read last had been written [ns].
    """

    def __init__(self, folder: Path):
        self.curve, self.folder = folder / CURVE_FILE, folder / EVENTS_FOLDER
        self.shown = len(self.rows()) if self.folder.is_dir() else 0
        self.read = 0
        self.writer: EventFileWriter | None = None

    def rows(self) -> list[dict[str, str]]:
        if not self.curve.is_file():
            return []
        with self.curve.open(newline="") as file:
            return list(csv.DictReader(file))

    def follow(self) -> None:
        from tensorboard.compat.proto.event_pb2 import Event
        from tensorboard.compat.proto.summary_pb2 import Summary
        from tensorboard.summary.writer.event_file_writer import EventFileWriter

        written = self.curve.stat().st_mtime_ns if self.curve.is_file() else 0
        if written == self.read:
            return
        self.read = written
        rows = self.rows()
        if self.writer is None:
            self.writer = EventFileWriter(str(self.folder))
        for row in rows[self.shown :]:
            samples = int(row.pop("samples"))
            values = [
                Summary.Value(tag=f"training/{name}", simple_value=float(value))
                for name, value in row.items()
                if value
            ]
            self.writer.add_event(Event(wall_time=time.time(), step=samples, summary=Summary(value=values)))
        self.shown = len(rows)
        self.writer.flush()

    def close(self) -> None:
        if self.writer is not None:
            self.writer.close()
