"""Columns of numbers from a CSV file; errors name the line."""

import csv
import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

Array = NDArray[np.float64]

MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "#n/a", "null", "none"})
"""Texts that mean a missing value, in lower case."""

MOST_LATE = 0.1
"""Largest share of rows that may run backwards in time; a log with more is not in order."""


@dataclasses.dataclass(frozen=True)
class CsvColumns:
    """Table of a CSV file with a header; a column is converted to numbers only when it is read.

    Attributes:
        path: the file, for messages.
        names: column names of the header.
        lines: line of the file on which each row ends, (N,); the first line is 1.
        rows: rows of data as text, (N,).
    """

    path: Path
    names: tuple[str, ...]
    lines: tuple[int, ...]
    rows: tuple[Sequence[str], ...]

    def column(self, name: str, *, may_miss: bool = False) -> Array:
        """Return a column of numbers, (N,).

        Args:
            name: which.
            may_miss: allow missing values (see `MISSING`), which become NaN.

        Raises:
            ValueError: there is no such column, or two; or a value is not a finite number.
        """
        if self.names.count(name) != 1:
            count = "no" if name not in self.names else "more than one"
            raise InputError(f"{self.path} has {count} column {name}; its columns: {', '.join(self.names)}")
        index = self.names.index(name)
        values = np.empty(len(self.rows))
        for number, (line, row) in enumerate(zip(self.lines, self.rows, strict=True)):
            text = row[index] if index < len(row) else ""
            if may_miss and text.strip().lower() in MISSING:
                values[number] = np.nan
                continue
            try:
                values[number] = float(text)
            except ValueError:
                values[number] = np.nan
            if not np.isfinite(values[number]):
                raise InputError(f"{self.path} line {line}: {name} is {text!r:.40}, not a finite number")
        return values

    def first_of(self, names: Sequence[str]) -> str:
        """Return the first of some names that is a column of the file.

        Raises:
            ValueError: none is.
        """
        for name in names:
            if name in self.names:
                return name
        raise InputError(
            f"{self.path} has no column {' or '.join(names)}; its columns: {', '.join(self.names)}"
        )

    def time(self, name: str) -> Array:
        """Return a column of times or phases, (N,): it may stand still from row to row, but not go back.

        Raises:
            ValueError: as `column`, or the column runs backwards.
        """
        values = self.column(name)
        backwards = np.diff(values) < 0
        if backwards.any():
            raise InputError(
                f"{self.path} line {self.lines[int(backwards.argmax()) + 1]}: {name} runs backwards"
            )
        return values

    def only(self, rows: NDArray[np.bool_]) -> "CsvColumns":
        """Return the table of the rows selected by a mask (N,), with their line numbers."""
        kept = np.flatnonzero(rows)
        return dataclasses.replace(
            self, lines=tuple(self.lines[row] for row in kept), rows=tuple(self.rows[row] for row in kept)
        )

    def timed(self, name: str, on_warning: Callable[[str], None] | None = None) -> "CsvColumns":
        """Return the table of the rows that have a time; one warning counts the others.

        Raises:
            ValueError: as `column`, or no row has one.
        """
        missing = np.isnan(self.column(name, may_miss=True))
        if missing.all():
            raise InputError(f"{self.path}: {name} is missing in every row")
        if missing.any() and on_warning:
            on_warning(f"{self.count(missing, f'{name} is missing')}: such rows are dropped")
        return self.only(~missing)

    def in_order(self, name: str, on_warning: Callable[[str], None] | None = None) -> "CsvColumns":
        """Return the table without rows before the latest time so far; one warning counts them.

        Raises:
            ValueError: as `column`, or more than `MOST_LATE` of the rows run backwards.
        """
        time = self.column(name)
        late = time < np.maximum.accumulate(time)
        if late.mean() > MOST_LATE:
            raise InputError(f"{self.count(late, f'{name} runs backwards')}: at most {MOST_LATE:.0%} may")
        if late.any() and on_warning:
            on_warning(f"{self.count(late, f'{name} runs backwards')}: such rows are dropped")
        return self.only(~late)

    def count(self, rows: NDArray[np.bool_], what: str) -> str:
        """Describe a mask of rows (N,) in words: their number, and the line of the first."""
        line = self.lines[int(rows.argmax())]
        return f"{self.path} line {line}: {what}, as in {rows.sum()} of {len(rows)} rows"


def read_columns(path: Path) -> CsvColumns:
    """Read a CSV file; blank lines are skipped.

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
        raise InputError(f"{path} is not a CSV file") from error
    if not numbered:
        raise InputError(f"{path} holds no lines of data")
    lines, rows = zip(*numbered, strict=True)
    return CsvColumns(path, names, lines, rows)


def average_repeats(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the distinct times (M,) of a time that may repeat, and the mean values (M, ...) at each.

    Args:
        time: (N,) times.
        values: (N, ...) what was read at those times; NaN where a value is missing, which then does not
            count. A mean is NaN where all its values are missing.
    """
    instants, index = np.unique(time, return_inverse=True)
    known = ~np.isnan(values)
    sums, counts = (np.zeros((len(instants), *values.shape[1:])) for _ in range(2))
    np.add.at(sums, index, np.where(known, values, 0.0))
    np.add.at(counts, index, known)
    return instants, np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)


def hold(values: Array) -> Array:
    """Return values (N,) with each NaN replaced by the last value before it, where there is one."""
    last = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))))
    return values[last]
