"""Reader of CSV files: the columns that are asked for, within limits; errors name the line.

A file is read row by row, and only the columns that are asked for are converted and kept: a log of many
columns takes no more memory than one of few.
"""

import csv
from array import array
from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.measured.csv_columns import CsvColumn, CsvColumns, shown_name
from twin.measured.csv_lines import CsvLines, open_lines
from twin.measured.csv_separator import SEPARATORS, lines_and_separator
from twin.measured.numbers import is_missing, to_numbers

Array = NDArray[np.float64]

MOST_ROWS = 10_000_000
"""Largest number of rows."""
MOST_COLUMNS = 10_000
"""Largest number of columns."""
MOST_TEXTS = 1000
"""Largest number of different texts in a column that are no numbers."""

_CELLS_AT_ONCE = 2**18  # fields that are held as text: about 15 MB
_BYTES_AT_ONCE = 2**23  # the same of long ones
_LONGEST_TEXT = 41  # of a text that is kept for a message, which shows 40 [characters]
_OTHER_SEPARATORS = {"|": "bars", " ": "spaces"}


def read_columns(path: Path, names: Collection[str], what: str = "file") -> CsvColumns:
    """Read columns of a CSV file; blank lines are skipped.

    Its header tells whether commas, semicolons or tabs separate fields. Decimals have a point, or all of them
    a comma where commas do not separate fields.

    Args:
        path: the file.
        names: the columns to read, those of them that are there.
        what: the file is, for the message where there is none.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not a CSV file, holds no lines of data, is too large, or has a row with more or
            fewer fields than its header.
        OSError: it cannot be read.
    """
    with open_lines(path, what) as lines:
        every_line, separator = lines_and_separator(lines, names)
        reader = csv.reader(every_line, delimiter=separator, strict=True)
        ended = 0  # line on which the row before ends
        try:
            header = next((row for row in reader if not _is_blank(row)), [])
            ended = reader.line_num
            table = _Growing(path, _checked_names(path, header), names, separator)
            for row in reader:
                if len(row) != len(header):
                    if _is_blank(row):
                        continue
                    raise _wrong_count(lines, len(row), len(header), separator)
                ended = reader.line_num
                table.add(row, ended, lines.bytes_read)
        except csv.Error as error:
            raise _wrong_quotes(path, ended + 1, lines.count, error) from error
        return table.finish(lines.sha256)


