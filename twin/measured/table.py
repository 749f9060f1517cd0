"""Table of a CSV file: the columns that are asked for, as numbers, within limits; errors name the line.

Rows are read by the standard `csv` module, some at a time: a log of many columns takes no more memory than
one of few, and a long one no more than its numbers.
"""

import codecs
import contextlib
import csv
import dataclasses
import datetime
import io
import itertools
import re
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, MissingFileError
from twin.files.bounded import opened, sha256_of
from twin.signals.sensor import LARGEST_PULL_MM, LARGEST_TIME_S

Array = NDArray[np.float64]
ANGLE_UNITS = {"deg": np.pi / 180, "rad": 1.0}  # [rad]
LENGTH_UNITS = {"mm": 1e-3, "m": 1.0}  # [m]
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # [s]; `rad` is a phase, at a rate of its own
_UNIT_NAMES = {
    **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("msec", "msecs", "millisec", "milliseconds"), "ms"),
    **dict.fromkeys(("usec", "usecs", "\xb5s", "\u03bcs", "microsec", "microseconds"), "us"),
    **dict.fromkeys(("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds"), "ns"),
    **dict.fromkeys(("degree", "degrees", "\xb0"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
}
"""Other names of units, in lower case."""
TIME_COLUMNS = ("time_s", "phase_rad")  # names of the column of the time, the first of which counts
SECONDS_PER_CYCLE = 20.0
"""Period at which a command with phases instead of times is played [s]: slow, quasi-static."""
LARGEST_CYCLE = 1e6  # longest duration of a phase of 2 pi [s]


Rows = NDArray[np.bool_]
MISSING = frozenset({"", "nan", "-nan", "na", "n/a", "#n/a", "null", "none"})
"""Texts that mean a missing value, in lower case."""
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
"""Separators that are read, and their names; decimals may have a comma where none separates fields."""

MOST_BYTES = 4 * 2**30  # largest size of a file [bytes]
LONGEST_LINE = 2**20  # largest length of a line [characters]: a file without line ends would fill the memory
MOST_ROWS = 10_000_000  # largest number of rows
MOST_LATE = 0.1  # largest share of rows that may run backwards in time; a log with more is not in order
_CELLS_AT_ONCE = 2**18  # fields that are held as text: about 15 MB
_OTHER_SEPARATORS = {"|": "bars", " ": "spaces"}
_PLAIN = b"0123456789.+-eE \t"  # of a number; `float` takes more, such as 1_000 and infinity
_MARKS = {codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16", codecs.BOM_UTF8: "utf-8-sig"}
_HEADER_WITHIN = 100  # first lines that a header is looked for in
_COMMENT = "#"  # begins a line that is no row
_MOST_TEXTS = 100  # of a column that are no numbers, kept for messages
_NAMES_SHOWN = 120  # [characters]


class MissingColumnError(InputError):
    """A column that a file does not have."""


@dataclasses.dataclass(frozen=True)
class Column:
    """One column."""

    values: Array  # (N,) NaN where the text is no finite number
    wrong: Rows  # (N,) True where the text is neither a finite number nor a missing value
    texts: Mapping[int, str]  # texts of the first wrong rows, by line
    unit: str = ""  # of a row of units below the header; s of dates, which are seconds since 1970

    @property
    def known(self) -> Array:
        """Values that are numbers."""
        known: Array = self.values[~np.isnan(self.values)]
        return known


@dataclasses.dataclass(frozen=True)
class CsvTable:
    """Columns of a CSV file."""

    path: Path  # the file, for messages
    names: tuple[str, ...]  # all column names of the header
    lines: NDArray[np.int64]  # (N,) line of the file on which each row ends; the first line is 1
    columns: Mapping[str, Column]  # the columns that were asked for and are there, by name
    sha256: str  # SHA-256 of the file, in hexadecimal

    def column(self, name: str, *, may_miss: bool = False) -> Array:
        """Return a column of numbers (N,); missing values, if allowed, are NaN."""
        if self.names.count(name) != 1:
            count = "no" if name not in self.names else "more than one"
            raise InputError(f"{self.path} has {count} column {shown_name(name)}; {self._its_columns()}")
        column = self.columns[name]
        wrong = column.wrong if may_miss else np.isnan(column.values)
        if wrong.any():
            row = int(wrong.argmax())
            line = self.lines[row]
            found = f"{column.texts.get(line, 'a text')!r:.40}, not a finite number"
            found = found if column.wrong[row] else "missing"
            raise InputError(f"{self.path} line {line}: {shown_name(name)} is {found}")
        return column.values.copy()

    def first_of(self, names: Sequence[str], others: Sequence[str] = ()) -> str:
        """Return the first of some names that is a column of the file; the others must be columns too.

        One message names all that the file lacks.
        """
        found = [name for name in names if name in self.names]
        lacking = [] if found else [" or ".join(map(shown_name, names))]
        lacking += [shown_name(name) for name in others if name not in self.names]
        if lacking:
            raise MissingColumnError(
                f"{self.path} has no column {' and no '.join(lacking)}; {self._its_columns()}"
            )
        return found[0]

    def _its_columns(self) -> str:
        """Return the column names for a message, as many as there is room for."""
        shown, rest = "", list(self.names)
        while rest and len(shown) < _NAMES_SHOWN:
            shown += (", " if shown else "") + shown_name(rest.pop(0))
        return f"its columns: {shown}" + (f" and {len(rest)} more" if rest else "")

    def time(self, name: str) -> Array:
        """Return a column of times or phases (N,), which may stand still from row to row, but not go back."""
        values = self.column(name)
        backwards = np.diff(values) < 0
        if backwards.any():
            line = self.lines[int(backwards.argmax()) + 1]
            raise InputError(f"{self.path} line {line}: {shown_name(name)} runs backwards")
        return values

    def only(self, rows: Rows | slice) -> "CsvTable":
        """Return the table of the rows selected by a mask (N,) or a slice, with their line numbers."""
        columns = {
            name: dataclasses.replace(column, values=column.values[rows], wrong=column.wrong[rows])
            for name, column in self.columns.items()
        }
        return dataclasses.replace(self, lines=self.lines[rows], columns=columns)

    def filled(self, name: str, values: Array) -> "CsvTable":
        """Return the table with other values (N,) in a column."""
        column = dataclasses.replace(self.columns[name], values=values)
        return dataclasses.replace(self, columns={**self.columns, name: column})

    def moved(self, name: str, by: Array) -> "CsvTable":
        """Return the table with something added to a column (N,), which then begins at zero."""
        values = self.column(name)
        return self.filled(name, values - values[0] + by)

    def timed(self, name: str, on_warning: Callable[[str], None] | None = None) -> "CsvTable":
        """Return the rows that have a time; one warning counts the others."""
        missing = np.isnan(self.column(name, may_miss=True))
        if missing.all():
            raise InputError(f"{self.path}: {name} is missing in every row")
        if missing.any() and on_warning:
            on_warning(f"{self.count(missing, f'{name} is missing')}: such rows are dropped")
        return self.only(~missing)

    def in_order(self, name: str, on_warning: Callable[[str], None] | None = None) -> "CsvTable":
        """Return the table without rows before the latest time so far; one warning counts them."""
        time = self.column(name)
        late = time < np.maximum.accumulate(time)
        if late.mean() > MOST_LATE:
            raise InputError(f"{self.count(late, f'{name} runs backwards')}: at most {MOST_LATE:.0%} may")
        if late.any() and on_warning:
            on_warning(f"{self.count(late, f'{name} runs backwards')}: such rows are dropped")
        return self.only(~late)

    def count(self, rows: Rows, what: str) -> str:
        """Describe a mask of rows (N,) in words: their number, and the line of the first."""
        line = self.lines[int(rows.argmax())]
        return f"{self.path} line {line}: {what}, as in {rows.sum()} of {len(rows)} rows"


def read_columns(
    path: Path,
    names: Collection[str],
    what: str = "file",
    *,
    times: Collection[str] = (),
    no_header: bool = False,
) -> CsvTable:
    """Read columns of a CSV file; blank lines and comments are skipped.

    The header is the line of the first ones that names the most of the columns. It shows whether commas,
    semicolons or tabs separate fields. Without a header, columns have their numbers as names. Decimals have a
    point, or all of them a comma where commas do not separate fields. Columns of `times` may hold dates.
    """
    if not path.exists():
        raise MissingFileError(f"no {what} {path}")
    if not path.is_file():
        kind = "a folder" if path.is_dir() else "a pipe or a device"
        raise InputError(f"{path} is {kind}: must be a CSV file")
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{path} has more than {MOST_BYTES >> 30} GiB, the most that is read")
    lines = _lines(path, _encoding(path))
    blank = 0
    first: list[str] = []
    for text in lines:
        if text.strip() or first:
            first.append(text)
        else:
            blank += 1  # counted, not kept: there may be millions
        if len(first) == _HEADER_WITHIN:
            break
    place = _header_place(first, names)
    header = first[place] if first else ""
    separator = _separator(path, header, names)
    if no_header:
        place = 0
    elif _are_numbers(_fields(header, separator), separator):
        raise InputError(
            f"{path} line {blank + place + 1} holds numbers: the file has no header, give `no_header`, and "
            "columns by their numbers, from 1"
        )
    above = itertools.repeat("\n", blank + place)
    rest = itertools.chain(above, first[place:], lines)
    reader = csv.reader(
        ("\n" if line[0] == _COMMENT else line for line in rest), delimiter=separator, strict=True
    )
    ends = array("q")
    rows = _rows(path, reader, separator, ends)
    columns = next(rows, [])
    if no_header:
        rows = itertools.chain([columns], rows)
        header_names = tuple(str(number + 1) for number in range(len(columns)))
        ends.insert(0, 0)
    else:
        header_names = _checked_names(path, columns)
    places = {name: place for place, name in enumerate(header_names) if name in names}
    growing = {name: _Growing(separator != ",", name in times) for name in places}
    units: dict[str, str] = {}
    while batch := list(itertools.islice(rows, max(_CELLS_AT_ONCE // max(len(columns), 1), 1))):
        if len(ends) > MOST_ROWS + 1:
            line = ends[MOST_ROWS + 1]
            raise InputError(f"{path} line {line}: more than {MOST_ROWS} rows, the most of a log")
        if len(ends) == len(batch) + 1 and (
            units := _units_of({n: batch[0][at] for n, at in places.items()})
        ):
            del batch[0], ends[1]
        for name, place in places.items():
            growing[name].add([row[place] for row in batch], ends[len(ends) - len(batch) :])
    if len(ends) < 2:
        raise InputError(f"{path} holds no lines of data")
    _refuse_two_decimals(path, growing)
    found = {name: column.finish(units.get(name, "")) for name, column in growing.items()}
    return CsvTable(path, header_names, np.array(ends[1:]), found, sha256_of(path))


def _are_numbers(fields: Sequence[str], separator: str) -> bool:
    """Return whether fields are those of a row, not of a header."""
    return len(fields) > 1 and not np.isnan(_numbers(fields, separator != ",")).any()


def column_names(path: Path) -> tuple[tuple[str, ...], bool]:
    """Return the names of all columns of a file whose names are not known, and whether it has no header.

    The header is the line before the first row of numbers, and of as many fields; a row of units may follow.
    """
    first = list(itertools.islice(_lines(path, _encoding(path)), _HEADER_WITHIN))
    lines = [line for line in first if line.strip() and line[0] != _COMMENT]
    if not lines:
        raise InputError(f"{path} holds no lines of data")
    found = {mark: [_fields(line, mark) for line in lines] for mark in SEPARATORS}
    mark = max(SEPARATORS, key=lambda mark: _usual_count([len(of) for of in found[mark]]))
    split = found[mark]
    row = next((at for at, fields in enumerate(split) if _is_row(fields, mark)), len(lines))
    if row == 0:
        return tuple(str(number + 1) for number in range(len(split[0]))), True
    head = row - 1
    if head and _units_of(dict(enumerate(filter(None, split[head])))):  # type: ignore[arg-type]
        head -= 1
    return tuple(name for name in split[head] if name), False


def _usual_count(counts: Sequence[int]) -> int:
    """Return how many lines have the most frequent number of fields, if that is more than one."""
    several = [count for count in counts if count > 1]
    return max(map(several.count, several), default=0)


def _is_row(fields: Sequence[str], mark: str) -> bool:
    """Return whether a line holds a number, and none of its fields is a text, but for dates."""
    known = [text for text in fields if text.lower() not in MISSING and np.isnan(_seconds(text))]
    return bool(known) and len(fields) > 1 and not np.isnan(_numbers(known, mark != ",")).any()


def _encoding(path: Path) -> str:
    """Return the encoding of a text: by its mark, else UTF-8, else that of Windows."""
    with opened(path, "a CSV file") as file:
        begin = file.read(3)
        for mark, name in _MARKS.items():
            if begin.startswith(mark):
                return name
        decode = codecs.getincrementaldecoder("utf-8")().decode
        try:
            decode(begin)
            while part := file.read(2**20):
                decode(part)
            decode(b"", final=True)
        except UnicodeDecodeError:
            return "cp1252"
    return "utf-8"


def _lines(path: Path, encoding: str) -> Iterator[str]:
    """Yield the lines of a file, with their ends."""
    with opened(path, "a CSV file") as raw:
        file = io.TextIOWrapper(raw, encoding=encoding, errors="replace", newline="")
        for number in itertools.count(1):
            line = file.readline(LONGEST_LINE + 1)
            if not line:
                return
            if len(line) > LONGEST_LINE:
                raise InputError(
                    f"{path} line {number} has more than {LONGEST_LINE} characters: "
                    f"{path.name:.40} is not a CSV file"
                )
            if "\0" in line:
                raise InputError(
                    f"{path} is not a CSV file: line {number} holds a NUL byte, as binary files do, or text "
                    "in UTF-16 without a mark: save it as UTF-8"
                )
            yield line


def _header_place(lines: Sequence[str], names: Collection[str]) -> int:
    """Return which of the first lines is the header: the one with the most names, else the first of text."""
    found = [
        0 if line[0] == _COMMENT else max(len({*_fields(line, mark)} & {*names}) for mark in SEPARATORS)
        for line in lines
    ]
    if any(found):
        return found.index(max(found))
    return next((at for at, line in enumerate(lines) if line.strip() and line[0] != _COMMENT), 0)


def _units_of(texts: Mapping[str, str]) -> dict[str, str]:
    """Return the units in a row of units, by name; none where one of the texts is no unit."""
    known = {*ANGLE_UNITS, *LENGTH_UNITS, *TIME_UNITS, "n"}
    units = {name: _plain_unit(text.strip().strip("[]()")) for name, text in texts.items()}
    return units if units and known >= {*units.values()} else {}


def _separator(path: Path, header: str, names: Collection[str]) -> str:
    """Return the separator of fields: of several, the one that yields the most of the requested columns."""
    fields = {separator: _fields(header, separator) for separator in SEPARATORS}
    held = [separator for separator, split in fields.items() if len(split) > 1]
    if len(held) < 2:
        return held[0] if held else ","
    matches = {separator: len(set(fields[separator]) & set(names)) for separator in held}
    best, second = sorted(held, key=lambda separator: -matches[separator])[:2]
    if matches[best] == matches[second]:
        words = " and ".join(SEPARATORS[separator] for separator in held)
        raise InputError(
            f"{path}: its header has {words}, which may all separate columns: "
            "quote the names that hold the others"
        )
    return best


def _fields(header: str, separator: str) -> list[str]:
    """Return the names in the first line of a header by one separator; none where it cannot be."""
    try:
        return [name.strip() for name in next(csv.reader([header], delimiter=separator), [])]
    except csv.Error:
        return []


def _rows(path: Path, reader: Any, separator: str, ends: "array[int]") -> Iterator[list[str]]:
    """Yield the fields of each row that is not blank, the header first; append the lines where they end."""
    columns = 0
    try:
        for row in reader:
            if not row or (len(row) == 1 and not row[0].strip() and columns != 1):
                continue
            if not columns:
                while len(row) > 1 and not row[-1].strip():
                    row.pop()  # separators behind the last name
                columns = len(row)
            if len(row) > columns and not any(map(str.strip, row[columns:])):
                del row[columns:]
            if len(row) != columns:
                hint = ""
                if len(row) > columns and separator == ",":
                    hint = "; decimals need a point, a comma separates fields"
                elif len(row) < columns and _ends_within_line(path) and next(reader, None) is None:
                    hint = "; the file ends within this line: remove it if the logger was stopped there"
                count = "1 field" if len(row) == 1 else f"{len(row)} fields"
                raise InputError(f"{path} line {reader.line_num} has {count}, its header has {columns}{hint}")
            ends.append(reader.line_num)
            yield row
    except csv.Error as error:
        text, ended = str(error), ends[-1] if ends else 0
        if "unexpected end" in text:
            fault = f"line {ended + 1}: a quote of the row that begins here is never closed"
        elif "field larger" in text:
            most = csv.field_size_limit()
            fault = f"line {ended + 1}: a field has more than {most} characters: is a quote never closed?"
        else:
            fault = f"line {reader.line_num} is no line of a CSV file: {text}"
        raise InputError(f"{path} {fault}") from error


def _ends_within_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) not in b"\r\n"


def _checked_names(path: Path, header: list[str]) -> tuple[str, ...]:
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


class _Growing:
    def __init__(self, may_have_commas: bool, may_have_dates: bool) -> None:
        self._dates: list[Rows] = []
        self._may_have_dates = may_have_dates
        self.decimals: dict[str, tuple[int, str]] = {}  # first number with a point, with a comma: its line
        self._commas = may_have_commas
        self._values: list[Array] = []
        self._wrong: list[Rows] = []
        self._texts: dict[int, str] = {}

    def add(self, texts: list[str], lines: "array[int]") -> None:
        values = _numbers(texts, self._commas)
        wrong, dates = np.zeros((2, len(texts)), bool)
        for row in np.flatnonzero(np.isnan(values)).tolist():
            if self._may_have_dates and not np.isnan(second := _seconds(texts[row])):
                values[row], dates[row] = second, True
                continue
            wrong[row] = texts[row].strip().lower() not in MISSING
            if wrong[row] and len(self._texts) < _MOST_TEXTS:
                self._texts[lines[row]] = texts[row][:41]
        joined = "".join(texts) if self._commas else ""
        for mark in ".,":
            if mark in joined and mark not in self.decimals:
                for text, value, line in zip(texts, values, lines, strict=True):
                    if mark in text and not np.isnan(value):
                        self.decimals[mark] = line, text.strip()
                        break
        self._values.append(values)
        self._wrong.append(wrong)
        self._dates.append(dates)

    def finish(self, unit: str) -> Column:
        values, wrong = np.concatenate(self._values), np.concatenate(self._wrong)
        dates = np.concatenate(self._dates)
        if dates.any():  # a number among them is no time
            others = ~dates & ~np.isnan(values)
            values[others], wrong = np.nan, wrong | others
            unit = "s"
        return Column(values, wrong, self._texts, unit)


def _seconds(text: str) -> float:
    """Return the seconds since 1970 of a date and time, in UTC without a zone; NaN of other texts."""
    with contextlib.suppress(ValueError, OverflowError):
        moment = datetime.datetime.fromisoformat(text.strip())
        zoned = moment if moment.tzinfo else moment.replace(tzinfo=datetime.UTC)
        return (zoned - _EPOCH).total_seconds()
    return np.nan


_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


def _refuse_two_decimals(path: Path, columns: Mapping[str, _Growing]) -> None:
    """Refuse a file in which some numbers have a point and some a comma: one of them groups digits."""
    firsts = []
    for mark in ".,":
        found = [(*one.decimals[mark], name) for name, one in columns.items() if mark in one.decimals]
        if not found:
            return
        line, text, name = min(found)
        firsts.append(f"line {line}: {shown_name(name)} is {text!r:.40}")
    raise InputError(
        f"{path} {firsts[0]}, and {firsts[1]}: decimals must all have a point or all a comma, and nothing "
        "groups digits"
    )


def _numbers(texts: Sequence[str], comma: bool) -> Array:
    """Return the numbers of texts (N,), NaN where a text is no finite number; a comma may be the point."""
    if comma:
        texts = [text.replace(",", ".") for text in texts]  # two points are no number
    try:
        if "".join(texts).encode().translate(None, _PLAIN):
            raise ValueError
        values = np.fromiter(map(float, texts), float, len(texts))
    except ValueError:
        values = np.fromiter(map(_number, texts), float, len(texts))
    values[np.isinf(values)] = np.nan
    return values


def _number(text: str) -> float:
    try:
        return np.nan if text.encode().translate(None, _PLAIN) else float(text)
    except ValueError:
        return np.nan


def shown_name(name: str) -> str:
    """Return the name of a column for a message: cut, and without what cannot be printed."""
    cut = name if len(name) <= 40 else f"{name[:37]}..."
    return cut if cut.isprintable() and cut else repr(cut)


def average_repeats(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the distinct ones (M,) of times (N,), and the mean (M, ...) of values (N, ...) without NaN."""
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


def check_cycle(seconds_per_cycle: float) -> None:
    """Refuse a duration of a phase of 2 pi [s] that is out of range."""
    if not 0 < seconds_per_cycle <= LARGEST_CYCLE:
        raise InputError(
            f"seconds_per_cycle = {seconds_per_cycle:g}: must be positive, at most {LARGEST_CYCLE:g}"
        )


def column_unit(
    table: CsvTable, name: str, given: str | None, units: Mapping[str, float], parameter: str
) -> str:
    """Return the unit of a column: the one given by a parameter, or the ending of its name."""
    *most, last = units
    valid = f"{', '.join(most)} or {last}"
    if given is not None:
        if given not in units:
            raise InputError(f"{parameter} = {given}: must be {valid}")
        return given
    unit = table.columns[name].unit or unit_in(name)
    if unit not in units:
        raise InputError(f"{table.path}: column {name} does not end in its unit: give `{parameter}`, {valid}")
    return unit


def unit_in(name: str) -> str:
    """Return the unit that the name of a column ends in, as in `pull_mm`, `Pull [mm]` and `stamp.secs`."""
    in_brackets = re.search(r"[\[(]([^\[\]()]*)[\])]\s*$", name)
    if in_brackets:
        return _plain_unit(in_brackets[1])
    _, mark, ending = re.search(r"(.*?)([_.]?)([^_.]*)$", name).groups()  # type: ignore[union-attr]
    known = mark == "_" or ending.lower() in _UNIT_NAMES
    return _plain_unit(ending) if mark and known else ""


def _plain_unit(text: str) -> str:
    word = text.strip().lower()
    return _UNIT_NAMES.get(word, word)


def time_unit_of(
    table: CsvTable, name: str, given: str | None, seconds_per_cycle: float
) -> tuple[str, float]:
    """Return the unit of a column of times or phases, and what it is in seconds."""
    units = TIME_UNITS | {"rad": seconds_per_cycle / (2 * np.pi)}
    unit = column_unit(table, name, given, units, "time_unit")
    return unit, units[unit]


def refuse_implausible_times(table: CsvTable, name: str, unit: float) -> None:
    """Refuse a column of times in units of `unit` seconds that is out of any clock's range."""
    with np.errstate(over="ignore"):
        seconds = table.column(name) * unit
    refuse_implausible(table, name, seconds, "s", (-LARGEST_TIME_S, LARGEST_TIME_S), "check `time_unit`")


def pulling_distance(
    table: CsvTable, name: str, given: str | None, pulley_radius: float, advice: str, *, may_miss: bool
) -> tuple[Array, str]:
    """Return a command as a pulling distance (N,) [m], NaN where it is missing, and the unit of its column.

    The radius of the pulley [m] makes a distance of an angle; `advice` is what to check where that is
    implausible.
    """
    values = table.column(name, may_miss=may_miss)
    lengths = LENGTH_UNITS | {unit: size * pulley_radius for unit, size in ANGLE_UNITS.items()}
    unit = column_unit(table, name, given, lengths, "command_unit")
    with np.errstate(over="ignore"):
        pull = values * lengths[unit]
        millimetres = pull * 1e3
    rest = f" and {advice}" if unit in ANGLE_UNITS else "; counts of an encoder need `import --command-scale`"
    advice = f"check `command_unit`{rest}"
    limits = (-LARGEST_PULL_MM, LARGEST_PULL_MM)
    refuse_implausible(table, name, millimetres, "mm of pulling distance", limits, advice)
    return pull, unit


def refuse_implausible(
    table: CsvTable, name: str, values: Array, unit: str, limits: tuple[float, float], advice: str
) -> None:
    """Refuse values (N,) of a column that are out of their limits; the message names the first line."""
    low, high = limits
    wrong = (values < low) | (values > high)
    if wrong.any():
        row = int(wrong.argmax())
        raise InputError(
            f"{table.path} line {table.lines[row]}: {name} is {values[row]:g} {unit}, "
            f"which is not from {low:g} to {high:g}: {advice}"
        )
