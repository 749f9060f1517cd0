"""Table of a CSV file: the columns that are asked for, as numbers, within limits; errors name the line.

Rows are read by the standard `csv` module, some at a time: a log of many columns takes no more memory than
one of few, and a long one no more than its numbers.
"""

import csv
import dataclasses
import itertools
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, MissingFileError
from twin.files.bounded import open_regular, sha256_of
from twin.signals.sensor import LARGEST_PULL_MM, LARGEST_TIME_S

Array = NDArray[np.float64]
ANGLE_UNITS = {"deg": np.pi / 180, "rad": 1.0}  # [rad]
LENGTH_UNITS = {"mm": 1e-3, "m": 1.0}  # [m]
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}  # [s]; `rad` is a phase, played at a rate of its own
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
_UTF_16 = ("\udcff\udcfe", "\udcfe\udcff")  # its marks, as bytes that are no UTF-8
_MOST_TEXTS = 100  # of a column that are no numbers, kept for messages
_NAMES_SHOWN = 120  # [characters]


@dataclasses.dataclass(frozen=True)
class Column:
    """One column."""

    values: Array  # (N,) NaN where the text is no finite number
    wrong: Rows  # (N,) True where the text is neither a finite number nor a missing value
    texts: Mapping[int, str]  # texts of the first wrong rows, by line


@dataclasses.dataclass(frozen=True)
class CsvTable:
    """Columns of a CSV file with a header."""

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

    def first_of(self, names: Sequence[str]) -> str:
        """Return the first of some names that is a column of the file."""
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
            name: Column(column.values[rows], column.wrong[rows], column.texts)
            for name, column in self.columns.items()
        }
        return dataclasses.replace(self, lines=self.lines[rows], columns=columns)

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


def read_columns(path: Path, names: Collection[str], what: str = "file") -> CsvTable:
    """Read columns of a CSV file; blank lines are skipped.

    The header shows whether commas, semicolons or tabs separate fields. Decimals have a point, or all of them
    a comma where commas do not separate fields.
    """
    if not path.exists():
        raise MissingFileError(f"no {what} {path}")
    if not path.is_file():
        kind = "a folder" if path.is_dir() else "a pipe or a device"
        raise InputError(f"{path} is {kind}: must be a CSV file")
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{path} has more than {MOST_BYTES >> 30} GiB, the most that is read")
    lines = _lines(path)
    blank = 0
    header = ""
    for header in lines:
        if header.strip():
            break
        blank += 1
    separator = _separator(path, header, names)
    # The blank lines are counted, not kept: there may be millions.
    rest = itertools.chain(itertools.repeat("\n", blank), [header] if header.strip() else [], lines)
    reader = csv.reader(rest, delimiter=separator, strict=True)
    ends = array("q")
    rows = _rows(path, reader, separator, ends)
    columns = next(rows, [])
    header_names = _checked_names(path, columns)
    places = {name: place for place, name in enumerate(header_names) if name in names}
    growing = {name: _Growing(separator != ",") for name in places}
    while batch := list(itertools.islice(rows, max(_CELLS_AT_ONCE // max(len(columns), 1), 1))):
        if len(ends) > MOST_ROWS + 1:
            line = ends[MOST_ROWS + 1]
            raise InputError(f"{path} line {line}: more than {MOST_ROWS} rows, the most of a log")
        for name, place in places.items():
            growing[name].add([row[place] for row in batch], ends[-len(batch) :])
    if len(ends) < 2:
        raise InputError(f"{path} holds no lines of data")
    _refuse_two_decimals(path, growing)
    found = {name: column.finish() for name, column in growing.items()}
    return CsvTable(path, header_names, np.array(ends[1:]), found, sha256_of(path))


def _lines(path: Path) -> Iterator[str]:
    """Yield the lines of a file in UTF-8, with their ends; bytes of other encodings are refused."""
    # Spreadsheets put a mark before the header, which is no part of the first name.
    with open(
        open_regular(path, "a CSV file"), encoding="utf-8-sig", errors="surrogateescape", newline=""
    ) as file:
        for number in itertools.count(1):
            line = file.readline(LONGEST_LINE + 1)
            if not line:
                return
            if len(line) > LONGEST_LINE:
                raise InputError(
                    f"{path} line {number} has more than {LONGEST_LINE} characters: "
                    f"{path.name:.40} is not a CSV file"
                )
            if not line.isascii():
                if number == 1 and line.startswith(_UTF_16):
                    raise InputError(f"{path} is not a CSV file in UTF-8: it is in UTF-16, save it as UTF-8")
                try:
                    line.encode()
                except UnicodeEncodeError as error:
                    raise InputError(
                        f"{path} is not a CSV file in UTF-8: line {number} holds the byte "
                        f"0x{ord(line[error.start]) - 0xDC00:02x} of another encoding, save it as UTF-8"
                    ) from error
            if "\0" in line:
                raise InputError(
                    f"{path} is not a CSV file: line {number} holds a NUL byte, as binary files do, or text "
                    "in UTF-16: save it as UTF-8"
                )
            yield line


def _separator(path: Path, header: str, names: Collection[str]) -> str:
    """Return what separates fields: of several, what leaves the most of the columns that are asked for."""
    fields = {separator: _fields(header, separator) for separator in SEPARATORS}
    held = [separator for separator, split in fields.items() if len(split) > 1]
    if len(held) < 2:
        return held[0] if held else ","
    matches = {separator: len(set(fields[separator]) & set(names)) for separator in held}
    best, second = sorted(held, key=lambda separator: -matches[separator])[:2]
    if matches[best] == matches[second]:
        words = " and ".join(SEPARATORS[separator] for separator in held)
        raise InputError(
            f"{path}: its header has {words}, and does not tell which of them separate the columns: "
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
            columns = columns or len(row)
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
    def __init__(self, may_have_commas: bool) -> None:
        self.decimals: dict[str, tuple[int, str]] = {}  # first number with a point, with a comma: its line
        self._commas = may_have_commas
        self._values: list[Array] = []
        self._wrong: list[Rows] = []
        self._texts: dict[int, str] = {}

    def add(self, texts: list[str], lines: "array[int]") -> None:
        values = _numbers(texts, self._commas)
        wrong = np.zeros(len(texts), bool)
        for row in np.flatnonzero(np.isnan(values)).tolist():
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

    def finish(self) -> Column:
        return Column(np.concatenate(self._values), np.concatenate(self._wrong), self._texts)


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
    ending = name.lower().rpartition("_")[2] if "_" in name else ""
    if ending not in units:
        raise InputError(f"{table.path}: column {name} does not end in its unit: give `{parameter}`, {valid}")
    return ending


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
    advice = "check `command_unit`" + (f" and {advice}" if unit in ANGLE_UNITS else "")
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
