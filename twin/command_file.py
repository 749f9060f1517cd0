"""A recorded command from a CSV file, as a pulling distance on an even grid of samples."""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.preset import Preset

Array = NDArray[np.float64]
SECONDS_PER_CYCLE = 20.0
"""A phase column says how far a cycle is, not how fast it runs: it is played at this slow rate."""


def read_command(path: Path, preset: Preset, sample_time: float) -> Array:
    """Return the pulling distance of a recorded command (N,) [m].

    The file has a header. The command is in `pull_mm`, or in `command_deg`, an angle of the preset's pulley;
    time is in `time_s`, or in `phase_rad`. Samples at one time are averaged; between samples the command is
    linear.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a column is missing, a value is no finite number, or time runs backwards.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no command file {path}")
    columns = _columns(path)
    command_name = _first(path, columns, ("pull_mm", "command_deg"))
    time_name = _first(path, columns, ("time_s", "phase_rad"))
    command, time = columns[command_name], columns[time_name]
    if time_name == "phase_rad":
        time = time * SECONDS_PER_CYCLE / (2 * np.pi)
    if (np.diff(time) < 0).any():
        line = int(np.argmax(np.diff(time) < 0)) + 3
        raise ValueError(f"{path} line {line}: {time_name} runs backwards")
    pull = command * 1e-3 if command_name == "pull_mm" else np.radians(command) * preset.pulley_radius

    instants, index = np.unique(time, return_inverse=True)
    mean_pull = np.bincount(index, weights=pull) / np.bincount(index)
    if instants[-1] - instants[0] < sample_time:
        raise ValueError(f"{path}: the command lasts less than one sample of {sample_time:g} s")
    return np.interp(np.arange(instants[0], instants[-1], sample_time), instants, mean_pull)


def _columns(path: Path) -> dict[str, Array]:
    try:
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} is not a CSV file") from error
    if not rows:
        raise ValueError(f"{path} holds no lines of data")
    columns = {}
    for name in rows[0]:
        values = np.empty(len(rows))
        for number, row in enumerate(rows):
            try:
                values[number] = float(row[name])
            except (TypeError, ValueError):
                values[number] = np.nan
            if name in _READ and not np.isfinite(values[number]):
                raise ValueError(f"{path} line {number + 2}: {name} is {row[name]!r}, not a finite number")
        columns[str(name)] = values
    return columns


def _first(path: Path, columns: dict[str, Array], names: tuple[str, ...]) -> str:
    for name in names:
        if name in columns:
            return name
    raise ValueError(f"{path} has no column {' or '.join(names)}; its columns: {', '.join(columns)}")


_READ = ("pull_mm", "command_deg", "time_s", "phase_rad")
