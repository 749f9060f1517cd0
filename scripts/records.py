"""Reading the folders that a verb is given into records at one sample time."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.recording import read_dataset

Array = NDArray[np.float64]


def read_episodes(paths: Sequence[Path], sample_time: float) -> list[Episode]:
    """Read all episodes of folders and files: simulated ones thinned, measured ones interpolated.

    Raises:
        FileNotFoundError: a path does not exist or a folder holds no MCAP file.
        ValueError: a file is damaged, or the sample time does not fit it.
    """
    episodes = [episode for path in paths for episode in read_dataset(path)]
    return [
        episode.on_grid(sample_time)
        if episode.metadata.get("source") == "measured"
        else episode.every(sample_time)
        for episode in episodes
    ]


def true_records(paths: Sequence[Path], sample_time: float) -> list[tuple[Array, Array]]:
    """Return `(pull_mm, true bend_deg)` of each episode: what noise is added to and scored against."""
    return [(episode.pull_mm, episode.bend_deg) for episode in read_episodes(paths, sample_time)]
