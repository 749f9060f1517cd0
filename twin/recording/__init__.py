"""Episode files: one MCAP file each, written atomically, and the same data as a CSV table."""

from twin.recording.features import write_csv
from twin.recording.reader import (
    Recovered,
    episode_files,
    read_dataset,
    read_episode,
    read_estimates,
    read_metadata,
    recover_episode,
)
from twin.recording.writer import EpisodeWriter, write_episode

__all__ = [
    "EpisodeWriter",
    "Recovered",
    "episode_files",
    "read_dataset",
    "read_episode",
    "read_estimates",
    "read_metadata",
    "recover_episode",
    "write_csv",
    "write_episode",
]
