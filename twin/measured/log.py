"""Measured log of a real endoscope: commands and sensor readings of a file, read as episodes.

Logs have holes. A measured angle that is missing stays missing: an estimator predicts there, without update.
A missing command is held, as a controller holds it. A row without a time, or that comes late, is dropped.

A file may hold windows: pieces cut from longer records, without what came before them. A column identifies
them; where its value changes, another window begins, and each becomes an episode of its own.
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
from twin.measured.formats import read_table
from twin.measured.table import (
    ANGLE_UNITS,
    SECONDS_PER_CYCLE,
    TIME_COLUMNS,
    TIME_UNITS,
    CsvTable,
    average_repeats,
    check_cycle,
    column_unit,
    hold,
    pulling_distance,
    refuse_implausible,
    refuse_implausible_times,
    time_unit_of,
)
from twin.signals.sensor import LARGEST_BEND_DEG

Array = NDArray[np.float64]
Warn = Callable[[str], None]
SHEATH_BEND_COLUMN = "sheath_bend_deg"  # name of the column of the angle that the sheath is bent by
GAP = 20.0  # time step, relative to the median one, from which on it counts as a gap
RESTARTED = 5  # rows that stay behind the time before them, from which on the clock has been set back
SHORTEST_PAUSE_S = 1.0  # between two runs of one file [s]
JITTER = 0.2  # spread of time steps, relative to the median one, that is named
JUMP = 8.0  # step there and back within one row, relative to nearly all other steps, that is named
LARGEST_RADIUS = 1.0  # largest radius of a pulley [m]
LARGEST_SHEATH_BEND_DEG = 1440.0  # largest bend of a sheath [deg], the limit of a preset
MOST_WINDOWS = 10_000  # largest number of windows in a file: a column with more changes is none of windows
MOST_WARNINGS = 10  # largest number of warnings of a file: windows often share a fault

# Usual ranges: a value beyond them is often in another unit than stated. Nothing is refused by them.
PULL_RANGE_MM = (0.1, 100.0)
PULLEY_RANGE_DEG = (5.0, 1080.0)
BEND_RANGE_DEG = (5.0, 540.0)
SAMPLE_TIMES_S = (1e-4, 2.0)
LENGTHS_S = (1.0, 86_400.0)
_TENSION_N = (-5.0, 1000.0)  # refused beyond; an unloaded load cell may drift below zero


@dataclasses.dataclass(frozen=True)
class LogFormat:
    """Columns and units of a measured log; a unit of None is the ending of the column's name."""

    command_column: str = "command_deg"  # column of the command
    # deg or rad for a pulley angle, mm or m for a pulling distance; of both commands
    command_unit: str | None = None
    pulley_radius: float = 0.01  # radius that converts a pulley angle to a pulling distance [m]
    angle_column: str = "angle_deg"  # column of the measured bending angle
    angle_unit: str | None = None  # deg or rad; of both angles
    command_scale: float = 1.0  # of one count of an encoder, in units of the command
    command_zero: float = 0.0  # counts at the command zero
    reverse_angle: bool = False  # True if the sensor counts a bend towards wire a as negative
    unwrap_angle: bool = False  # True if an angle that leaves one end of a turn enters at the other
    no_header: bool = False  # True if the first line holds numbers; columns are then named by their numbers
    # column of the command of wires c and d; None: a log of one bending plane
    lateral_command_column: str | None = None
    lateral_angle_column: str | None = None  # column of the measured angle in their plane
    reverse_lateral_angle: bool = False  # True if the sensor counts a bend towards wire c as negative
    time_column: str | None = None  # column of the time or phase; None: time_s or phase_rad, whichever exists
    time_fraction_column: str | None = None  # column of what is added to the time, such as nanoseconds
    time_unit: str | None = None  # s, ms, us or ns; rad for a phase
    seconds_per_cycle: float = SECONDS_PER_CYCLE  # duration of a phase of 2 pi [s]
    # column of the tension of wire a at the pulley [N]; None: tension_a_n, if both tension_a_n and
    # tension_b_n exist
    tension_a_column: str | None = None
    tension_b_column: str | None = None  # the same for wire b
    # bend angle of the sheath [deg]; None: the column of that name, if it exists
    sheath_bend_deg: float | None = None

    @property
    def columns(self) -> set[str]:
        """Names of all columns that such a log may have."""
        names = {self.command_column, self.angle_column, SHEATH_BEND_COLUMN}
        names |= self.times
        names |= {name for name in (self.lateral_command_column, self.lateral_angle_column) if name}
        return names | {self.tension_a_column or "tension_a_n", self.tension_b_column or "tension_b_n"}

    @property
    def times(self) -> set[str]:
        """Names of the columns that a time may be in."""
        names = {self.time_column} if self.time_column else {*TIME_COLUMNS}
        return names | ({self.time_fraction_column} if self.time_fraction_column else set())

    def check(self) -> None:
        """Refuse impossible numbers, and half a bending plane."""
        if not 0 < self.pulley_radius <= LARGEST_RADIUS:
            raise InputError(
                f"`pulley_radius` is {self.pulley_radius:g} m: must be positive, at most {LARGEST_RADIUS:g} m"
            )
        for parameter in ("command_scale", "command_zero"):
            if not np.isfinite(value := getattr(self, parameter)):
                raise InputError(f"{parameter} = {value}: must be a finite number")
        check_cycle(self.seconds_per_cycle)
        bend = self.sheath_bend_deg
        if bend is not None and not 0 <= bend <= LARGEST_SHEATH_BEND_DEG:
            raise InputError(f"sheath_bend_deg = {bend:g}: must be from 0 to {LARGEST_SHEATH_BEND_DEG:g}")
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
    path: Path, form: LogFormat | None = None, *, on_warning: Warn | None = None
) -> Episode:
    """Read a measured log, a CSV file with a header, as an episode; rows with the same time are averaged.

    A value is missing where its field is empty or one of `table.MISSING`. What is dropped or held is counted
    in a warning (one line each, to `on_warning`) and in the metadata, which also state how the file was read.

    Returns:
        N samples from time 0 on. Both `bend` and `measured_bend` are the measured angle; where it is missing,
        `measured_bend` is NaN, `bend` linear between its neighbours and level at the ends; `lateral_bend`
        likewise. `measured_bend` is NaN where the angle of either plane is missing. `wire_tension` is
        (N, 2, 1) where both tensions of one plane were measured, else (N, wires, 0).
    """
    form = form or LogFormat()
    return _log_of(_log_table(path, form), form, on_warning or _Few(None))


