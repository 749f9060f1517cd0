"""An episode as a CSV table, for spreadsheets and for programs that know no MCAP."""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.episode import WIRES, Episode
from twin.files.atomic import write_whole
from twin.recording.features import FEATURES, Feature, recorded

Array = NDArray[np.float64]


def column_names(feature: Feature, shape: Sequence[int]) -> tuple[str, ...]:
    """Return a name for each number that a quantity has at a sample, its unit last.

    Args:
        feature: the quantity; of some the first axis counts the wires.
        shape: of one sample.

    Returns:
        Names in the order of the flattened numbers: `bend_deg`; `joint_angle_0_rad` ... from the base on;
        `tension_a_n`, `tension_b_n`; `wire_tension_a_0_n`, `wire_tension_a_1_n` ... from the pulley on.
    """
    stem, unit = feature.name.rsplit("_", 1)
    axes = [[str(place) for place in range(size)] for size in shape]
    if "*" in feature.field:
        axes[0] = list(WIRES[: shape[0]])
    return tuple("_".join([stem, *places, unit]) for places in itertools.product(*axes))


def write_csv(path: str | Path, episode: Episode, *, everything: bool = False) -> Path:
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
            f"tension_{name}_n": tension for name, tension in zip(WIRES, episode.tension.T, strict=False)
        }
    if len(episode.lateral_pull) > 0:
        columns["lateral_pull_mm"] = episode.lateral_pull * 1e3
    if len(episode.lateral_bend) > 0:
        columns["lateral_bend_deg"] = np.degrees(episode.lateral_bend)
    if everything:
        columns |= {name: values for name, values in _all_columns(episode).items() if name not in columns}
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    write_whole(path, "\n".join(lines) + "\n")
    return Path(path)


def _all_columns(episode: Episode) -> dict[str, Array]:
    columns: dict[str, Array] = {}
    held = recorded(episode)
    for feature in FEATURES:
        if feature.name in held:
            values = held[feature.name]
            names = column_names(feature, values.shape[1:])
            columns |= dict(zip(names, values.reshape(len(values), -1).T, strict=True))
    return columns


def _command_angle(episode: Episode) -> dict[str, Array]:
    """The command in degrees of the pulley; nothing where no preset tells the pulley's radius."""
    preset = episode.metadata.get("preset")
    if not isinstance(preset, Mapping) or "pulley_radius" not in preset:
        return {}
    return {"command_deg": np.degrees(episode.pull / float(preset["pulley_radius"]))}
