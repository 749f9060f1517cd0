"""Recording of a run on a log: the record anew, with `/estimate/METHOD` and `/health` beside it."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from twin.episode import Episode
from twin.recording import EpisodeWriter
from twin.recording.estimate import HEALTH_TOPIC, estimate_message, estimate_topic, health_message
from twin.stream.sample import StreamSample

SIGN = '"endotwin run"'
"""Item of the metadata by which the recording of a run on a log is known (`twin.files.atomic`)."""
PAUSE_S = 1.0
"""Time between two records that follow one another in one file [s]."""


class LogRecording:
    """Context manager: an MCAP file of one record and what a runtime made of it, whole or not at all.

    Attributes:
        offset_s: time in the file at which the stream that is added began [s].
    """

    def __init__(self, path: Path, episode: Episode, method: str, facts: Mapping[str, Any]) -> None:
        """Name the file; nothing is opened yet.

        Args:
            path: the final name.
            episode: the record.
            method: name of the estimator.
            facts: of the run, for the metadata.
        """
        self._writer = EpisodeWriter(path)
        self._topic = estimate_topic(method)
        metadata = episode.metadata | {"made_by": SIGN.strip('"'), "run": dict(facts)}
        self._episode = dataclasses.replace(episode, metadata=metadata)
        self.offset_s = 0.0

    def __enter__(self) -> "LogRecording":
        """Open the file, which has no name yet, and write the record.

        Raises:
            FileNotFoundError: the folder does not exist.
            ValueError: the record does not fit the format.
        """
        self._writer.__enter__()
        try:
            self._writer.write(self._episode)
        except BaseException as error:
            self._writer.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Complete the file and give it its name, or remove it after an exception."""
        self._writer.__exit__(kind, error, traceback)

    def add(self, sample: StreamSample) -> None:
        """Add what the runtime says of one sample, at its time."""
        nanoseconds = round((sample.time_s + self.offset_s) * 1e9)
        reading = sample.reading
        estimate = estimate_message(reading.bend_deg, *(reading.interval_deg or ()))
        self._writer.add_message(self._topic, estimate, nanoseconds)
        self._writer.add_message(HEALTH_TOPIC, health_message(reading), nanoseconds)


def joined(episodes: Sequence[Episode], names: Sequence[str]) -> tuple[Episode, list[float]]:
    """Return several records as one, a second apart, and how much later each of them is in it [s].

    Of the metadata and the arrays it has what all of them have: the metadata where they are equal, the
    arrays where their columns are. `records` in its metadata says what is where.
    """
    if len(episodes) == 1:
        return episodes[0], [0.0]
    offsets: list[float] = []
    end = -PAUSE_S
    for episode in episodes:
        offsets.append(end + PAUSE_S - float(episode.time[0]))
        end = offsets[-1] + float(episode.time[-1])
    arrays = {}
    for field in dataclasses.fields(Episode):
        parts = [getattr(episode, field.name) for episode in episodes]
        if isinstance(parts[0], np.ndarray) and field.name != "time":
            arrays[field.name] = _joined_arrays(parts)
    arrays["time"] = np.concatenate([e.time + offset for e, offset in zip(episodes, offsets, strict=True)])
    first = episodes[0].metadata
    common = {
        name: value
        for name, value in first.items()
        if all(name in e.metadata and e.metadata[name] == value for e in episodes)
    }
    records = [
        {"name": name, "begins_s": offset + float(episode.time[0]), "samples": len(episode.time)}
        for name, episode, offset in zip(names, episodes, offsets, strict=True)
    ]
    return Episode(**arrays, metadata=common | {"records": records}), offsets


def _joined_arrays(parts: Sequence[Any]) -> Any:
    """Return arrays joined: empty where one was not recorded, without columns where these differ."""
    if not all(len(part) > 0 for part in parts):
        return np.empty(0)
    if len({part.shape[1:] for part in parts}) == 1:
        return np.concatenate(parts)
    wires = [min(part.shape[1] for part in parts)] if parts[0].ndim == 3 else []
    return np.empty((sum(map(len, parts)), *wires, 0))
