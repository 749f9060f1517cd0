"""Measured log of a real endoscope: commands and sensor readings of a CSV file, read as an episode.

Logs have holes. A measured angle that is missing stays missing: an estimator predicts there, without update.
A missing command is held, as a controller holds it. A row without a time, or that comes late, is dropped.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Episode, without_holes
from twin.errors import InputError
from twin.measured.log_columns import (
    commanded_pull,
    measured_angle,
    refuse_standstill,
    sheath_bend,
    tensions,
)
from twin.measured.log_format import LogFormat
from twin.measured.table import CsvTable, average_repeats, hold, read_columns
from twin.measured.units import ANGLE_UNITS, TIME_COLUMNS, refuse_implausible_times, time_unit_of

Array = NDArray[np.float64]

GAP = 20.0
"""Time step, relative to the median one, from which on it counts as a gap."""


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
        the last. With two bending planes `lateral_bend` is the angle in the second one, its holes filled in
        the same way; `measured_bend` is then NaN where either angle is missing, as nothing else can say so.
        There are no joints and no friction; `wire_tension` is (N, 2, 1) where both tensions of one plane were
        measured, else (N, wires, 0). The metadata tells how the file was read, so that a pulling distance can
        become a pulley's angle again.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a column is missing or has no known unit; a value is no number or implausible; a tension,
            the sheath's bend or the first command is missing; more than a tenth of the rows run backwards in
            time, or any in phase; the angle is measured at fewer than two times; the command does not move.
    """
    form = form or LogFormat()
    return log_of(log_table(path, form), form, on_warning=on_warning)


def log_table(path: Path, form: LogFormat, *more: str) -> CsvTable:
    """Read the columns of a measured log, and `more` of that file.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a number of the form cannot be, or the file is no CSV file.
    """
    form.check()
    if not path.name.isprintable():
        raise InputError(f"{str(path)!r:.40}: a log records the name of its file, which must be printable")
    return read_columns(path, {*form.columns, *more})


