"""Reader of episodes from MCAP files; a damaged file gives one line that names the file and its first fault.

The `mcap` library reads the records and checks the CRCs of the chunks and of the data section.
"""

import contextlib
import dataclasses
import io
import os
import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from numpy.typing import NDArray

from twin.episode import Dataset, Episode
from twin.errors import InputError, MissingFileError
from twin.files.bounded import MEBIBYTE, opened
from twin.files.json_text import parse_json
from twin.files.shown import shown
from twin.recording.container import MAGIC
from twin.recording.endotwin_pb2 import Estimate
from twin.recording.features import LARGEST, refuse_implausible
from twin.recording.messages import ESTIMATE_PREFIX, SCHEMAS, decode, places_of, required_topics
from twin.recording.writer import METADATA_RECORD

Array = NDArray[np.float64]
COMMAND_TOPIC, MEASUREMENT_TOPIC, JOINTS_TOPIC = "/command", "/measurement", "/joint_states"
TOPICS = frozenset(SCHEMAS) - {"/scene"}  # topics that an episode is read from
HINT = "; `recover_episode` saves what is before the fault"
"""Hint after the fault of a file that is cut off or damaged."""

MOST_BYTES = 4 * 2**30  # largest file that is read [bytes]
LARGEST_FIELD = 256 * MEBIBYTE
_MOST_METADATA = 4 * MEBIBYTE
_BLOCK = 2**20  # [bytes]

# Records of an endoscope that stands still unpack to about 40 times their size in a file, moving ones to 3
# or 4 times. Writers index each message by 16 bytes that are not compressed.
_SMALLEST_LIMIT = 64 * MEBIBYTE
_LARGEST_RATIO = 64
_SMALLEST_RECORD_LIMIT = 200_000
_FEWEST_BYTES_PER_RECORD = 8
_SMALLEST_JOINT_LIMIT = 1_000_000  # an empty joint of 2 bytes becomes an object of 100
_JOINT_TAGS = (b"\x12", b"\x92")  # one of them begins each joint of a JointStates: field 2, of known length
_HEAD = struct.Struct("<BQ")  # opcode and length of a record
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time and publish time of a message


