"""Measured log of a real endoscope: commands and sensor readings of a CSV file, read as an episode.

Logs have holes. A measured angle that is missing stays missing: an estimator predicts there, without update.
A missing command is held, as a controller holds it. A row without a time, or that comes late, is dropped.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Episode
from twin.errors import InputError
from twin.measured.command import TIME_COLUMNS
from twin.measured.csv_columns import CsvColumns, average_repeats, hold
from twin.measured.csv_reader import read_columns
from twin.measured.log_format import (
    ANGLE_UNITS,
    LARGEST_SHEATH_BEND_DEG,
    LENGTH_UNITS,
    SHEATH_BEND_COLUMN,
    TIME_UNITS,
    LogFormat,
)
from twin.signals.plausible import LARGEST_BEND_DEG, LARGEST_PULL_MM, LARGEST_TIME_S

Array = NDArray[np.float64]

GAP = 20.0
"""Time step, relative to the median one, from which on it counts as a gap."""

# Plausible limits beside the shared ones: a value beyond them is in another unit than stated.
_TENSION_N = (-5.0, 1000.0)  # an unloaded load cell may drift below zero


def read_measured_log(
    path: Path,
    form: LogFormat | None = None,
    *,
    on_warning: Callable[[str], None] | None = None,
) -> Episode:
    """Read a measured log as an episode; rows with the same time are averaged.

    A value is missing where its field is empty or says so (`numbers.MISSING`). What is dropped or held
    is counted in a warning and in the metadata.

    Args:
        path: a CSV file with a header.
        form: its columns and units.
        on_warning: called with each warning, in one line.

    Returns:
        N samples from time 0 on. Both `bend` and `measured_bend` are the measured angle; where it is missing,
        `measured_bend` is NaN and `bend` linear between its neighbours, or level before the first and after
        the last. There are no joints and no friction; `wire_tension` is (N, 2, 1) where both tensions were
        measured, else (N, 2, 0). The metadata tells how the file was read, so that a pulling distance can
        become a pulley's angle again.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a column is missing or has no known unit; a value is no number or implausible; a tension,
            the sheath's bend or the first command is missing; more than a tenth of the rows run backwards in
            time, or any in phase; the angle is measured at fewer than two times; the command does not move.
    """
    form = form or LogFormat()
    form.check()
    if not path.name.isprintable():
        raise InputError(f"{str(path)!r:.40}: a log records the name of its file, which must be printable")
    table = read_columns(path, form.columns)

    time_column = table.first_of((form.time_column,) if form.time_column else TIME_COLUMNS)
    time_units = TIME_UNITS | {"rad": form.seconds_per_cycle / (2 * np.pi)}
    time_unit = _unit(table, time_column, form.time_unit, time_units, "time_unit")
    row_count, sha256 = len(table.lines), table.sha256
    table, time = _in_time_order(table, time_column, time_units[time_unit], time_unit == "rad", on_warning)

    pull, command_unit = _pull(table, form)
    bend, angle_unit = _bend(table, form)
    _warn_of_missing(table, form.command_column, pull, "the last one is held", on_warning)
    _warn_of_missing(table, form.angle_column, bend, "nothing is measured there", on_warning)
    tension_columns = _tension_columns(table, form, on_warning)
    sheath_bend_column = _sheath_bend_column(table, form)
    columns = [pull, bend]
    for name in tension_columns:
        tension = table.column(name)
        _refuse_implausible(table, name, tension, "N", _TENSION_N, "a tension is read in newton")
        columns.append(tension)
    if sheath_bend_column is not None:
        columns.append(_sheath_bend_deg(table, sheath_bend_column))

    instants, means = average_repeats(time, np.column_stack(columns))
    if len(instants) < 2:
        raise InputError(f"{path}: all rows have the same {time_column}, a record needs two times")
    _warn_of_gap(table, time, instants, on_warning)
    count = len(instants)
    if np.isnan(means[0, 0]):
        line = f"{path} line {table.lines[0]}"
        raise InputError(f"{line}: {form.command_column} is missing, and no row before it has one to hold")
    measured = means[:, 1].copy()
    known = ~np.isnan(measured)
    if known.sum() < 2:
        raise InputError(f"{path}: {form.angle_column} is measured {known.sum()} times, a record needs two")
    between = np.interp(instants, instants[known], measured[known])
    sheath_bend = means[:, -1] if sheath_bend_column is not None else np.empty(0)
    if form.sheath_bend_deg is not None:
        sheath_bend = np.full(count, form.sheath_bend_deg)
    mended = {"rows_dropped": row_count - len(time), "commands_held": int(np.isnan(pull).sum())}
    return Episode(
        time=(instants - instants[0]) * time_units[time_unit],
        pull=hold(means[:, 0]),
        bend=np.where(known, measured, between),
        measured_bend=measured,
        joint_angle=np.empty((count, 0)),
        wire_tension=means[:, 2 : 2 + len(tension_columns)].reshape(count, 2, len(tension_columns) // 2),
        sheath_friction=np.empty((count, 2, 0)),
        sheath_bend=np.radians(sheath_bend),
        metadata={
            "source": "measured",
            "signal": "measured",
            "name": path.stem,
            "file": path.name,
            "file_sha256": sha256,
            "rows": row_count,
            "command_column": form.command_column,
            "command_unit": command_unit,
            "pulley_radius": form.pulley_radius if command_unit in ANGLE_UNITS else None,
            "angle_column": form.angle_column,
            "angle_unit": angle_unit,
            "reverse_angle": form.reverse_angle,
            "time_column": time_column,
            "time_unit": time_unit,
            "seconds_per_cycle": form.seconds_per_cycle if time_unit == "rad" else None,
            "tension_columns": list(tension_columns),
            "sheath_bend_column": sheath_bend_column,
            "sheath_bend_deg": form.sheath_bend_deg,
            "endotwin": __version__,
            **{name: number for name, number in mended.items() if number},
        },
    )


def _in_time_order(
    table: CsvColumns, name: str, unit: float, phase: bool, on_warning: Callable[[str], None] | None
) -> tuple[CsvColumns, Array]:
    """Return the table of rows with non-decreasing time, and that time in the column's unit [`unit` s]."""
    table = table.timed(name, on_warning)
    with np.errstate(over="ignore"):
        seconds = table.column(name) * unit
    _refuse_implausible(table, name, seconds, "s", (-LARGEST_TIME_S, LARGEST_TIME_S), "check `time_unit`")
    # A packet may come late with its stamp; a phase is computed, and one that goes back has begun a new turn.
    if not phase:
        table = table.in_order(name, on_warning)
    return table, table.time(name)


