"""Writer of an episode into one MCAP file, whose bytes depend only on the episode."""

import itertools
import json
import operator
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from twin.episode import Episode
from twin.errors import InputError
from twin.files.atomic import WholeFile
from twin.recording.chunks import message_chunks, sample_chunks
from twin.recording.container import Container
from twin.recording.messages import LARGEST_TIME, SCHEMAS, streams_of, to_nanoseconds

METADATA_RECORD = "endotwin"  # name of the metadata record that holds `Episode.metadata`, each item as JSON

_MEDIA_TYPES = {
    **{f".{kind}": f"application/{kind}" for kind in ("xml", "yaml", "json")},
    **{".yml": "application/yaml", ".csv": "text/csv", ".txt": "text/plain"},
}


class EpisodeWriter:
    """Context manager: an MCAP file that takes its final name when the block succeeds.

    ```
    with EpisodeWriter("episode_000.mcap") as writer:
        writer.write(episode)
    ```
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._file = WholeFile(self.path)
        self._others: list[tuple[int, str, bytes]] = []
        self._descriptors: dict[str, Any] = {}
        self._complete = False

    def __enter__(self) -> "EpisodeWriter":
        # Without a version of any library: the same episode would differ between two machines.
        self._container = Container(self._file.__enter__(), library=METADATA_RECORD)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if kind is None:
            try:
                if not self._complete:
                    raise InputError(f"{self.path}: no whole episode was written")
                self._write_others()
                self._container.finish()
            except BaseException as failure:
                self._file.__exit__(type(failure), failure, failure.__traceback__)
                raise
        self._file.__exit__(kind, error, traceback)

    def write(self, episode: Episode) -> None:
        """Add the metadata, the attachments and every message of an episode; one episode makes one file."""
        if self._complete:
            raise InputError(f"{self.path} already holds an episode: one file, one episode")
        metadata = metadata_texts(episode.metadata)
        nanoseconds = to_nanoseconds(episode.time)
        streams = streams_of(episode, nanoseconds[0])
        self._container.add_metadata(METADATA_RECORD, metadata)
        for name in sorted(episode.attachments):
            media_type = _MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream")
            self._container.add_attachment(name, media_type, episode.attachments[name])
        for stream in streams:
            self._descriptors.setdefault(stream.topic, SCHEMAS[stream.topic].DESCRIPTOR)
        channels = self._channels()
        on = [channels[stream.topic] for stream in streams]
        for content in sample_chunks(streams, on, np.array(nanoseconds)):
            self._container.add_chunk(content)
        self._complete = True

    def add_message(self, topic: str, message: Any, time: int) -> None:
        """Add one message on a topic that is not part of the episode: `/estimate/METHOD`, `/camera/...`.

        Such Protobuf messages may come in any order. They are kept in memory and written when the block ends,
        into chunks of their own, in the order of time [ns]; their sequence numbers count those of a topic.
        """
        if not 0 <= time <= LARGEST_TIME:
            raise InputError(f"{topic}: time {time} ns: a log time is from 0 to {LARGEST_TIME} ns")
        self._descriptors.setdefault(topic, message.DESCRIPTOR)
        self._others.append((time, topic, message.SerializeToString(deterministic=True)))

    def _channels(self) -> dict[str, int]:
        return {
            topic: self._container.add_channel(topic, descriptor)
            for topic, descriptor in self._descriptors.items()
        }

    def _write_others(self) -> None:
        channels = self._channels()
        counts = {topic: itertools.count() for topic in channels}
        messages = [
            (channels[topic], next(counts[topic]), time, data)
            for time, topic, data in sorted(self._others, key=operator.itemgetter(0))
        ]
        for content in message_chunks(messages):
            self._container.add_chunk(content)


def write_episode(path: str | Path, episode: Episode) -> Path:
    """Write an episode as one MCAP file; the same episode gives the same bytes.

    Raises:
        FileNotFoundError: the folder does not exist.
        ValueError: the episode does not fit the format (see `EpisodeWriter.write`); nothing is left over.
    """
    with EpisodeWriter(path) as writer:
        writer.write(episode)
    return writer.path


def metadata_texts(metadata: Mapping[str, Any]) -> dict[str, str]:
    """Return metadata as it is stored: each item as JSON, in the order of the names."""
    texts = {name: _to_json(name, metadata[name]) for name in sorted(metadata)}
    from twin.recording.facts import check_facts  # pydantic: loaded when a file is written

    check_facts({name: json.loads(text) for name, text in texts.items()})  # what is not read back
    return texts


def _to_json(name: str, value: Any) -> str:
    try:
        return json.dumps(value, sort_keys=True, allow_nan=False, default=_plain)
    except (TypeError, ValueError) as error:
        raise InputError(f"metadata {name!r} is not JSON: {error}") from error


def _plain(value: Any) -> Any:
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot be stored")
