"""Measured log of a real endoscope: commands and sensor readings of a CSV file, read as episodes.

Logs have holes. A measured angle that is missing stays missing: an estimator predicts there, without update.
A missing command is held, as a controller holds it. A row without a time, or that comes late, is dropped.

A file may hold windows: pieces cut from longer records, without what came before them. A column identifies
them; where its value changes, another window begins, and each becomes an episode of its own.
"""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Episode, without_holes
from twin.errors import InputError
from twin.measured.table import CsvTable, average_repeats, hold, read_columns
from twin.measured.units import (
    ANGLE_UNITS,
    SECONDS_PER_CYCLE,
    TIME_COLUMNS,
    check_cycle,
    column_unit,
    pulling_distance,
    refuse_implausible,
    refuse_implausible_times,
    time_unit_of,
)
from twin.signals.plausible import LARGEST_BEND_DEG

Array = NDArray[np.float64]
Warn = Callable[[str], None] | None

SHEATH_BEND_COLUMN = "sheath_bend_deg"
"""Name of the column of the angle that the sheath is bent by."""
GAP = 20.0
"""Time step, relative to the median one, from which on it counts as a gap."""
LARGEST_RADIUS = 1.0
"""Largest radius of a pulley [m]."""
LARGEST_SHEATH_BEND_DEG = 1440.0
"""Largest bend of a sheath [deg], the limit of a preset."""
MOST_WINDOWS = 10_000
"""Largest number of windows in a file: a column with more changes is none of windows."""
MOST_WARNINGS = 10
"""Largest number of warnings of a file: windows often share a fault."""

# Usual ranges: a value beyond them is often in another unit than stated. Nothing is refused by them.
PULL_RANGE_MM = (0.1, 100.0)
PULLEY_RANGE_DEG = (5.0, 1080.0)
BEND_RANGE_DEG = (5.0, 540.0)
SAMPLE_TIMES_S = (1e-4, 2.0)
LENGTHS_S = (1.0, 86_400.0)
_TENSION_N = (-5.0, 1000.0)  # refused beyond; an unloaded load cell may drift below zero


@dataclasses.dataclass(frozen=True)
class LogFormat:
    """Columns and units of a measured log; a unit of None is the ending of the column's name.

    Attributes:
        command_column: column of the command.
        command_unit: deg or rad for a pulley angle, mm or m for a pulling distance; of both commands.
        pulley_radius: radius that converts a pulley angle to a pulling distance [m].
        angle_column: column of the measured bending angle.
        angle_unit: deg or rad; of both angles.
        reverse_angle: True if the sensor counts a bend towards wire a as negative.
        lateral_command_column: column of the command of wires c and d; None: a log of one bending plane.
        lateral_angle_column: column of the measured angle in their plane.
        reverse_lateral_angle: True if the sensor counts a bend towards wire c as negative.
        time_column: column of the time or phase; None: time_s or phase_rad, whichever exists.
        time_unit: s, ms or us; rad for a phase.
        seconds_per_cycle: duration of a phase of 2 pi [s].
        tension_a_column: column of the tension of wire a at the pulley [N]; None: tension_a_n, if both
            tension_a_n and tension_b_n exist.
        tension_b_column: the same for wire b.
        sheath_bend_deg: bend angle of the sheath [deg]; None: the column of that name, if it exists.
    """

    command_column: str = "command_deg"
    command_unit: str | None = None
    pulley_radius: float = 0.01
    angle_column: str = "angle_deg"
    angle_unit: str | None = None
    reverse_angle: bool = False
    lateral_command_column: str | None = None
    lateral_angle_column: str | None = None
    reverse_lateral_angle: bool = False
    time_column: str | None = None
    time_unit: str | None = None
    seconds_per_cycle: float = SECONDS_PER_CYCLE
    tension_a_column: str | None = None
    tension_b_column: str | None = None
    sheath_bend_deg: float | None = None

    @property
    def columns(self) -> set[str]:
        """Names of all columns that such a log may have."""
        names = {self.command_column, self.angle_column, SHEATH_BEND_COLUMN}
        names |= {self.time_column} if self.time_column else {*TIME_COLUMNS}
        names |= {name for name in (self.lateral_command_column, self.lateral_angle_column) if name}
        return names | {self.tension_a_column or "tension_a_n", self.tension_b_column or "tension_b_n"}

    def check(self) -> None:
        """Refuse numbers that cannot be, and half a bending plane.

        Raises:
            ValueError: a number is out of range, or the columns do not make one plane or two.
        """
        if not 0 < self.pulley_radius <= LARGEST_RADIUS:
            raise InputError(
                f"`pulley_radius` is {self.pulley_radius:g} m: must be positive, at most {LARGEST_RADIUS:g} m"
            )
        check_cycle(self.seconds_per_cycle)
        bend = self.sheath_bend_deg
        if bend is not None and not 0 <= bend <= LARGEST_SHEATH_BEND_DEG:
            raise InputError(f"sheath_bend_deg = {bend:g}: must be from 0 to {LARGEST_SHEATH_BEND_DEG:g}")
        self._check_planes()

    def _check_planes(self) -> None:
        lateral = (self.lateral_command_column, self.lateral_angle_column)
        if lateral == (None, None):
            if self.reverse_lateral_angle:
                raise InputError(
                    "`reverse_lateral_angle` turns an angle: name its `lateral_angle_column` too"
                )
            return
        if None in lateral:
            raise InputError("give `lateral_command_column` and `lateral_angle_column` both, or neither")
        columns = (self.command_column, self.angle_column, *lateral)
        for name in columns:
            if columns.count(name) > 1:
                raise InputError(
                    f"column {name} is named twice: commands and angles are columns of their own"
                )