def _log_table(path: Path, form: LogFormat, *more: str) -> CsvTable:
    form.check()
    if not path.name.isprintable():
        raise InputError(f"{str(path)!r:.40}: a log records the name of its file, which must be printable")
    return read_table(path, {*form.columns, *more}, times=form.times, no_header=form.no_header)


def _timed(table: CsvTable, form: LogFormat, warn: Warn) -> tuple[CsvTable, str, str, float]:
    """Return the rows that have a time, the column of it, its unit, and what that is in seconds."""
    own = form.command_column, form.angle_column, form.lateral_command_column, form.lateral_angle_column
    names = (form.time_column,) if form.time_column else TIME_COLUMNS
    time_column = table.first_of(names, [name for name in own if name])
    time_unit, unit = time_unit_of(table, time_column, form.time_unit, form.seconds_per_cycle)
    without = np.isnan(table.column(time_column, may_miss=True))
    if without.any() and not without.all() and table.names.count(form.angle_column) == 1:
        angles = ~np.isnan(table.column(form.angle_column, may_miss=True))
        if (lost := (angles & without).sum()) > angles.sum() / 2:
            rule = f"{table.count(without, f'{time_column} is missing')}: they hold {lost} of {angles.sum()}"
            raise InputError(f"{rule} values of {form.angle_column}: write a time into each row")
    table = table.timed(time_column, warn)
    if form.time_fraction_column:
        name = form.time_fraction_column
        seconds = table.column(name) * TIME_UNITS[column_unit(table, name, None, TIME_UNITS, "time_unit")]
        table = table.moved(time_column, seconds / unit)
    refuse_implausible_times(table, time_column, unit)
    return table, time_column, time_unit, unit


def _run_begins(time: Array) -> list[int]:
    """Return the rows (runs,) at which a record begins: the first, and each that a clock is set back at."""
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    begins = [0]
    for row in (np.flatnonzero(steps < -GAP * usual) + 1).tolist():
        if (time[row : row + RESTARTED] < time[row - 1]).all() and row - begins[-1] > 1:
            begins.append(row)
    return begins


