"""Columns of a LeRobot dataset, from an episode: observations, actions, labels and hidden states."""

import dataclasses
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from twin.episode import Episode
from twin.recording.features import FEATURES, column_names, recorded

OBSERVED = ("/measurement", "/tension")
"""Topics of the columns of `observation.state`."""
COMMANDED = ("/command",)
"""Topics of the columns of `action`."""
TRUE = "truth."
"""Prefix of the names of labels and hidden states: the quantities of every other topic."""


@dataclasses.dataclass(frozen=True)
class Column:
    """One feature of a LeRobot dataset.

    Attributes:
        values: (N, numbers), in the type that is stored.
        names: name of each number; None where it needs none.
    """

    values: NDArray[Any]
    names: tuple[str, ...] | None

    @property
    def feature(self) -> dict[str, Any]:
        """Its entry in `info.json`: type, shape, names."""
        return {
            "dtype": str(self.values.dtype),
            "shape": [self.values.shape[1]],
            "names": None if self.names is None else list(self.names),
        }

    @property
    def array(self) -> pa.Array:
        """As stored: numbers where there is one per frame, else lists of a fixed length. NaN stays NaN."""
        flat = pa.array(self.values.ravel(), from_pandas=False)
        numbers = self.values.shape[1]
        return flat if numbers == 1 else pa.FixedSizeListArray.from_arrays(flat, numbers)


def frame_columns(
    episode: Episode, *, per_second: int, episode_index: int, first_index: int, task_index: int
) -> dict[str, Column]:
    """Return all columns of an episode by name, in the order of the dataset.

    What policies read and write, `observation.state` and `action`, is float32, as they want it. Labels and
    hidden states are float64, as they are in the episode.

    Args:
        episode: at even samples.
        per_second: samples of a second.
        episode_index: number of the episode in the dataset.
        first_index: number of its first frame in the dataset.
        task_index: number of its task.
    """
    held = recorded(episode)
    count = len(episode.time)
    parts = {
        feature: Column(
            held[feature.name].reshape(count, -1).astype(np.float64),
            column_names(feature, held[feature.name].shape[1:]),
        )
        for feature in FEATURES
        if feature.name in held
    }
    columns = {
        "observation.state": _joined([part for feature, part in parts.items() if feature.topic in OBSERVED]),
        "action": _joined([part for feature, part in parts.items() if feature.topic in COMMANDED]),
    }
    columns |= {
        TRUE + feature.column: part
        for feature, part in parts.items()
        if feature.topic not in OBSERVED + COMMANDED
    }
    frame = np.arange(count)
    columns["timestamp"] = Column((frame / per_second).astype(np.float32)[:, None], None)
    for name, numbers in {
        "frame_index": frame,
        "episode_index": np.full(count, episode_index),
        "index": first_index + frame,
        "task_index": np.full(count, task_index),
    }.items():
        columns[name] = Column(numbers.astype(np.int64)[:, None], None)
    return columns


def _joined(parts: list[Column]) -> Column:
    values = np.hstack([part.values for part in parts]).astype(np.float32)
    return Column(values, tuple(name for part in parts for name in part.names or ()))
