"""An episode as a CSV table, for spreadsheets and for programs that know no MCAP."""

from pathlib import Path

import numpy as np

from twin.episode import Episode
from twin.recording.atomic import write_whole


def write_csv(path: str | Path, episode: Episode) -> Path:
    """Write an episode as a CSV table, one row per sample, in a file that appears only when it is whole.

    The columns are `time_s,pull_mm,bend_deg` and, where wire tensions were recorded,
    `tension_a_n,tension_b_n` (at the pulley, in newton). Each number has the digits that read back as the
    same double.

    Returns:
        The path of the file.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    columns = {"time_s": episode.time, "pull_mm": episode.pull_mm, "bend_deg": episode.bend_deg}
    if episode.wire_tension.shape[2] > 0:
        columns["tension_a_n"], columns["tension_b_n"] = episode.tension.T
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    write_whole(path, "\n".join(lines) + "\n")
    return Path(path)
