"""Windows of measured logs in a calibration: which of them are fitted, and what they must show together."""

import collections
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.calibration.measured import (
    MeasuredLoop,
    check_angle,
    check_lateral_angle,
    check_motion,
    file_of_window,
    windows_of_files,
)
from twin.episode import Episode
from twin.errors import InputError

Array = NDArray[np.float64]

Record = tuple[Path, Episode]
"""A log, and the path that it was read from."""


def first_windows(records: Sequence[Record], fraction: float) -> tuple[list[Record], list[Record]]:
    """Divide logs into those to fit, and windows that are only predicted: the last of each file.

    Args:
        records: logs; the windows of a file in their order.
        fraction: share of the windows of each file that are fitted, at least one. Of a log that is no window
            a share of its samples is fitted, which is not done here.
    """
    fitted, rest = [], []
    windows = collections.Counter(file_of_window(episode) for _, episode in records)
    wanted = {origin: max(round(fraction * count), 1) for origin, count in windows.items()}
    for record in records:
        origin = file_of_window(record[1])
        if origin is None or wanted[origin] > 0:
            fitted.append(record)
        else:
            rest.append(record)
        wanted[origin] -= 1
    return fitted, rest


def check_windows(loops: Sequence[MeasuredLoop]) -> None:
    """Refuse windows of one file whose command reverses in none of them, or whose angle runs against it.

    One window may stand still or go one way: friction shows in the others.

    Args:
        loops: logs to fit.

    Raises:
        ValueError: so it is; the line names the first window.
    """
    for places in windows_of_files(loops):
        windows = [loops[place] for place in places]
        faults = [fault for loop in windows if (fault := _fault(loop))]
        if len(faults) == len(windows):
            raise faults[0]
        pull, bend = (_joined(windows, field) for field in ("pull", "bend"))
        check_angle(pull, bend, windows[0].name)
        if all(loop.lateral_pull.size and loop.lateral_bend.size for loop in windows):
            pull, bend = (_joined(windows, field) for field in ("lateral_pull", "lateral_bend"))
            check_lateral_angle(pull, bend, windows[0].name)


def _joined(loops: Sequence[MeasuredLoop], field: str) -> Array:
    return np.concatenate([getattr(loop, field)[loop.fitted] for loop in loops])


def _fault(loop: MeasuredLoop) -> InputError | None:
    try:
        check_motion(loop.pull[loop.fitted], loop.name)
    except InputError as fault:
        return fault
    return None