def _log_of(table: CsvTable, form: LogFormat, warn: Warn, *, may_stand_still: bool = False) -> Episode:
    path, row_count, sha256 = table.path, len(table.lines), table.sha256
    table, time_column, time_unit, unit = _timed(table, form, warn)
    # A packet may come late with its stamp; a phase is computed, and one that goes back has begun a new turn.
    if time_unit != "rad":
        for row in _run_begins(table.column(time_column))[1:]:
            line = table.lines[row]
            rule = f"{time_column} begins again: a second record begins there, read them with `split_runs`"
            raise InputError(f"{path} line {line}: {rule}")
        table = table.in_order(time_column, warn)
    if not may_stand_still:
        _refuse_standstill(table, form.command_column)
    table = _joined(table, form, warn)
    time = table.time(time_column)

    own = _plane(table, form, form.command_column, form.angle_column, form.reverse_angle)
    planes = [own]
    if form.lateral_command_column is not None and form.lateral_angle_column is not None:
        columns = form.lateral_command_column, form.lateral_angle_column
        planes.append(_plane(table, form, *columns, form.reverse_lateral_angle))
    for plane in planes:
        also = "nothing is measured there" + (", in either plane" if len(planes) > 1 else "")
        for name, values, effect in (
            (plane.command_column, plane.pull, "the last one is held"),
            (plane.angle_column, plane.bend, also),
        ):
            if (missing := np.isnan(values)).any():
                warn(f"{table.count(missing, f'{name} is missing')}: {effect}")
            _tell_jumps(table, name, values, values is plane.bend, warn)
    tension_columns, tension = _tensions(table, form, warn)
    sheath_bend_column, sheath_bends = _sheath_bend(table, form)

    instants, pulls = average_repeats(time, np.column_stack([plane.pull for plane in planes]))
    if len(instants) < 2:
        raise InputError(f"{path}: all rows have the same {time_column}, a record needs two times")
    if len(instants) < len(time) / 2 and time_unit != "rad":
        rule = f"{len(time)} rows have {len(instants)} different times"
        raise InputError(
            f"{path}: {rule}: give `time_column` the column of the fraction of a second too, or a finer one"
        )
    steps = np.diff(instants)
    slow, quick = np.quantile(steps, (0.95, 0.05)) * unit * 1e3
    if time_unit != "rad" and len(steps) > GAP and slow - quick > JITTER * np.median(steps) * unit * 1e3:
        warn(f"{path}: time steps by {quick:.3g} to {slow:.3g} ms: the real times are kept")
    longest, usual = int(steps.argmax()), float(np.median(steps))
    if steps[longest] > GAP * usual:
        line, times = table.lines[int(np.searchsorted(time, instants[longest + 1]))], steps[longest] / usual
        warn(f"{path} line {line}: a gap of {times:.0f} times the usual step comes before it")
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
    lateral: dict[str, Any] = {}
    for plane in planes[1:]:
        lateral = {"lateral_command_column": plane.command_column, "lateral_command_unit": plane.command_unit}
        lateral |= {"lateral_angle_column": plane.angle_column, "lateral_angle_unit": plane.angle_unit}
        lateral["reverse_lateral_angle"] = form.reverse_lateral_angle
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
            **lateral,
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


def _joined(table: CsvTable, form: LogFormat, warn: Warn) -> CsvTable:
    """Return the rows that have an angle, with the last command, where each is in rows of its own.

    Rows before the first command are left out.
    """
    if form.lateral_command_column is not None:
        return table
    names = form.command_column, form.angle_column
    command, angle = (table.column(name, may_miss=True) for name in names)
    commanded, seen = ~np.isnan(command), ~np.isnan(angle)
    if (commanded & seen).sum() < 0.1 * min(commanded.sum(), seen.sum()) and len(commanded) > GAP:
        warn(f"{table.path}: {names[0]} and {names[1]} are in rows of their own: the last command is held")
        table, commanded = table.filled(names[0], hold(command)).only(seen), ~np.isnan(hold(command))[seen]
    if not commanded[0] and commanded.any():
        first = int(commanded.argmax())
        warn(f"{table.count(~commanded[:first], f'{names[0]} has not begun')}: such rows are left out")
        table = table.only(slice(first, None))
    return table


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
    counts = table.column(command, may_miss=True)
    table = table.filled(command, (counts - form.command_zero) * form.command_scale)
    pull, command_unit = pulling_distance(
        table, command, form.command_unit, form.pulley_radius, "`pulley_radius`", may_miss=True
    )
    values = table.column(angle, may_miss=True)
    unit = column_unit(table, angle, form.angle_unit, ANGLE_UNITS, "angle_unit")
    bend = values * ANGLE_UNITS[unit] * (-1 if reverse else 1)
    if form.unwrap_angle:
        known = ~np.isnan(bend)
        bend[known] = np.unwrap(bend[known])
        bend -= 2 * np.pi * np.round(bend[known][0] / (2 * np.pi)) if known.any() else 0.0
    limits = (-LARGEST_BEND_DEG, LARGEST_BEND_DEG)
    with np.errstate(over="ignore"):
        degrees = np.degrees(bend)
    refuse_implausible(table, angle, degrees, "deg", limits, "check `angle_unit`")
    return _Plane(command, pull, command_unit, angle, bend, unit)