class _Growing:
    """Columns of a table that is being read."""

    def __init__(self, path: Path, header: tuple[str, ...], names: Collection[str], separator: str) -> None:
        self.path = path
        self.header = header
        self.lines = array("q")
        self._may_have_commas = separator != ","
        self._decimals: dict[str, str] = {}  # first number with a point, with a comma: where it stands
        self._places = {name: header.index(name) for name in header if name in names}
        self._values: dict[str, list[Array]] = {name: [] for name in self._places}
        self._odd: dict[str, list[NDArray[np.uint16]]] = {name: [] for name in self._places}
        self._texts: dict[str, dict[tuple[str, bool], int]] = {name: {} for name in self._places}
        self._rows: list[list[str]] = []
        self._most = max(_CELLS_AT_ONCE // max(len(header), 1), 1)
        self._flushed = 0

    def add(self, row: list[str], line: int, bytes_read: int) -> None:
        """Add a row that ends on a line of the file, of which so many bytes are read."""
        self._rows.append(row)
        self.lines.append(line)
        if len(self._rows) >= self._most or bytes_read - self._flushed > _BYTES_AT_ONCE:
            self._flush()
            self._flushed = bytes_read
            if len(self.lines) > MOST_ROWS:
                raise InputError(f"{self.path} line {line}: more than {MOST_ROWS} rows, the most of a log")

    def _flush(self) -> None:
        first = len(self.lines) - len(self._rows)
        for name, place in self._places.items():
            texts = [row[place] for row in self._rows]
            values = to_numbers(texts, comma=self._may_have_commas)
            if self._may_have_commas:
                self._refuse_two_decimals(name, texts, values, first)
            odd = np.zeros(len(texts), np.uint16)
            for row in np.flatnonzero(np.isnan(values)).tolist():
                odd[row] = self._place_of(name, texts[row], self.lines[first + row])
            self._values[name].append(values)
            self._odd[name].append(odd)
        self._rows = []

    def _refuse_two_decimals(self, name: str, texts: list[str], values: Array, first: int) -> None:
        """Refuse a file in which some numbers have a point and some a comma: one of them groups digits."""
        joined = "".join(texts)
        for mark in ".,":
            if mark in self._decimals or mark not in joined:
                continue
            for row, (text, value) in enumerate(zip(texts, values, strict=True)):
                if mark in text and not np.isnan(value):
                    place = f"line {self.lines[first + row]}: {shown_name(name)}"
                    self._decimals[mark] = f"{place} is {text.strip()!r:.40}"
                    break
        if len(self._decimals) > 1:
            point, comma = self._decimals["."], self._decimals[","]
            raise InputError(
                f"{self.path} {point}, and {comma}: decimals must all have a point or all a comma, and "
                "nothing groups digits"
            )

    def _place_of(self, name: str, text: str, line: int) -> int:
        """Return one more than the place of a text that is no number among those of a column."""
        known = self._texts[name]
        place = known.setdefault((text[:_LONGEST_TEXT], is_missing(text)), len(known) + 1)
        if place > MOST_TEXTS:
            raise InputError(
                f"{self.path} line {line}: {shown_name(name)} is {text!r:.40}, not a finite number, as are "
                f"{MOST_TEXTS} other texts before it"
            )
        return place

    def finish(self, sha256: str) -> CsvColumns:
        """Return the table.

        Raises:
            ValueError: it has no rows.
        """
        if not self.lines:
            raise InputError(f"{self.path} holds no lines of data")
        self._flush()
        columns = {
            name: CsvColumn(
                np.concatenate(self._values.pop(name)),
                np.concatenate(self._odd.pop(name)),
                tuple(self._texts[name]),
            )
            for name in self._places
        }
        return CsvColumns(self.path, self.header, np.array(self.lines), columns, sha256)


def _is_blank(row: list[str]) -> bool:
    return not row or (len(row) == 1 and not row[0].strip())


def _checked_names(path: Path, header: list[str]) -> tuple[str, ...]:
    """Return the column names of a header.

    Raises:
        ValueError: there are too many, or something else separates them.
    """
    if len(header) > MOST_COLUMNS:
        raise InputError(f"{path}: its header has {len(header)} columns, at most {MOST_COLUMNS} are read")
    names = tuple(name.strip() for name in header)
    if len(names) == 1:
        for separator, word in _OTHER_SEPARATORS.items():
            if separator in names[0]:
                *most, last = SEPARATORS.values()
                raise InputError(
                    f"{path}: its header has 1 column: fields must be separated by {', '.join(most)} or "
                    f"{last}, not by {word}"
                )
    return names


def _wrong_count(lines: CsvLines, fields: int, columns: int, separator: str) -> InputError:
    """Return the error of a row with more or fewer fields than the header."""
    hint = ""
    if lines.is_cut_off and fields < columns:
        hint = "; the file ends within this line: remove it if the logger was stopped there"
    elif fields > columns and separator == ",":
        hint = "; decimals need a point, a comma separates fields"
    counted = "1 field" if fields == 1 else f"{fields} fields"
    return InputError(f"{lines.path} line {lines.count} has {counted}, its header has {columns}{hint}")


def _wrong_quotes(path: Path, first: int, last: int, error: csv.Error) -> InputError:
    """Return the error of a row that `csv` cannot read, which begins and ends on these lines."""
    text = str(error)
    if "unexpected end" in text:
        return InputError(f"{path} line {first}: a quote of the row that begins here is never closed")
    if "field larger" in text:
        most = csv.field_size_limit()
        return InputError(
            f"{path} line {first}: a field has more than {most} characters: is a quote never closed?"
        )
    return InputError(f"{path} line {last} is no line of a CSV file: {text}")
