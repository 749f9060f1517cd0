"""Reading episodes from MCAP files; any damage to a file is one line that names the file and the fault."""

import io
import json
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import zstandard
from mcap.records import Attachment, Channel, Chunk, Footer, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from twin.episode import Episode
from twin.recording.messages import SCHEMAS, decode
from twin.recording.writer import METADATA_RECORD

_MAGIC = b"\x89MCAP0\r\n"  # opens and closes every MCAP file
_LARGEST_CHUNK = 2**28  # [bytes] uncompressed; writers use 1 to 4 MiB
_FOOTER_CRC = 4  # [bytes] last field of the footer


def read_episode(path: str | Path) -> Episode:
    """Read one episode; see `messages.decode` for what is zero columns wide where it was not recorded.

    Args:
        path: an MCAP file as `write_episode` makes it. Topics beyond those of an episode are passed over.

    Returns:
        The episode. In its metadata, tuples have become lists, as JSON has no tuples.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not an MCAP file, is cut off or damaged, or holds no whole episode.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"no file {path}")
    if path.is_dir():
        raise ValueError(f"{path} is a folder, not an MCAP file")
    data = path.read_bytes()
    if not data:
        raise ValueError(f"{path} is cut off: it is empty")
    if data[: len(_MAGIC)] != _MAGIC[: len(data)]:
        raise ValueError(f"{path} is not an MCAP file: it does not begin with the MCAP mark")
    if len(data) < 2 * len(_MAGIC) or not data.endswith(_MAGIC):
        raise ValueError(f"{path} is cut off: it does not end with the MCAP mark")

    # What can go wrong in bytes from anywhere is no closed list: mcap, zstandard and Protobuf have their own
    # exceptions and let through those of struct, of codecs and of dictionaries.
    try:
        records = list(_records(data))
    except Exception as error:
        raise ValueError(f"{path} is damaged: {_one_line(error)}") from error
    try:
        return _episode(records)
    except Exception as error:
        raise ValueError(f"{path} holds no whole episode: {_one_line(error)}") from error


def read_dataset(path: str | Path) -> list[Episode]:
    """Read every episode of a folder, in the order of the file names, or the one of a file.

    Raises:
        FileNotFoundError: there is no such folder or file, or no `*.mcap` in the folder.
        ValueError: a file is damaged (see `read_episode`).
    """
    path = Path(path)
    if not path.is_dir():
        return [read_episode(path)]
    files = sorted(path.glob("*.mcap"))
    if not files:
        raise FileNotFoundError(f"no *.mcap file in {path}")
    return [read_episode(file) for file in files]


def _records(data: bytes) -> Iterator[Any]:
    """Yield the records of a file with those inside chunks, all checked against the CRCs of the file."""
    # From memory, a length that is too large reads what there is; from a file it would be allocated first.
    # All records are read before any chunk is unpacked, as the CRC of the data section comes after them.
    reader = StreamReader(io.BytesIO(data), emit_chunks=True, validate_crcs=True)
    for record in list(reader.records):
        if isinstance(record, Chunk):
            _check_size(record)
            yield from breakup_chunk(record, validate_crc=True)
        else:
            if isinstance(record, Footer):
                _check_summary(record, data)
            yield record


def _check_size(chunk: Chunk) -> None:
    """Refuse a chunk that would unpack to more memory than any writer puts into one."""
    if chunk.compression not in ("zstd", ""):
        raise ValueError(f"a chunk is compressed by {chunk.compression!r}: only zstd is supported")
    sizes = [chunk.uncompressed_size]
    if chunk.compression == "zstd":
        sizes.append(zstandard.frame_content_size(chunk.data))
    if max(sizes) > _LARGEST_CHUNK:
        raise ValueError(f"a chunk claims {max(sizes)} bytes, more than {_LARGEST_CHUNK}")


def _check_summary(footer: Footer, data: bytes) -> None:
    """Check the CRC from the start of the summary up to the CRC itself, which `StreamReader` does not."""
    if footer.summary_start == 0 or footer.summary_crc == 0:
        return
    summary = data[footer.summary_start : -len(_MAGIC) - _FOOTER_CRC]
    if zlib.crc32(summary) != footer.summary_crc:
        raise ValueError("the CRC of the summary does not match")


def _episode(records: list[Any]) -> Episode:
    schemas: dict[int, Schema] = {}
    topics: dict[int, str] = {}
    times: dict[str, list[int]] = {}
    payloads: dict[str, list[bytes]] = {}
    metadata: dict[str, Any] | None = None
    attachments: dict[str, bytes] = {}
    for record in records:
        if isinstance(record, Message):
            if record.channel_id not in topics:
                raise ValueError(f"a message is on channel {record.channel_id}, which is not described")
            topic = topics[record.channel_id]
            if topic in SCHEMAS:
                times.setdefault(topic, []).append(record.log_time)
                payloads.setdefault(topic, []).append(record.data)
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            _check_schema(record, schemas)
            topics[record.id] = record.topic
        elif isinstance(record, Metadata) and record.name == METADATA_RECORD:
            metadata = {name: _from_json(name, text) for name, text in record.metadata.items()}
        elif isinstance(record, Attachment):
            attachments[record.name] = record.data
    if metadata is None:
        raise ValueError(f"metadata record {METADATA_RECORD!r} is missing")
    return Episode(**decode(times, payloads), metadata=metadata, attachments=attachments)


def _check_schema(channel: Channel, schemas: dict[int, Schema]) -> None:
    if channel.topic not in SCHEMAS:
        return
    wanted = SCHEMAS[channel.topic].DESCRIPTOR.full_name
    found = schemas[channel.schema_id].name if channel.schema_id in schemas else "none"
    if (channel.message_encoding, found) != ("protobuf", wanted):
        raise ValueError(
            f"topic {channel.topic} has {channel.message_encoding!r} messages of schema {found}: "
            f"must be 'protobuf' of {wanted}"
        )


def _from_json(name: str, text: str) -> Any:
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except ValueError as error:
        raise ValueError(f"metadata {name!r} is not JSON: {error}") from error


def _refuse_constant(constant: str) -> None:
    raise ValueError(f"{constant} is not a number")


def _one_line(error: Exception) -> str:
    """What went wrong in one line, with the kind of error where its own text says too little."""
    text = " ".join(str(error).split())
    if isinstance(error, ValueError) and text:
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
