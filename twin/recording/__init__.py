"""Episodes on disk: one MCAP file each, written whole or not at all, and the same data as a CSV table."""

from twin.recording.reader import read_dataset, read_episode
from twin.recording.table import write_csv
from twin.recording.writer import EpisodeWriter, write_episode

__all__ = ["EpisodeWriter", "read_dataset", "read_episode", "write_csv", "write_episode"]
