"""Writing an episode into one MCAP file, whose bytes depend on the episode alone.

The format is that of the MCAP specification (https://mcap.dev/spec): Protobuf messages in zstd chunks, with
CRCs over the chunks, the whole data section and the summary.
"""

import json
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.writer import CompressionType, Writer

from twin.episode import Episode
from twin.recording.atomic import WholeFile
from twin.recording.messages import encode

METADATA_RECORD = "endotwin"
"""Name of the metadata record that holds `Episode.metadata`, each item as JSON."""

_MEDIA_TYPES = {
    ".xml": "application/xml",
    ".yaml": "application/yaml",
    ".yml": "application/yaml",
    ".json": "application/json",
    ".csv": "text/csv",
    ".txt": "text/plain",
}


class EpisodeWriter:
    """Context manager: an MCAP file that appears under its name when the block ends without an exception.

    ```
    with EpisodeWriter("episode_000.mcap") as writer:
        writer.write(episode)
    ```
    """

    def __init__(self, path: str | Path) -> None:
        """Name the file; nothing is opened yet.

        Args:
            path: the final name.
        """
        self.path = Path(path)
        self._file = WholeFile(self.path)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._complete = False

    def __enter__(self) -> "EpisodeWriter":
        """Open the file under its temporary name, `.NAME.partial`.

        Raises:
            FileNotFoundError: the folder does not exist.
        """
        self._mcap = Writer(self._file.__enter__(), compression=CompressionType.ZSTD, enable_data_crcs=True)
        # The default names the version of the library: the same episode would differ between two machines.
        self._mcap.start(library=METADATA_RECORD)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Complete the file and give it its final name; under an exception, remove it.

        Raises:
            ValueError: the block ended well, but no whole episode was written.
        """
        if kind is None:
            try:
                if not self._complete:
                    raise ValueError(f"{self.path}: no whole episode was written")
                self._mcap.finish()
            except BaseException as failure:
                self._file.__exit__(type(failure), failure, failure.__traceback__)
                raise
        self._file.__exit__(kind, error, traceback)

    def write(self, episode: Episode) -> None:
        """Add every message, the metadata and the attachments of an episode; one episode makes one file.

        Raises:
            ValueError: metadata is not JSON, times or shapes do not fit (see `messages.encode`), or the file
                holds an episode already.
        """
        if self._complete:
            raise ValueError(f"{self.path} already holds an episode: one file, one episode")
        metadata = {name: _to_json(name, episode.metadata[name]) for name in sorted(episode.metadata)}
        for topic, time, message in encode(episode):
            self.add_message(topic, message, time)
        self._mcap.add_metadata(METADATA_RECORD, metadata)
        for name in sorted(episode.attachments):
            media_type = _MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream")
            self._mcap.add_attachment(0, 0, name, media_type, episode.attachments[name])
        self._complete = True

    def add_message(self, topic: str, message: Any, time: int) -> None:
        """Add one message, on a topic of an episode or on another (`/estimate/METHOD`, `/camera/...`).

        Args:
            topic: where it goes; its schema is that of the first message on the topic.
            message: any Protobuf message.
            time: nanoseconds of simulation; both log time and publish time.
        """
        if topic not in self._channels:
            self._channels[topic] = self._mcap.register_channel(topic, "protobuf", self._schema(message))
        data = message.SerializeToString(deterministic=True)
        self._mcap.add_message(self._channels[topic], time, data, time)

    def _schema(self, message: Any) -> int:
        name = message.DESCRIPTOR.full_name
        if name not in self._schemas:
            files = FileDescriptorSet()
            _add_file(files, message.DESCRIPTOR.file, set())
            data = files.SerializeToString(deterministic=True)
            self._schemas[name] = self._mcap.register_schema(name, "protobuf", data)
        return self._schemas[name]


def write_episode(path: str | Path, episode: Episode) -> Path:
    """Write an episode as one MCAP file; the same episode gives the same bytes.

    Returns:
        The path of the file.

    Raises:
        FileNotFoundError: the folder does not exist.
        ValueError: the episode does not fit the format (see `EpisodeWriter.write`); nothing is left behind.
    """
    with EpisodeWriter(path) as writer:
        writer.write(episode)
    return writer.path


def _add_file(files: FileDescriptorSet, file: Any, known: set[str]) -> None:
    """Add the descriptor of a .proto file after those it imports, so that a reader needs nothing else."""
    if file.name in known:
        return
    known.add(file.name)
    for dependency in file.dependencies:
        _add_file(files, dependency, known)
    file.CopyToProto(files.file.add())


def _to_json(name: str, value: Any) -> str:
    try:
        return json.dumps(value, sort_keys=True, allow_nan=False, default=_plain)
    except (TypeError, ValueError) as error:
        raise ValueError(f"metadata {name!r} is not JSON: {error}") from error


def _plain(value: Any) -> Any:
    """Numpy scalars and arrays as numbers and lists: seeds and parameters often come as such."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot be stored")