def _tell_jumps(table: CsvTable, name: str, values: Array, is_angle: bool, warn: Warn) -> None:
    """Warn of values that jump by a turn, and of single ones that are far from both neighbours."""
    rows = np.flatnonzero(~np.isnan(values))
    steps = np.diff(values[rows])
    if len(steps) < 3:
        return
    turns = np.flatnonzero(np.abs(np.abs(steps) - 2 * np.pi) < np.pi / 3) if is_angle else steps[:0]
    if len(turns):
        line = table.lines[rows[int(turns[0]) + 1]]
        warn(
            f"{table.path} line {line}: {name} jumps by a turn, as in {len(turns)} rows: give `unwrap_angle`"
        )
    size = np.abs(steps)
    least = max(JUMP * float(np.quantile(size, 0.95)), 0.02 * float(np.ptp(values[rows])))
    there, back = steps[:-1], steps[1:]
    single = (np.minimum(size[:-1], size[1:]) > least) & (np.abs(there + back) < least)
    if single.any():
        lines = ", ".join(str(table.lines[row]) for row in rows[np.flatnonzero(single)[:5] + 1])
        more = ", ..." if single.sum() > 5 else ""
        warn(
            f"{table.path}: {name} jumps for one row in {single.sum()} places, lines {lines}{more}: mend them"
        )


def _refuse_standstill(table: CsvTable, name: str) -> None:
    values = table.column(name, may_miss=True)
    known = values[~np.isnan(values)]
    if not known.size:
        raise InputError(f"{table.path}: {name} is missing in every row")
    if known.min() == known.max():
        raise InputError(f"{table.path}: {name} is {known[0]:g} in every row: a log without motion")


def _sheath_bend(table: CsvTable, form: LogFormat) -> tuple[str | None, Array]:
    """Return the column of the bend of the sheath, None without one, and its angles (N,) or (0,) [rad]."""
    name = SHEATH_BEND_COLUMN
    if form.sheath_bend_deg is not None or name not in table.names:
        return None, np.empty(0)
    bend = table.column(name)
    advice = "give `sheath_bend_deg`"
    refuse_implausible(table, name, bend, "deg", (0.0, LARGEST_SHEATH_BEND_DEG), advice)
    return name, np.radians(bend)


def _tensions(table: CsvTable, form: LogFormat, warn: Warn) -> tuple[list[str], Array]:
    """Return the names of both tension columns, and their tensions (N, 2) [N]; none of one wire alone."""
    names = [form.tension_a_column or "tension_a_n", form.tension_b_column or "tension_b_n"]
    found = [name for name in names if name in table.names]
    asked_for = form.tension_a_column is not None or form.tension_b_column is not None
    if form.lateral_command_column is not None:
        rule = "tensions of a log of two bending planes are not read"
        if asked_for:
            raise InputError(f"{table.path}: {rule}: leave out `tension_a_column` and `tension_b_column`")
        if found:
            warn(f"{table.path} has {' and '.join(found)}: {rule}")
        names = []
    elif len(found) < 2 and not asked_for:
        if found:
            (missing,) = set(names) - set(found)
            warn(f"{table.path} has {found[0]} but no {missing}: no tension is recorded")
        names = []
    columns = [table.column(name) for name in names]
    for name, tension in zip(names, columns, strict=True):
        refuse_implausible(table, name, tension, "N", _TENSION_N, "a tension is read in newton")
    return names, np.column_stack(columns) if columns else np.empty((len(table.lines), 0))


