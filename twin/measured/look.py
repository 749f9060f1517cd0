"""Likely contents of a table of a laboratory: the role of each column, and the command that imports it."""

import dataclasses
import re
import shlex
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from twin.measured.formats import is_text, read_table
from twin.measured.log import LogFormat
from twin.measured.table import (
    ANGLE_UNITS,
    LENGTH_UNITS,
    TIME_UNITS,
    Column,
    CsvTable,
    column_names,
    shown_name,
    unit_in,
)

ROLES: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "time": (r"time|stamp|phase|zeit|temps|clock|date|^t\b", TIME_UNITS | {"rad": 1.0}),
    "command": (
        r"pull|command|cmd|counts|motor|drive|servo|encoder|zug|setpoint|stroke|pos",
        LENGTH_UNITS | ANGLE_UNITS,
    ),
    "angle": (r"angle|bend|theta|winkel|tip|tilt|deflection|phi", ANGLE_UNITS),
}
"""Words in the name of a column of each role, and the units that it may have."""
_COUNTS = re.compile(r"count|encoder|tick", re.IGNORECASE)
_FRACTION = re.compile(r"nsec|nanosec|usec|microsec|fraction", re.IGNORECASE)


@dataclasses.dataclass(frozen=True)
class Guess:
    """Columns of a table, and their roles."""

    table: CsvTable
    no_header: bool
    roles: Mapping[str, str]  # name of the column of each role that was found, `fraction` of a second too

    def options(self) -> dict[str, tuple[str, ...]]:
        """Return the options of `import` that read the file; what is not known is a word in capitals."""
        found: dict[str, tuple[str, ...]] = {}
        for role, (_, units) in ROLES.items():
            name = self.roles.get(role, "COLUMN")
            column = self.table.columns.get(name)
            found[f"{role}_column"] = (name,)
            if role == "time" and "fraction" in self.roles:
                found["time_column"] += (self.roles["fraction"],)
            if column is None or (column.unit or unit_in(name)) not in units:
                known = np.empty(0) if column is None else column.known
                step = float(np.median(np.abs(np.diff(known)))) if len(known) > 1 else 0.0
                likely = (unit for unit, size in TIME_UNITS.items() if 1e-3 <= step * size <= 2)
                found[f"{role}_unit"] = (next(likely, "UNIT") if role == "time" else "UNIT",)
                if role == "command" and _COUNTS.search(name):
                    found |= {"command_scale": ("UNITS_PER_COUNT",), "command_zero": ("COUNTS_AT_ZERO",)}
        return found

    def command(self) -> str:
        """Return the command that imports the file."""
        words = ["endotwin", "import", str(self.table.path), *(["--no-header"] if self.no_header else [])]
        for name, values in self.options().items():
            words += [f"--{name.replace('_', '-')}", *values]
        return f"{shlex.join(words)} --out data/measured"

    def form(self) -> LogFormat | None:
        """Return the format of the file; None where a column or a unit is not known."""
        options = self.options()
        if any(values in (("COLUMN",), ("UNIT",)) for values in options.values()):
            return None
        fraction = options["time_column"][1] if len(options["time_column"]) > 1 else None
        given = {name: values[0] for name, values in options.items()}
        return LogFormat(**given, time_fraction_column=fraction, no_header=self.no_header)  # type: ignore[arg-type]

    def lines(self) -> list[list[str]]:
        """Return a line for each column: its name, role, range and share of values that are missing."""
        of_name = {name: role for role, name in self.roles.items()}
        found = []
        for name, column in self.table.columns.items():
            known = column.known
            ends = f"{known.min():.6g} to {known.max():.6g}" if known.size else "no numbers"
            missing = 1 - known.size / len(column.values)
            found.append([shown_name(name), of_name.get(name, ""), ends, f"{missing:.0%}" if missing else ""])
        return found


def look(path: Path) -> Guess:
    """Read a table of any columns, and guess their roles by their names and values."""
    names, no_header = column_names(path) if is_text(path) else (None, False)
    table = read_table(path, names, times=names or (), no_header=no_header)
    return Guess(table, no_header, _roles(table))


def _roles(table: CsvTable) -> dict[str, str]:
    left = {name: column for name, column in table.columns.items() if _varies(column)}
    roles: dict[str, str] = {}
    for role, (words, units) in ROLES.items():
        fitting = [name for name in left if _fits(name, left[name], role, words, units)]
        best = sorted(fitting, key=lambda name: -len(re.findall(words, name.lower())))
        if not best and role == "time":
            best = [name for name in left if _rises(left[name])]
        if best:
            roles[role] = best[0]
            del left[best[0]]
        if role == "time":
            more = [name for name in left if _FRACTION.search(name)]
            if more and not _FRACTION.search(roles.get("time", "nsec")):
                roles["fraction"] = more[0]
                del left[more[0]]
    if len(unknown := ROLES.keys() - roles.keys()) == len(left) == 1:  # there is no other
        roles[unknown.pop()] = left.popitem()[0]
    return roles


def _fits(name: str, column: Column, role: str, words: str, units: Mapping[str, float]) -> bool:
    unit = column.unit or unit_in(name)
    if not re.search(words, name.lower()):
        return False
    if unit in {*TIME_UNITS, *LENGTH_UNITS, *ANGLE_UNITS} and unit not in units:
        return False
    return role != "time" or _rises(column) or bool(_FRACTION.search(name))


def _varies(column: Column) -> bool:
    known = column.known
    return known.size > 1 and bool(np.ptp(known) > 0)


def _rises(column: Column) -> bool:
    known = column.known
    return known.size > 1 and bool((np.diff(known) >= 0).mean() > 0.9) and bool(known[-1] > known[0])
