"""An episode as a CSV table, for spreadsheets and for programs that know no MCAP."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.recording.atomic import write_whole

Array = NDArray[np.float64]


def write_csv(path: str | Path, episode: Episode) -> Path:
    """Write an episode as a CSV table, one row per sample, in a file that appears only when it is whole.

    The columns are `time_s,pull_mm,bend_deg` and, where they are known: `command_deg`, the command as an
    angle of the preset's pulley; `tension_a_n,tension_b_n` (and `tension_c_n,tension_d_n` with two bending
    planes), the tensions of the wires at the pulley; `lateral_pull_mm` and `lateral_bend_deg`. Each number
    has the digits that read back as the same double.

    Returns:
        The path of the file.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    columns = {"time_s": episode.time, "pull_mm": episode.pull_mm, "bend_deg": episode.bend_deg}
    columns |= _command_angle(episode)
    if episode.wire_tension.shape[2] > 0:
        columns |= {
            f"tension_{name}_n": tension for name, tension in zip("abcd", episode.tension.T, strict=False)
        }
    if len(episode.lateral_pull) > 0:
        columns["lateral_pull_mm"] = episode.lateral_pull * 1e3
    if len(episode.lateral_bend) > 0:
        columns["lateral_bend_deg"] = np.degrees(episode.lateral_bend)
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    write_whole(path, "\n".join(lines) + "\n")
    return Path(path)


def _command_angle(episode: Episode) -> dict[str, Array]:
    """The command in degrees of the pulley; nothing where no preset tells the pulley's radius."""
    preset = episode.metadata.get("preset")
    if not isinstance(preset, Mapping) or "pulley_radius" not in preset:
        return {}
    return {"command_deg": np.degrees(episode.pull / float(preset["pulley_radius"]))}