def read_measured_log(
    path: Path,
    form: LogFormat | None = None,
    *,
    on_warning: Warn = None,
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
    on_warning: Warn = None,
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
    table: CsvTable, name: str, unit: float, phase: bool, on_warning: Warn
) -> tuple[CsvTable, Array]:
    """Return the table of rows with non-decreasing time, and that time in the column's unit [`unit` s]."""
    table = table.timed(name, on_warning)
    refuse_implausible_times(table, name, unit)
    # A packet may come late with its stamp; a phase is computed, and one that goes back has begun a new turn.
    if not phase:
        table = table.in_order(name, on_warning)
    return table, table.time(name)


def _warn_of_missing(table: CsvTable, name: str, values: Array, what: str, on_warning: Warn) -> None:
    missing = np.isnan(values)
    if on_warning and missing.any():
        on_warning(f"{table.count(missing, f'{name} is missing')}: {what}")


def _warn_of_gap(table: CsvTable, time: Array, instants: Array, on_warning: Warn) -> None:
    steps = np.diff(instants)
    longest, usual = int(steps.argmax()), float(np.median(steps))
    if on_warning and steps[longest] > GAP * usual:
        line = table.lines[int(np.searchsorted(time, instants[longest + 1]))]
        times = float(steps[longest]) / usual
        on_warning(f"{table.path} line {line}: a gap of {times:.0f} times the usual step comes before it")


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


def tensions(table: CsvTable, form: LogFormat, on_warning: Warn) -> tuple[list[str], Array]:
    """Return the names of both tension columns, and their tensions (N, 2) [N]; none of one wire alone.

    Raises:
        ValueError: a column that is asked for is not there; a tension is missing, no number or implausible.
    """
    names = _tension_columns(table, form, on_warning)
    columns = [table.column(name) for name in names]
    for name, tension in zip(names, columns, strict=True):
        refuse_implausible(table, name, tension, "N", _TENSION_N, "a tension is read in newton")
    return list(names), np.column_stack(columns) if columns else np.empty((len(table.lines), 0))


def _tension_columns(table: CsvTable, form: LogFormat, on_warning: Warn) -> tuple[str, ...]:
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


