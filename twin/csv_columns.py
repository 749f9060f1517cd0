"""Columns of numbers from a CSV file that somebody else made; a fault is named with its line."""

import csv
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class CsvColumns:
    """A CSV file with a header; a column is read as numbers only when it is asked for."""

    path: Path
    names: tuple[str, ...]
    """The header."""
    lines: tuple[int, ...]
    """(N,) line of the file that each row of data ends on; the first line is 1."""
    rows: tuple[Sequence[str], ...]
    """(N,) rows of data, as text."""

    def column(self, name: str) -> Array:
        """Return a column (N,) of numbers.

        Raises:
            ValueError: there is no such column, or two; or a value is not a finite number.
        """
        if self.names.count(name) != 1:
            count = "no" if name not in self.names else "more than one"
            raise ValueError(f"{self.path} has {count} column {name}; its columns: {', '.join(self.names)}")
        index = self.names.index(name)
        values = np.empty(len(self.rows))
        for number, (line, row) in enumerate(zip(self.lines, self.rows, strict=True)):
            text = row[index] if index < len(row) else ""
            try:
                values[number] = float(text)
            except ValueError:
                values[number] = np.nan
            if not np.isfinite(values[number]):
                raise ValueError(f"{self.path} line {line}: {name} is {text!r:.40}, not a finite number")
        return values

    def first_of(self, names: Sequence[str]) -> str:
        """Return the first of some names that is a column.

        Raises:
            ValueError: none is.
        """
        for name in names:
            if name in self.names:
                return name
        raise ValueError(
            f"{self.path} has no column {' or '.join(names)}; its columns: {', '.join(self.names)}"
        )

    def time(self, name: str) -> Array:
        """Return a column (N,) of times or phases: it may stand still from row to row, but not go back.

        Raises:
            ValueError: as `column`, or the column runs backwards.
        """
        values = self.column(name)
        backwards = np.diff(values) < 0
        if backwards.any():
            raise ValueError(
                f"{self.path} line {self.lines[int(backwards.argmax()) + 1]}: {name} runs backwards"
            )
        return values


def read_columns(path: Path) -> CsvColumns:
    """Read a CSV file; blank lines are passed over.

    Raises:
        ValueError: it is not a CSV file, or holds no lines of data.
        OSError: it cannot be read.
    """
    try:
        # Spreadsheets put a mark before the header, which is no part of the first name.
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            names = tuple(name.strip() for name in next(reader, []))
            numbered = [(reader.line_num, row) for row in reader if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} is not a CSV file") from error
    if not numbered:
        raise ValueError(f"{path} holds no lines of data")
    lines, rows = zip(*numbered, strict=True)
    return CsvColumns(path, names, lines, rows)


def average_repeats(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the instants (M,) of a time that may repeat, and the mean values (M, ...) at each.

    Args:
        time: (N,) times.
        values: (N, ...) what was read at those times.
    """
    instants, index, counts = np.unique(time, return_inverse=True, return_counts=True)
    sums = np.zeros((len(instants), *values.shape[1:]))
    np.add.at(sums, index, values)
    return instants, sums / counts.reshape(-1, *[1] * (values.ndim - 1))
