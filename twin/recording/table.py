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

COMMAND_ANGLE = "command_deg"
"""The command as an angle of the preset's pulley: the one column that is no quantity of `FEATURES`."""

TABLE = ("pull_mm", "bend_deg", COMMAND_ANGLE, "tension_n", "lateral_pull_mm", "lateral_bend_deg")
"""Quantities of the table beside an episode, in the order of their columns, after `time_s`."""


def column_names(feature: Feature, shape: Sequence[int]) -> tuple[str, ...]:
    """Return a name for each number that a quantity has at a sample, its unit last.

    Args:
        feature: the quantity; of some the first axis counts the wires.
        shape: of one sample.

    Returns:
        Names in the order of the flattened numbers: `bend_deg`; `joint_angle_0_rad` ... from the base on;
        `tension_a_n`, `tension_b_n`; `wire_tension_a_0_n`, `wire_tension_a_1_n` ... from the pulley on.
    """
    stem, unit = feature.column.rsplit("_", 1)
    axes = [[str(place) for place in range(size)] for size in shape]
    if "*" in feature.field:
        axes[0] = list(WIRES[: shape[0]])
    return tuple("_".join([stem, *places, unit]) for places in itertools.product(*axes))


def write_csv(path: str | Path, episode: Episode, *, everything: bool = False) -> Path:
    """Write an episode as a CSV table, one row per sample, in a file that appears only when it is whole.

    Returns:
        The path of the file.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    write_whole(path, csv_text(episode, everything=everything))
    return Path(path)


def csv_text(episode: Episode, *, everything: bool = False) -> str:
    """Return an episode as the text of a CSV table, one row per sample.

    The columns are `time_s`, those of the quantities of `TABLE` that are known, and, with `everything`, those
    of all others of `FEATURES`. Each number has the digits that read back as the same double.
    """
    held = recorded(episode)
    known = {
        feature.column: _columns(feature, held[feature.name]) for feature in FEATURES if feature.name in held
    }
    known |= _command_angle(episode)
    chosen = [name for name in TABLE if name in known]
    if everything:
        chosen += [name for name in known if name not in TABLE]
    columns = {"time_s": episode.time}
    for name in chosen:
        columns |= known[name]
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def _columns(feature: Feature, values: Array) -> dict[str, Array]:
    """Return each number of a quantity over time, by the name of its column."""
    names = column_names(feature, values.shape[1:])
    return dict(zip(names, values.reshape(len(values), -1).T, strict=True))


def _command_angle(episode: Episode) -> dict[str, dict[str, Array]]:
    """Return the command in degrees of the pulley; nothing where no preset states the pulley's radius."""
    preset = episode.metadata.get("preset")
    if not isinstance(preset, Mapping) or "pulley_radius" not in preset:
        return {}
    return {COMMAND_ANGLE: {COMMAND_ANGLE: np.degrees(episode.pull / float(preset["pulley_radius"]))}}
