"""Recorded command signal from a CSV file, resampled to an even time grid."""

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.bounds import LONGEST_SECONDS
from twin.measured.table import (
    SECONDS_PER_CYCLE,
    TIME_COLUMNS,
    CsvTable,
    average_repeats,
    check_cycle,
    pulling_distance,
    read_columns,
    refuse_implausible_times,
    time_unit_of,
)
from twin.preset.preset import Preset

Array = NDArray[np.float64]
COMMAND_COLUMNS = ("pull_mm", "command_deg")  # names of the column of the command, the first of which counts


@dataclasses.dataclass(frozen=True)
class CommandFormat:
    """Columns and units of a recorded command; a unit of None is the ending of the column's name.

    Attributes:
        command_column: column of the command of wire a; None: pull_mm or command_deg, whichever exists.
        command_unit: deg or rad for an angle of the preset's pulley, mm or m for a pulling distance; of both
            commands.
        lateral_command_column: column of the command of wire c; None: it is not commanded by the file.
        time_column: column of the time or phase; None: time_s or phase_rad, whichever exists.
        time_unit: s, ms or us; rad for a phase.
        seconds_per_cycle: duration of a phase of 2 pi [s].
    """

    command_column: str | None = None
    command_unit: str | None = None
    lateral_command_column: str | None = None
    time_column: str | None = None
    time_unit: str | None = None
    seconds_per_cycle: float = SECONDS_PER_CYCLE

    @property
    def columns(self) -> set[str]:
        """Names of all columns that such a file may have."""
        names = {self.command_column} if self.command_column else {*COMMAND_COLUMNS}
        names |= {self.time_column} if self.time_column else {*TIME_COLUMNS}
        return names | ({self.lateral_command_column} if self.lateral_command_column else set())


def read_command(
    path: Path, preset: Preset, sample_time: float, form: CommandFormat | None = None
) -> tuple[Array, Array | None]:
    """Read a recorded command at even samples: pulls of wire a and, where there are some, of wire c (N,) [m].

    The file has a header. A command that is an angle is one of the preset's pulley. Samples at one time are
    averaged; between samples the command is linear.
    """
    form = form or CommandFormat()
    check_cycle(form.seconds_per_cycle)
    table = read_columns(path, form.columns, "command file")
    command_name = table.first_of((form.command_column,) if form.command_column else COMMAND_COLUMNS)
    time_name = table.first_of((form.time_column,) if form.time_column else TIME_COLUMNS)
    _, unit = time_unit_of(table, time_name, form.time_unit, form.seconds_per_cycle)
    refuse_implausible_times(table, time_name, unit)
    names = [command_name, *([form.lateral_command_column] if form.lateral_command_column else [])]
    pulls = np.column_stack([_pull(table, name, preset, form) for name in names])

    instants, means = average_repeats(table.time(time_name) * unit, pulls)
    seconds = float(instants[-1] - instants[0])
    if seconds < sample_time:
        raise InputError(f"{path}: the command lasts less than one sample of {sample_time:g} s")
    if seconds > LONGEST_SECONDS:
        most = f"at most {LONGEST_SECONDS:g} s are simulated: check `time_unit`"
        raise InputError(f"{path}: the command lasts {seconds:g} s, {most}")
    grid = np.arange(instants[0], instants[-1], sample_time)
    pull, *lateral = (np.interp(grid, instants, mean) for mean in means.T)
    return pull, lateral[0] if lateral else None


def _pull(table: CsvTable, name: str, preset: Preset, form: CommandFormat) -> Array:
    advice = f"pulley_radius of the preset, {preset.pulley_radius:g} m"
    pull, _ = pulling_distance(table, name, form.command_unit, preset.pulley_radius, advice, may_miss=False)
    return pull