def read_windows(
    path: Path, window_column: str | None, form: LogFormat | None = None, *, on_warning: Warn | None = None
) -> list[Episode]:
    """Read the windows of a measured log, in the order of the file, each as `read_measured_log` does.

    `window_column` has numbers that stay the same throughout a window. Without one, a window begins where the
    time begins again or has a gap. `window` in the metadata is that number, `rows` those of the window. The
    command of one window may stand still.
    """
    form = form or LogFormat()
    warn = _Few(on_warning)
    if window_column in form.columns:
        raise InputError(
            f"window_column = {window_column}: must be a column of its own, not of time, command or angle"
        )
    if window_column is None:
        window_column, table = "run", _log_table(path, form)
        table, time_column, _, unit = _timed(table, form, warn)
        time = table.column(time_column)
        steps = np.diff(time)
        wide = np.flatnonzero(steps > max(GAP * np.median(steps), SHORTEST_PAUSE_S / unit)) + 1
        numbers = np.zeros(len(time))
        numbers[[*_run_begins(time)[1:], *wide.tolist()]] = 1
        numbers = numbers.cumsum()
    else:
        table = _log_table(path, form, window_column)
        numbers = table.column(window_column)
    begins = np.flatnonzero(np.diff(numbers, prepend=np.nan) != 0)
    if len(begins) > MOST_WINDOWS:
        raise InputError(
            f"{path}: {window_column} changes {len(begins) - 1} times, at most {MOST_WINDOWS} windows are "
            "read: check `window_column`"
        )
    _refuse_standstill(table, form.command_column)
    episodes = []
    for begin, end in zip(begins.tolist(), [*begins[1:].tolist(), len(numbers)], strict=True):
        window = int(numbers[begin]) if numbers[begin].is_integer() else float(numbers[begin])
        try:
            log = _log_of(table.only(slice(begin, end)), form, warn, may_stand_still=True)
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
    def __init__(self, on_warning: Warn | None) -> None:
        self._on_warning, self._given, self._more = on_warning or (lambda _: None), set[str](), 0

    def __call__(self, line: str) -> None:
        if line not in self._given and len(self._given) < MOST_WARNINGS:
            self._given.add(line)
            self._on_warning(line)
        elif line not in self._given:
            self._more += 1

    def finish(self, path: Path) -> None:
        """Give the number of the other warnings."""
        if self._more:
            self._on_warning(f"{path}: {self._more} more warnings like these")


def oddities(*logs: Episode) -> list[str]:
    """Return a warning, in one line, for each of command, angle and time that is hardly an endoscope's."""
    facts = logs[0].metadata
    command, angle, time = facts["command_column"], facts["angle_column"], facts["time_column"]
    radius = facts["pulley_radius"]
    pull = float(np.ptp(np.concatenate([log.pull for log in logs])))
    bend = float(np.ptp(np.concatenate([log.truth_deg for log in logs])))
    check_command = "check `command_unit`" + (" and `pulley_radius`" if radius is not None else "")
    check_time = "check `time_unit`" + (" and `seconds_per_cycle`" if facts["seconds_per_cycle"] else "")
    step = float(np.median([log.sample_time for log in logs]))
    seconds = float(sum(log.time[-1] for log in logs))
    turn = float(np.degrees(pull / radius)) if radius is not None else PULLEY_RANGE_DEG[0]
    checks = (
        (command, "ranges over", turn, PULLEY_RANGE_DEG, "deg", "", "check `command_unit`"),
        (command, "ranges over", pull * 1e3, PULL_RANGE_MM, "mm", " of pulling distance", check_command),
        (angle, "ranges over", bend, BEND_RANGE_DEG, "deg", "", "check `angle_unit`"),
        (time, "steps by", step, SAMPLE_TIMES_S, "s", "", check_time),
        (time, "ranges over", seconds, LENGTHS_S, "s", "", check_time),
    )
    lines: dict[str, str] = {}
    for name, verb, value, (low, high), unit, of, advice in checks:
        if not low <= value <= high:
            odd = f"little (less than {low:g}" if value < low else f"much (more than {high:g}"
            line = f"{name} {verb} {value:.3g} {unit}{of}, unusually {odd} {unit}): {advice}"
            lines.setdefault(name, line)
    return list(lines.values())
