"""Windows of a measured log: pieces that were cut from longer records, without what came before them.

A column tells them apart: where its value changes, another window begins. Each becomes an episode of its own;
read as one log, the jumps between them would be taken for motion.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from twin.episode import Episode
from twin.errors import InputError
from twin.measured.log import log_of, log_table
from twin.measured.log_columns import refuse_standstill
from twin.measured.log_format import LogFormat

MOST_WINDOWS = 10_000
"""Largest number of windows in a file: more come of a column that is none of windows."""
MOST_WARNINGS = 10
"""Largest number of warnings of a file: windows often share a fault."""


def read_windows(
    path: Path,
    window_column: str,
    form: LogFormat | None = None,
    *,
    on_warning: Callable[[str], None] | None = None,
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

    def __init__(self, on_warning: Callable[[str], None] | None) -> None:
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