def _pull(table: CsvColumns, form: LogFormat) -> tuple[Array, str]:
    """Return the commanded pulling distance (N,) [m], NaN where missing, and the unit of its column."""
    name = form.command_column
    values = table.column(name, may_miss=True)
    lengths = LENGTH_UNITS | {unit: size * form.pulley_radius for unit, size in ANGLE_UNITS.items()}
    unit = _unit(table, name, form.command_unit, lengths, "command_unit")
    with np.errstate(over="ignore"):
        pull = values * lengths[unit]
        millimetres = pull * 1e3
    advice = "check `command_unit`" + (" and `pulley_radius`" if unit in ANGLE_UNITS else "")
    limits = (-LARGEST_PULL_MM, LARGEST_PULL_MM)
    _refuse_implausible(table, name, millimetres, "mm of pulling distance", limits, advice)
    known = values[~np.isnan(values)]
    if not known.size:
        raise InputError(f"{table.path}: {name} is missing in every row")
    if known.min() == known.max():
        raise InputError(f"{table.path}: {name} is {known[0]:g} in every row: a log without motion")
    return pull, unit


def _bend(table: CsvColumns, form: LogFormat) -> tuple[Array, str]:
    """Return the measured bending angle (N,) [rad], NaN where missing, and the unit of its column."""
    name = form.angle_column
    values = table.column(name, may_miss=True)
    unit = _unit(table, name, form.angle_unit, ANGLE_UNITS, "angle_unit")
    bend = values * ANGLE_UNITS[unit] * (-1 if form.reverse_angle else 1)
    limits = (-LARGEST_BEND_DEG, LARGEST_BEND_DEG)
    with np.errstate(over="ignore"):
        degrees = np.degrees(bend)
    _refuse_implausible(table, name, degrees, "deg", limits, "check `angle_unit`")
    return bend, unit


def _sheath_bend_column(table: CsvColumns, form: LogFormat) -> str | None:
    there = SHEATH_BEND_COLUMN in table.names
    return SHEATH_BEND_COLUMN if form.sheath_bend_deg is None and there else None


def _sheath_bend_deg(table: CsvColumns, name: str) -> Array:
    bend = table.column(name)
    advice = "give `sheath_bend_deg`"
    _refuse_implausible(table, name, bend, "deg", (0.0, LARGEST_SHEATH_BEND_DEG), advice)
    return bend


def _tension_columns(
    table: CsvColumns, form: LogFormat, on_warning: Callable[[str], None] | None
) -> tuple[str, ...]:
    """Return the names of both tension columns, or none: one wire alone is of no use."""
    names = (form.tension_a_column or "tension_a_n", form.tension_b_column or "tension_b_n")
    found = [name for name in names if name in table.names]
    asked_for = form.tension_a_column is not None or form.tension_b_column is not None
    if len(found) == 2 or asked_for:
        return names
    if found and on_warning:
        (missing,) = set(names) - set(found)
        on_warning(f"{table.path} has {found[0]} but no {missing}: no tension is recorded")
    return ()


def _unit(table: CsvColumns, name: str, given: str | None, units: Mapping[str, float], parameter: str) -> str:
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


def _refuse_implausible(
    table: CsvColumns, name: str, values: Array, unit: str, limits: tuple[float, float], advice: str
) -> None:
    low, high = limits
    wrong = (values < low) | (values > high)
    if wrong.any():
        row = int(wrong.argmax())
        raise InputError(
            f"{table.path} line {table.lines[row]}: {name} is {values[row]:g} {unit}, "
            f"which is not from {low:g} to {high:g}: {advice}"
        )


def _warn_of_missing(
    table: CsvColumns, name: str, values: Array, what: str, on_warning: Callable[[str], None] | None
) -> None:
    missing = np.isnan(values)
    if on_warning and missing.any():
        on_warning(f"{table.count(missing, f'{name} is missing')}: {what}")


def _warn_of_gap(
    table: CsvColumns, time: Array, instants: Array, on_warning: Callable[[str], None] | None
) -> None:
    steps = np.diff(instants)
    longest, usual = int(steps.argmax()), float(np.median(steps))
    if on_warning and steps[longest] > GAP * usual:
        line = table.lines[int(np.searchsorted(time, instants[longest + 1]))]
        times = float(steps[longest]) / usual
        on_warning(f"{table.path} line {line}: a gap of {times:.0f} times the usual step comes before it")
