"""Columns of numbers of a CSV file, as `csv_reader` reads them; errors name the line."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

Array = NDArray[np.float64]

MOST_LATE = 0.1
"""Largest share of rows that may run backwards in time; a log with more is not in order."""

_NAMES_SHOWN = 120  # [characters]


@dataclasses.dataclass(frozen=True)
class CsvColumn:
    """One column.

    Attributes:
        values: (N,) NaN where the text is no finite number.
        odd: (N,) where the text is no finite number, one more than its place in `texts`; else 0.
        texts: the texts that are no finite numbers, and whether each means a missing value.
    """

    values: Array
    odd: NDArray[np.uint16]
    texts: tuple[tuple[str, bool], ...]

    def only(self, rows: "NDArray[np.bool_] | slice") -> "CsvColumn":
        """Return the rows selected by a mask (N,) or a slice."""
        return CsvColumn(self.values[rows], self.odd[rows], self.texts)

    def wrong(self, may_miss: bool) -> NDArray[np.bool_]:
        """Return the mask (N,) of the texts that may not stand there."""
        if not may_miss:
            return self.odd > 0
        wrong = np.array([False, *(not missing for _, missing in self.texts)])
        return wrong[self.odd]


@dataclasses.dataclass(frozen=True)
class CsvColumns:
    """Table of a CSV file with a header: the columns that were asked for.

    Attributes:
        path: the file, for messages.
        names: all column names of the header.
        lines: line of the file on which each row ends, (N,); the first line is 1.
        columns: the columns that were asked for and are there, by name.
        sha256: of the file, in hexadecimal.
    """

    path: Path
    names: tuple[str, ...]
    lines: NDArray[np.int64]
    columns: Mapping[str, CsvColumn]
    sha256: str

    def column(self, name: str, *, may_miss: bool = False) -> Array:
        """Return a column of numbers, (N,).

        Args:
            name: which, of those that were asked for.
            may_miss: allow missing values (see `numbers.MISSING`), which become NaN.

        Raises:
            ValueError: there is no such column, or two; or a value is not a finite number.
        """
        if self.names.count(name) != 1:
            count = "no" if name not in self.names else "more than one"
            raise InputError(f"{self.path} has {count} column {shown_name(name)}; {self._its_columns()}")
        column = self.columns[name]
        wrong = column.wrong(may_miss)
        if wrong.any():
            row = int(wrong.argmax())
            text, _ = column.texts[column.odd[row] - 1]
            raise InputError(
                f"{self.path} line {self.lines[row]}: {shown_name(name)} is {text!r:.40}, not a finite number"
            )
        return column.values.copy()

    def first_of(self, names: Sequence[str]) -> str:
        """Return the first of some names that is a column of the file.

        Raises:
            ValueError: none is.
        """
        for name in names:
            if name in self.names:
                return name
        wanted = " or ".join(map(shown_name, names))
        raise InputError(f"{self.path} has no column {wanted}; {self._its_columns()}")

    def _its_columns(self) -> str:
        """Return the column names for a message, as many as there is room for."""
        shown, rest = "", list(self.names)
        while rest and len(shown) < _NAMES_SHOWN:
            shown += (", " if shown else "") + shown_name(rest.pop(0))
        return f"its columns: {shown}" + (f" and {len(rest)} more" if rest else "")

    def time(self, name: str) -> Array:
        """Return a column of times or phases, (N,): it may stand still from row to row, but not go back.

        Raises:
            ValueError: as `column`, or the column runs backwards.
        """
        values = self.column(name)
        backwards = np.diff(values) < 0
        if backwards.any():
            line = self.lines[int(backwards.argmax()) + 1]
            raise InputError(f"{self.path} line {line}: {shown_name(name)} runs backwards")
        return values

    def part(self, begin: int, end: int) -> "CsvColumns":
        """Return the table of the rows from one to before another."""
        return self.only(slice(begin, end))

    def only(self, rows: "NDArray[np.bool_] | slice") -> "CsvColumns":
        """Return the table of the rows selected by a mask (N,) or a slice, with their line numbers."""
        columns = {name: column.only(rows) for name, column in self.columns.items()}
        return dataclasses.replace(self, lines=self.lines[rows], columns=columns)

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


def shown_name(name: str) -> str:
    """Return the name of a column for a message: cut, and without what cannot be printed."""
    cut = name if len(name) <= 40 else f"{name[:37]}..."
    return cut if cut.isprintable() and cut else repr(cut)


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
