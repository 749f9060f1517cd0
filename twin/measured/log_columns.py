"""Columns of a measured log in SI units: command, measured angle, tensions and the bend of the sheath."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.measured.log_format import LARGEST_SHEATH_BEND_DEG, SHEATH_BEND_COLUMN, LogFormat
from twin.measured.table import CsvTable
from twin.measured.units import ANGLE_UNITS, column_unit, pulling_distance, refuse_implausible
from twin.signals.plausible import LARGEST_BEND_DEG

Array = NDArray[np.float64]

# Plausible limits beside the shared ones: a value beyond them is in another unit than stated.
_TENSION_N = (-5.0, 1000.0)  # an unloaded load cell may drift below zero


def commanded_pull(table: CsvTable, form: LogFormat, name: str) -> tuple[Array, str]:
    """Return the pulling distance (N,) [m] that a column commands, NaN where missing, and its unit."""
    return pulling_distance(
        table, name, form.command_unit, form.pulley_radius, "`pulley_radius`", may_miss=True
    )


def refuse_standstill(table: CsvTable, name: str) -> None:
    """Refuse a command that does not move.

    Raises:
        ValueError: it does not, or is missing in every row.
    """
    values = table.column(name, may_miss=True)
    known = values[~np.isnan(values)]
    if not known.size:
        raise InputError(f"{table.path}: {name} is missing in every row")
    if known.min() == known.max():
        raise InputError(f"{table.path}: {name} is {known[0]:g} in every row: a log without motion")


def measured_angle(table: CsvTable, form: LogFormat, name: str, *, reverse: bool) -> tuple[Array, str]:
    """Return the measured angle (N,) [rad] of a column, turned or not, NaN where missing, and its unit."""
    values = table.column(name, may_miss=True)
    unit = column_unit(table, name, form.angle_unit, ANGLE_UNITS, "angle_unit")
    bend = values * ANGLE_UNITS[unit] * (-1 if reverse else 1)
    limits = (-LARGEST_BEND_DEG, LARGEST_BEND_DEG)
    with np.errstate(over="ignore"):
        degrees = np.degrees(bend)
    refuse_implausible(table, name, degrees, "deg", limits, "check `angle_unit`")
    return bend, unit


def sheath_bend(table: CsvTable, form: LogFormat) -> tuple[str | None, Array]:
    """Return the column of the bend of the sheath, None without one, and its angles (N,) or (0,) [rad].

    Raises:
        ValueError: an angle is missing, no number or implausible.
    """
    name = SHEATH_BEND_COLUMN
    if form.sheath_bend_deg is not None or name not in table.names:
        return None, np.empty(0)
    bend = table.column(name)
    advice = "give `sheath_bend_deg`"
    refuse_implausible(table, name, bend, "deg", (0.0, LARGEST_SHEATH_BEND_DEG), advice)
    return name, np.radians(bend)


def tensions(
    table: CsvTable, form: LogFormat, on_warning: Callable[[str], None] | None
) -> tuple[list[str], Array]:
    """Return the names of both tension columns, and their tensions (N, 2) [N]; none of one wire alone.

    Raises:
        ValueError: a column that is asked for is not there; a tension is missing, no number or implausible.
    """
    names = _tension_columns(table, form, on_warning)
    columns = [table.column(name) for name in names]
    for name, tension in zip(names, columns, strict=True):
        refuse_implausible(table, name, tension, "N", _TENSION_N, "a tension is read in newton")
    return list(names), np.column_stack(columns) if columns else np.empty((len(table.lines), 0))


def _tension_columns(
    table: CsvTable, form: LogFormat, on_warning: Callable[[str], None] | None
) -> tuple[str, ...]:
    """Return the names of both tension columns, or none: one wire alone is of no use."""
    names = (form.tension_a_column or "tension_a_n", form.tension_b_column or "tension_b_n")
    found = [name for name in names if name in table.names]
    asked_for = form.tension_a_column is not None or form.tension_b_column is not None
    if form.lateral_command_column is not None:
        rule = "tensions of a log of two bending planes are not read"
        if asked_for:
            raise InputError(f"{table.path}: {rule}: leave out `tension_a_column` and `tension_b_column`")
        if found and on_warning:
            on_warning(f"{table.path} has {' and '.join(found)}: {rule}")
        return ()
    if len(found) == 2 or asked_for:
        return names
    if found and on_warning:
        (missing,) = set(names) - set(found)
        on_warning(f"{table.path} has {found[0]} but no {missing}: no tension is recorded")
    return ()