class Contents:
    """Contents of an MCAP file, up to its first fault."""

    def __init__(self, file_size: int, kept: Collection[str] = TOPICS) -> None:
        self.times: dict[str, list[int]] = {}  # log times of the messages by topic [ns]
        self.payloads: dict[str, list[bytes]] = {}  # the messages, in the same order
        self.items: dict[str, str] | None = None  # metadata of the episode, each item as JSON, if any
        self.attachments: dict[str, bytes] = {}  # files kept in the file, by name
        self.fault = ""  # what is wrong with the file; empty if nothing is
        self._kept = kept
        self._channels: dict[int, Channel] = {}
        self._schemas: dict[int, Schema] = {}
        self._file_size = file_size
        self._bytes_left = max(_SMALLEST_LIMIT, _LARGEST_RATIO * file_size)
        self._records_left = max(_SMALLEST_RECORD_LIMIT, file_size // _FEWEST_BYTES_PER_RECORD)

    @property
    def topics(self) -> set[str]:
        """Topics that the file describes."""
        return {channel.topic for channel in self._channels.values()}

    @property
    def is_measured(self) -> bool:
        """True where the metadata states that a real endoscope left this file, live or in a log."""
        return (self.items or {}).get("source") == '"measured"'

    def add(self, record: Any) -> None:
        """Add one record of the file, with the records inside a chunk; other kinds are skipped."""
        if isinstance(record, Chunk):
            self._add_chunk(record)
        elif isinstance(record, (Schema, Channel)):
            self._describe(record)
        elif isinstance(record, Message):
            place = self._place(record.channel_id)
            if place is not None:
                place[0].append(record.log_time)
                place[1].append(record.data)
        elif isinstance(record, Metadata) and record.name == METADATA_RECORD:
            self.items = record.metadata
        elif isinstance(record, Attachment):
            self.attachments[record.name] = record.data

    def _add_chunk(self, chunk: Chunk) -> None:
        """Add the records of a chunk, unless the file would unpack to more than its size explains."""
        size = chunk.uncompressed_size
        if chunk.compression == "zstd":  # a frame may state another size, which would be allocated
            size = max(size, zstandard.frame_content_size(chunk.data))
        elif chunk.compression not in ("", "lz4"):
            raise InputError(f"a chunk is compressed by {chunk.compression!r}: zstd and lz4 are supported")
        self._bytes_left -= size
        if self._bytes_left < 0:
            raise InputError(f"a chunk claims {size} bytes: more than a file of this size may unpack to")
        if chunk.compression == "lz4":  # a frame may hold more than it claims
            unpacked = LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
            chunk = dataclasses.replace(chunk, compression="", data=unpacked)
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        self._add_inner(stream.read(size))

    def _add_inner(self, raw: bytes) -> None:
        """Add the records of a chunk; five times as fast as `mcap.stream_reader.breakup_chunk`."""
        read_head, read_message, head, fields = _HEAD.unpack_from, _MESSAGE.unpack_from, 9, _MESSAGE.size
        message, offset, end, left = int(Opcode.MESSAGE), 0, len(raw), self._records_left
        places: dict[int, tuple[list[int], list[bytes]] | None] = {}
        while offset < end:
            opcode, length = read_head(raw, offset)
            body = offset + head
            offset = body + length
            left -= 1
            if offset > end:
                raise InputError(f"a record claims {length} bytes: {end - body} are left")
            if left < 0:
                raise InputError("its chunks hold more records than a file of this size may hold")
            if opcode == message:
                channel, _, time, _ = read_message(raw, body)
                if channel not in places:
                    places[channel] = self._place(channel)
                place = places[channel]
                if place is not None:
                    place[0].append(time)
                    place[1].append(raw[body + fields : offset])
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                kind = Schema if opcode == Opcode.SCHEMA else Channel
                part: Any = _Bytes(io.BytesIO(raw[body:offset]), length)
                self._describe(kind.read(ReadDataStream(part)))
        self._records_left = left

    def _place(self, channel: int) -> tuple[list[int], list[bytes]] | None:
        """Return the lists for times and messages of a channel; None if they are not kept."""
        if channel not in self._channels:
            raise InputError(f"a message is on channel {channel}, which is not described")
        topic = self._channels[channel].topic
        if topic not in self._kept:
            return None
        return self.times.setdefault(topic, []), self.payloads.setdefault(topic, [])

    def _describe(self, record: Schema | Channel) -> None:
        """Add a schema or a channel; one that is repeated must be identical."""
        known: dict[int, Any] = self._schemas if isinstance(record, Schema) else self._channels
        if known.setdefault(record.id, record) != record:
            kind = type(record).__name__.lower()
            raise InputError(f"{kind} {record.id} is described twice, differently")

    def metadata(self) -> dict[str, Any]:
        """Return the metadata of the episode; an item is JSON, a known one of its kind."""
        if self.items is None:
            raise InputError(f"metadata record {METADATA_RECORD!r} is missing")
        from twin.recording.facts import check_facts  # pydantic: loaded when a file is read

        size = sum(len(name) + len(text) for name, text in self.items.items())
        if size > _MOST_METADATA:
            raise InputError(f"metadata has {size} characters: at most {_MOST_METADATA}")
        metadata = {}
        for name, text in self.items.items():
            try:
                metadata[name] = parse_json(text, _MOST_METADATA)
            except ValueError as error:
                raise InputError(f"metadata {shown(name)} {error}") from error
        check_facts(metadata)
        return metadata

    def episode(self, *, hidden: bool = True) -> Episode:
        """Return the episode of the messages, with its hidden state or without."""
        metadata = self.metadata()
        self.check_topics()
        payloads = self.payloads.get(JOINTS_TOPIC, [])
        joints = sum(payload.count(tag) for payload in payloads for tag in _JOINT_TAGS)
        if joints > max(_SMALLEST_JOINT_LIMIT, self._file_size):
            raise InputError("/joint_states has more joints than a file of this size may hold")
        arrays = decode(self.times, self.payloads, hidden=hidden, measured=self.is_measured)
        episode = Episode(**arrays, metadata=metadata, attachments=self.attachments)
        refuse_implausible(episode)
        return episode

    def check_topics(self) -> None:
        """Refuse a file in which a topic of an episode is missing or has another encoding or schema."""
        for topic in required_topics(measured=self.is_measured):
            if topic not in self.topics:
                raise InputError(f"topic {topic} is missing")
        for topic in sorted(self.topics & TOPICS):
            self.check_schema(topic, SCHEMAS[topic])

    def format_of(self, topic: str) -> tuple[str, Schema | None]:
        """Return the encoding of the messages of a topic, and their schema if they have one."""
        channels = [channel for channel in self._channels.values() if channel.topic == topic]
        if len({(channel.message_encoding, channel.schema_id) for channel in channels}) > 1:
            raise InputError(f"topic {topic} has messages of more than one type")
        return channels[0].message_encoding, self._schemas.get(channels[0].schema_id)

    def check_schema(self, topic: str, kind: Any) -> None:
        """Refuse a topic whose messages are not Protobuf messages of a class."""
        wanted = kind.DESCRIPTOR.full_name
        for channel in self._channels.values():
            schema = self._schemas.get(channel.schema_id)
            found = schema.name if schema else "none"
            if channel.topic == topic and (channel.message_encoding, found) != ("protobuf", wanted):
                raise InputError(
                    f"topic {topic} has {channel.message_encoding!r} messages of schema {found}: "
                    f"must be 'protobuf' of {wanted}"
                )

    def keep_whole_samples(self) -> None:
        """Keep the samples that every topic of the episode has, in the order of time."""
        topics = ({*required_topics(measured=self.is_measured)} | self.topics) & TOPICS
        by_time = {
            topic: dict(zip(self.times.get(topic, []), self.payloads.get(topic, []), strict=True))
            for topic in sorted(topics)
        }
        measured = by_time[MEASUREMENT_TOPIC]
        always = [{*messages} for topic, messages in by_time.items() if topic != MEASUREMENT_TOPIC]
        last = max(measured, default=-1)
        whole = sorted(time for time in set.intersection(*always) if time <= last)
        for topic, messages in by_time.items():
            self.times[topic] = [time for time in whole if time in messages]
            self.payloads[topic] = [messages[time] for time in self.times[topic]]


class _Bytes:
    """Bytes to read from; unlike in a file, a read beyond their end is an error."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._left = file, size

    def read(self, size: int) -> bytes:
        if size > self._left:
            raise EOFError(f"a record claims {size} bytes: {self._left} are left")
        if not 0 <= size <= LARGEST_FIELD:
            raise InputError(f"a field claims {size} bytes")
        self._left -= size
        return self._file.read(size)


def read_contents(path: Path, kept: Collection[str] = TOPICS) -> Contents:
    """Read a file up to its first fault; only messages on the topics `kept` are kept."""
    with opened(path, "an MCAP file") as file:
        size = os.fstat(file.fileno()).st_size
        if size > MOST_BYTES:
            raise InputError(f"{path} has {size} bytes: an MCAP file of at most {MOST_BYTES} is read")
        begin = file.read(len(MAGIC))
        if begin != MAGIC[: len(begin)]:
            raise InputError(f"{path} is not an MCAP file: it does not begin with the MCAP mark")
        size = _without_zeros(file, size)
        if size == 0:
            raise InputError(f"{path} is cut off: it is empty")
        contents = Contents(size, kept)
        file.seek(0)
        # Damaged bytes raise exceptions of no closed list: mcap, zstandard and Protobuf have their own and
        # let through those of struct, of codecs and of dictionaries.
        try:
            source: Any = _Bytes(file, size)
            for record in StreamReader(source, emit_chunks=True, validate_crcs=True).records:
                contents.add(record)
        except MemoryError:
            raise
        except EOFError as error:
            contents.fault = f"is cut off: {one_line(error)}"
        except Exception as error:
            contents.fault = f"is damaged: {one_line(error)}"
    return contents


def _without_zeros(file: BinaryIO, size: int) -> int:
    """Size of a file without the zeros at its end, which a file system leaves where the power failed."""
    zeros = bytes(_BLOCK)
    while size > 0:
        start = (size - 1) // _BLOCK * _BLOCK
        file.seek(start)
        block = file.read(size - start)
        if block != zeros[: len(block)]:
            return start + len(block.rstrip(b"\0"))
        size = start
    return 0


def whole_contents(path: Path, kept: Collection[str]) -> Contents:
    """Read a file that must be complete and undamaged; only messages on the topics `kept` are kept."""
    contents = read_contents(path, kept)
    if contents.fault:
        raise InputError(f"{path} {contents.fault}{HINT}")
    return contents


@contextlib.contextmanager
def named_errors(prefix: str) -> Iterator[None]:
    """Context manager: any error of a damaged file becomes one line after a prefix."""
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{prefix}: {one_line(error)}") from error


def one_line(error: Exception) -> str:
    """Return the text of an error in one line, with its class where the text alone is not enough."""
    text = " ".join(str(error).split())
    if isinstance(error, (ValueError, EOFError)) and text:
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def read_episode(path: str | Path, *, hidden: bool = True) -> Episode:
    """Read one episode; `messages.decode` states which arrays are empty where nothing was recorded.

    `hidden=False` leaves out the hinge angles and the wires, which take most of the time. Topics beyond those
    of an episode are skipped; in its metadata, tuples have become lists.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not an MCAP file, is cut off or damaged, or holds no whole episode.
    """
    path = Path(path)
    contents = whole_contents(path, TOPICS if hidden else TOPICS - {JOINTS_TOPIC})
    with named_errors(f"{path} holds no whole episode"):
        return contents.episode(hidden=hidden)


def read_metadata(path: str | Path) -> dict[str, Any]:
    """Read the metadata of an episode, and verify every CRC of its file, without decoding the messages."""
    path = Path(path)
    contents = whole_contents(path, kept=())
    with named_errors(f"{path} holds no whole episode"):
        contents.check_topics()
        return contents.metadata()


def read_estimates(path: str | Path, topic: str) -> Array:
    """Read the angles of a topic of `Estimate` messages next to an episode: an estimator's, or `/reference`.

    Returns:
        (N,) angle at each sample of the episode [deg], NaN where there is no message; (0,) if the file has
        no such topic.
    """
    return read_intervals(path, topic)[:, 0]


def read_intervals(path: str | Path, topic: str) -> Array:
    """Read what `read_estimates` reads, and the low and high end of the 95 % interval, (N, 3) or (0, 3)."""
    path = Path(path)
    contents = whole_contents(path, {COMMAND_TOPIC, topic})
    if topic not in contents.topics:
        return np.empty((0, 3))
    with named_errors(f"{path} holds no whole {topic}"):
        contents.check_schema(topic, Estimate)
        commands = contents.times.get(COMMAND_TOPIC, [])
        angles_deg = np.full((len(commands), 3), np.nan)
        messages = [Estimate.FromString(payload) for payload in contents.payloads.get(topic, [])]
        places = places_of(contents.times.get(topic, []), commands, topic)
        for place, of in zip(places, messages, strict=True):
            ends = [of.low_deg, of.high_deg] if of.HasField("low_deg") and of.HasField("high_deg") else np.nan
            angles_deg[place, 0], angles_deg[place, 1:] = of.estimate_deg, ends
        if (wrong := np.abs(angles_deg) > LARGEST["measured_deg"]).any():
            rule = f"must be from {-LARGEST['measured_deg']:g} to {LARGEST['measured_deg']:g}"
            raise InputError(f"an angle of {topic} is {angles_deg[wrong][0]:g} deg: {rule}")
    return angles_deg


def estimate_topics(path: str | Path) -> list[str]:
    """Return the topics of estimators that a file describes, in the order of their names."""
    return sorted(of for of in whole_contents(Path(path), ()).topics if of.startswith(ESTIMATE_PREFIX))


def read_dataset(path: str | Path, *, hidden: bool = True) -> Dataset:
    """Read all episodes of a folder, in the order of their names, or the one of a file; see `read_episode`.

    Raises:
        FileNotFoundError: there is no such folder or file, or no `*.mcap` in the folder.
        ValueError: a file is damaged (see `read_episode`).
    """
    return Dataset(read_episode(file, hidden=hidden) for file in episode_files(path))


def episode_files(path: str | Path) -> list[Path]:
    """Return the `*.mcap` files of a folder in the order of their names, or the single file of a path."""
    path = Path(path)
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"))
    if not files:
        raise MissingFileError(f"no *.mcap file in {path}")
    return files


@dataclasses.dataclass(frozen=True)
class Recovered:
    """Contents of a file before its first fault: complete samples, in the order of time."""

    episode: Episode  # of these samples; its metadata has an item `recovered`, unless the file has no fault
    samples: int  # number of complete samples
    samples_expected: int | None  # number that the file once had, by its metadata; None if unknown
    faults: tuple[str, ...] = ()  # first fault of the file; empty if it has none

    @property
    def summary(self) -> str:
        """Summary in one sentence: the share that is intact, and the fault."""
        count, expected, step = self.samples, self.samples_expected, self.episode.sample_time
        if expected is None:
            whole = f"{count:,} samples ({count * step:.1f} s) are complete of an unknown number"
        else:
            seconds = f"{count * step:.1f} of {expected * step:.1f} s"
            whole = f"{count:,} of {expected:,} samples ({seconds}) are complete"
        return "; ".join([whole, *self.faults])


def recover_episode(path: str | Path) -> Recovered:
    """Read the samples before the first fault of a file; of a file without fault, the same as `read_episode`.

    A sample is whole if all topics of the episode have it; `/measurement` may be missing, as where a sensor
    saw nothing. `mcap recover` of the MCAP command line tool may save more after a damaged chunk.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not an MCAP file, or no metadata or fewer than two samples are complete.
    """
    path = Path(path)
    contents = read_contents(path)
    fault = contents.fault
    try:
        if not fault:
            episode = contents.episode()
            return Recovered(episode, len(episode.time), len(episode.time))
    except MemoryError:
        raise
    except Exception as error:
        fault = f"holds no whole episode: {one_line(error)}"
    with named_errors(f"{path} {fault}; nothing can be recovered"):
        contents.keep_whole_samples()
        count = len(contents.times[COMMAND_TOPIC])
        if count < 2:
            raise InputError(f"{count} samples are complete: an episode has two or more")
        episode = contents.episode()
    expected = episode.metadata.get("samples")
    expected = expected if type(expected) is int and expected >= count else None
    episode.metadata["recovered"] = {"samples": count, "expected": expected}
    return Recovered(episode, count, expected, (fault.partition(": ")[2] or fault,))
