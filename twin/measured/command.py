"""Recorded command signal from a CSV file, resampled to an even time grid."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.measured.csv_columns import average_repeats
from twin.measured.csv_reader import read_columns
from twin.preset.preset import Preset

Array = NDArray[np.float64]
SECONDS_PER_CYCLE = 20.0
"""Period at which a command with phases instead of times is played [s]: slow, quasi-static."""

_COMMANDS = ("pull_mm", "command_deg")
TIME_COLUMNS = ("time_s", "phase_rad")
"""Names of the column of the time, the first of which counts."""


def read_command(path: Path, preset: Preset, sample_time: float) -> Array:
    """Read a recorded command; returns its pulling distance, (N,) [m].

    The file has a header. The command is in `pull_mm`, or in `command_deg`, an angle of the preset's pulley;
    time is in `time_s`, or in `phase_rad`. Samples at one time are averaged; between samples the command is
    linear.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a column is missing, a value is no finite number, or time runs backwards.
    """
    table = read_columns(path, (*_COMMANDS, *TIME_COLUMNS), "command file")
    command_name, time_name = table.first_of(_COMMANDS), table.first_of(TIME_COLUMNS)
    command, time = table.column(command_name), table.time(time_name)
    if time_name == "phase_rad":
        time = time * SECONDS_PER_CYCLE / (2 * np.pi)
    pull = command * 1e-3 if command_name == "pull_mm" else np.radians(command) * preset.pulley_radius

    instants, mean_pull = average_repeats(time, pull)
    if instants[-1] - instants[0] < sample_time:
        raise InputError(f"{path}: the command lasts less than one sample of {sample_time:g} s")
    return np.interp(np.arange(instants[0], instants[-1], sample_time), instants, mean_pull)