def log_of(
    table: CsvTable,
    form: LogFormat,
    *,
    may_stand_still: bool = False,
    on_warning: Callable[[str], None] | None = None,
) -> Episode:
    """Return the episode of a table, or of a part of it, as `read_measured_log` reads a whole file.

    Args:
        table: the columns of `form`.
        form: its columns and units.
        may_stand_still: allow a command that does not move.
        on_warning: called with each warning, in one line.

    Raises:
        ValueError: as of `read_measured_log`.
    """
    path = table.path
    time_column = table.first_of((form.time_column,) if form.time_column else TIME_COLUMNS)
    time_unit, unit = time_unit_of(table, time_column, form.time_unit, form.seconds_per_cycle)
    row_count, sha256 = len(table.lines), table.sha256
    table, time = _in_time_order(table, time_column, unit, time_unit == "rad", on_warning)

    if not may_stand_still:
        refuse_standstill(table, form.command_column)
    own = _plane(table, form, form.command_column, form.angle_column, form.reverse_angle)
    planes = [own]
    if form.lateral_command_column is not None and form.lateral_angle_column is not None:
        columns = form.lateral_command_column, form.lateral_angle_column
        planes.append(_plane(table, form, *columns, form.reverse_lateral_angle))
    for plane in planes:
        also = "nothing is measured there" + (", in either plane" if len(planes) > 1 else "")
        _warn_of_missing(table, plane.command_column, plane.pull, "the last one is held", on_warning)
        _warn_of_missing(table, plane.angle_column, plane.bend, also, on_warning)
    tension_columns, tension = tensions(table, form, on_warning)
    sheath_bend_column, sheath_bends = sheath_bend(table, form)

    instants, pulls = average_repeats(time, np.column_stack([plane.pull for plane in planes]))
    if len(instants) < 2:
        raise InputError(f"{path}: all rows have the same {time_column}, a record needs two times")
    _warn_of_gap(table, time, instants, on_warning)
    for plane, pull in zip(planes, pulls.T, strict=True):
        if np.isnan(pull[0]):
            rule = f"{plane.command_column} is missing, and no row before it has one to hold"
            raise InputError(f"{path} line {table.lines[0]}: {rule}")
    _, measured = average_repeats(time, np.column_stack([plane.bend for plane in planes]))
    seen = ~np.isnan(measured).any(axis=1)
    if seen.sum() < 2:
        names = " and ".join(plane.angle_column for plane in planes)
        are = "is" if len(planes) == 1 else "are both"
        raise InputError(f"{path}: {names} {are} measured {seen.sum()} times, a record needs two")
    count, wires = len(instants), 2 * len(planes)
    bends = [without_holes(instants, angle) for angle in measured.T]
    _, tension = average_repeats(time, tension)
    if sheath_bend_column is not None:
        _, sheath_bends = average_repeats(time, sheath_bends)
    if form.sheath_bend_deg is not None:
        sheath_bends = np.full(count, np.radians(form.sheath_bend_deg))
    held = sum(int(np.isnan(plane.pull).sum()) for plane in planes)
    mended = {"rows_dropped": row_count - len(time), "commands_held": held}
    in_angles = any(plane.command_unit in ANGLE_UNITS for plane in planes)
    return Episode(
        time=(instants - instants[0]) * unit,
        pull=hold(pulls[:, 0]),
        bend=bends[0],
        measured_bend=np.where(seen, measured[:, 0], np.nan),
        joint_angle=np.empty((count, 0)),
        wire_tension=tension.reshape(count, wires, len(tension_columns) // 2),
        sheath_friction=np.empty((count, wires, 0)),
        sheath_bend=sheath_bends,
        lateral_pull=hold(pulls[:, 1]) if len(planes) > 1 else np.empty(0),
        lateral_bend=bends[1] if len(planes) > 1 else np.empty(0),
        metadata={
            "source": "measured",
            "signal": "measured",
            "name": path.stem,
            "file": path.name,
            "file_sha256": sha256,
            "rows": row_count,
            "command_column": form.command_column,
            "command_unit": own.command_unit,
            "pulley_radius": form.pulley_radius if in_angles else None,
            "angle_column": form.angle_column,
            "angle_unit": own.angle_unit,
            "reverse_angle": form.reverse_angle,
            **(_lateral_facts(planes[1], form) if len(planes) > 1 else {}),
            "time_column": time_column,
            "time_unit": time_unit,
            "seconds_per_cycle": form.seconds_per_cycle if time_unit == "rad" else None,
            "tension_columns": tension_columns,
            "sheath_bend_column": sheath_bend_column,
            "sheath_bend_deg": form.sheath_bend_deg,
            "endotwin": __version__,
            **{name: number for name, number in mended.items() if number},
        },
    )


@dataclasses.dataclass(frozen=True)
class _Plane:
    """Command and measured angle of a bending plane, row by row: (N,) [m], (N,) [rad], NaN where missing."""

    command_column: str
    pull: Array
    command_unit: str
    angle_column: str
    bend: Array
    angle_unit: str


def _plane(table: CsvTable, form: LogFormat, command: str, angle: str, reverse: bool) -> _Plane:
    pull = commanded_pull(table, form, command)
    return _Plane(command, *pull, angle, *measured_angle(table, form, angle, reverse=reverse))


def _lateral_facts(plane: _Plane, form: LogFormat) -> dict[str, Any]:
    return {
        "lateral_command_column": plane.command_column,
        "lateral_command_unit": plane.command_unit,
        "lateral_angle_column": plane.angle_column,
        "lateral_angle_unit": plane.angle_unit,
        "reverse_lateral_angle": form.reverse_lateral_angle,
    }


def _in_time_order(
    table: CsvTable, name: str, unit: float, phase: bool, on_warning: Callable[[str], None] | None
) -> tuple[CsvTable, Array]:
    """Return the table of rows with non-decreasing time, and that time in the column's unit [`unit` s]."""
    table = table.timed(name, on_warning)
    refuse_implausible_times(table, name, unit)
    # A packet may come late with its stamp; a phase is computed, and one that goes back has begun a new turn.
    if not phase:
        table = table.in_order(name, on_warning)
    return table, table.time(name)


def _warn_of_missing(
    table: CsvTable, name: str, values: Array, what: str, on_warning: Callable[[str], None] | None
) -> None:
    missing = np.isnan(values)
    if on_warning and missing.any():
        on_warning(f"{table.count(missing, f'{name} is missing')}: {what}")


def _warn_of_gap(
    table: CsvTable, time: Array, instants: Array, on_warning: Callable[[str], None] | None
) -> None:
    steps = np.diff(instants)
    longest, usual = int(steps.argmax()), float(np.median(steps))
    if on_warning and steps[longest] > GAP * usual:
        line = table.lines[int(np.searchsorted(time, instants[longest + 1]))]
        times = float(steps[longest]) / usual
        on_warning(f"{table.path} line {line}: a gap of {times:.0f} times the usual step comes before it")