def read_windows(
    path: Path,
    window_column: str,
    form: LogFormat | None = None,
    *,
    on_warning: Warn = None,
) -> list[Episode]:
    """Read the windows of a measured log, each as an episode, in the order of the file.

    Args:
        path: a CSV file with a header.
        window_column: column of numbers that stay the same throughout a window.
        form: columns and units, as of `read_measured_log`.
        on_warning: called with each warning, in one line.

    Returns:
        Episodes as of `read_measured_log`, each from time 0 on. `window` in the metadata is the number in the
        window column, `rows` those of the window. The command of one may stand still.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a window is no log (the text names it), the command moves in none, `window_column` is
            another column of the log or missing in a row, or there are more than `MOST_WINDOWS`.
    """
    form = form or LogFormat()
    if window_column in form.columns:
        raise InputError(
            f"window_column = {window_column}: must be a column of its own, not of time, command or angle"
        )
    table = log_table(path, form, window_column)
    numbers = table.column(window_column)
    begins = np.flatnonzero(np.diff(numbers, prepend=np.nan) != 0)
    if len(begins) > MOST_WINDOWS:
        raise InputError(
            f"{path}: {window_column} changes {len(begins) - 1} times, at most {MOST_WINDOWS} windows are "
            "read: check `window_column`"
        )
    refuse_standstill(table, form.command_column)
    warn = _Few(on_warning)
    episodes = []
    for begin, end in zip(begins.tolist(), [*begins[1:].tolist(), len(numbers)], strict=True):
        window = int(numbers[begin]) if numbers[begin].is_integer() else float(numbers[begin])
        try:
            log = log_of(table.only(slice(begin, end)), form, may_stand_still=True, on_warning=warn)
        except InputError as error:
            if not str(error).startswith(f"{path}: "):  # it names a line, or a column that is not there
                raise
            which = f"{window_column} {window:g}, lines {table.lines[begin]} to {table.lines[end - 1]}"
            raise InputError(f"{error} ({which})") from error
        log.metadata.update(window=window, window_column=window_column)
        episodes.append(log)
    warn.finish(path)
    return episodes


class _Few:
    """Warnings, each once and not too many of them."""

    def __init__(self, on_warning: Warn) -> None:
        self._on_warning, self._told, self._more = on_warning, set[str](), 0

    def __call__(self, line: str) -> None:
        if line in self._told or self._on_warning is None:
            return
        if len(self._told) < MOST_WARNINGS:
            self._told.add(line)
            self._on_warning(line)
        else:
            self._more += 1

    def finish(self, path: Path) -> None:
        """Tell how many warnings were not told."""
        if self._more and self._on_warning:
            self._on_warning(f"{path}: {self._more} more warnings like these")


def oddities(*logs: Episode) -> list[str]:
    """Return a warning, in one line, for each of command, angle and time that is hardly an endoscope's.

    Args:
        logs: one from `read_measured_log`, whose metadata name columns and units; or all windows from
            `read_windows`, which are judged together, as one may hardly move.
    """
    return [line for line in (_odd_command(logs), _odd_bend(logs), _odd_time(logs)) if line]


def _odd_command(logs: Sequence[Episode]) -> str | None:
    name, radius = logs[0].metadata["command_column"], logs[0].metadata["pulley_radius"]
    advice = "check `command_unit`"
    span = float(np.ptp(np.concatenate([log.pull for log in logs])))
    if radius is not None:
        odd = _outside(float(np.degrees(span / radius)), PULLEY_RANGE_DEG, "deg")
        if odd:
            return f"{name} ranges over {odd}: {advice}"
        advice += " and `pulley_radius`"
    odd = _outside(span * 1e3, PULL_RANGE_MM, "mm", " of pulling distance")
    return f"{name} ranges over {odd}: {advice}" if odd else None


def _odd_bend(logs: Sequence[Episode]) -> str | None:
    span = float(np.ptp(np.concatenate([log.truth_deg for log in logs])))
    odd = _outside(span, BEND_RANGE_DEG, "deg")
    return f"{logs[0].metadata['angle_column']} ranges over {odd}: check `angle_unit`" if odd else None


def _odd_time(logs: Sequence[Episode]) -> str | None:
    facts = logs[0].metadata
    name, is_phase = facts["time_column"], facts["seconds_per_cycle"] is not None
    advice = "check `time_unit`" + (" and `seconds_per_cycle`" if is_phase else "")
    if odd := _outside(float(np.median([log.sample_time for log in logs])), SAMPLE_TIMES_S, "s"):
        return f"{name} steps by {odd}: {advice}"
    odd = _outside(float(sum(log.time[-1] for log in logs)), LENGTHS_S, "s")
    return f"{name} ranges over {odd}: {advice}" if odd else None


def _outside(value: float, usual: tuple[float, float], unit: str, what: str = "") -> str | None:
    """Return a value out of its usual limits in words; None for one within them."""
    low, high = usual
    if low <= value <= high:
        return None
    odd = f"little (less than {low:g}" if value < low else f"much (more than {high:g}"
    return f"{value:.3g} {unit}{what}, unusually {odd} {unit})"
