"""Units of the columns of a measured CSV file: named by the ending of a column's name, or given."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.measured.table import CsvTable
from twin.signals.sensor import LARGEST_PULL_MM, LARGEST_TIME_S

Array = NDArray[np.float64]

ANGLE_UNITS = {"deg": np.pi / 180, "rad": 1.0}  # [rad]
LENGTH_UNITS = {"mm": 1e-3, "m": 1.0}  # [m]
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}  # [s]; `rad` is a phase, played at a rate of its own

TIME_COLUMNS = ("time_s", "phase_rad")
"""Names of the column of the time, the first of which counts."""
SECONDS_PER_CYCLE = 20.0
"""Period at which a command with phases instead of times is played [s]: slow, quasi-static."""
LARGEST_CYCLE = 1e6
"""Longest duration of a phase of 2 pi [s]."""


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
