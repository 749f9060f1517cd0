"""Facts that a `dataset.json` states of each file and of all files together."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.episode import Episode
from twin.files.bounded import sha256_of
from twin.recording.features import combine, describe_features, statistics
from twin.recording.reader import read_episode


def length(episode: Episode) -> float:
    """Return the length of a record, from its first sample to one usual step after its last [s]."""
    return float(episode.time[-1] - episode.time[0]) + episode.sample_time


def describe_episode(path: Path, episode: Episode) -> dict[str, Any]:
    """Return the facts of a file from the episode that it holds."""
    return describe_file(path, len(episode.time), length(episode), statistics(episode))


def describe_file(
    path: Path, samples: int, seconds: float, figures: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """Return the facts of a file that is there, with its statistics by quantity."""
    return {
        "name": path.name,
        "samples": samples,
        "seconds": round(seconds, 9),
        "bytes": path.stat().st_size,
        "sha256": sha256_of(path),
        "statistics": figures,
    }


def totals(files: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the facts of all files together, from those of each."""
    return {
        "episodes": len(files),
        "seconds": round(sum(file["seconds"] for file in files), 9),
        "bytes": sum(file["bytes"] for file in files),
        "statistics": combine(file["statistics"] for file in files),
    }


def features_of(folder: Path, files: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the quantities that the files of a folder hold; no more are read than hold every quantity."""
    features: dict[str, dict[str, Any]] = {}
    for file in files:
        if not features.keys() >= file["statistics"].keys():
            features = describe_features(read_episode(folder / file["name"])) | features
    return features
