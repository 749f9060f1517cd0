"""A Parquet table in parts, `chunk-000/file-000.parquet` and so on: a new file begins where one is full."""

import contextlib
import os
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

CHUNK_FILES = 1000
"""Files in one `chunk-...` folder."""


class PartWriter:
    """Context manager: writes tables of one schema; each becomes one row group, which no file cuts in two."""

    def __init__(self, folder: Path, file_bytes: float) -> None:
        """Name the folder; nothing is made yet.

        Args:
            folder: where the `chunk-...` folders go.
            file_bytes: a table goes into a new file where it would probably make a file larger than this; one
                that is larger alone has a file alone.
        """
        self._folder = folder
        self._limit = file_bytes
        self._number = -1  # of the file, over all chunks
        self._rows = 0  # in this file
        self._writer: pq.ParquetWriter | None = None
        self._file: BinaryIO | None = None

    def __enter__(self) -> "PartWriter":
        """Begin."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Complete the last file; under an exception, leave it as it is, to be removed."""
        if kind is None:
            self._finish()
            return
        # What is left to write would fail as well, and so hide why.
        with contextlib.suppress(OSError, ValueError):
            if self._writer is not None:
                self._writer.close()
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()

    def place(self, rows: int) -> tuple[int, int]:
        """Open the file that the next table belongs into, and return the numbers of its chunk and itself.

        Args:
            rows: of the table, by which its size is estimated from those before it.
        """
        if self._file is None or (
            self._rows > 0 and self._file.tell() * (1 + rows / self._rows) > self._limit
        ):
            self._next()
        return divmod(self._number, CHUNK_FILES)

    def write(self, table: pa.Table) -> None:
        """Write a table into the file that `place` has opened."""
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._file, table.schema, compression="zstd")
        self._writer.write_table(table, row_group_size=max(len(table), 1))
        self._rows += len(table)

    def _next(self) -> None:
        self._finish()
        self._number += 1
        self._rows = 0
        chunk, file = divmod(self._number, CHUNK_FILES)
        path = self._folder / f"chunk-{chunk:03d}" / f"file-{file:03d}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("xb")

    def _finish(self) -> None:
        if self._writer is not None and self._file is not None:
            self._writer.close()
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
        self._writer = self._file = None
