"""Files with faults of every kind, made by chance from whole ones: the same seed gives the same file."""

import dataclasses
import io
import struct
import tempfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Channel
from mcap.writer import CompressionType, Writer
from recorded import make_episode

from twin.episode import Episode
from twin.recording import write_episode

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, STATISTICS, DATA_END = 2, 3, 4, 5, 6, 11, 15
CHUNK_CRC = 9 + 8 + 8 + 8  # where it stands in the record of a chunk

Generator = np.random.Generator


def rewritten(
    episode: Episode, edit: Callable | None = None, metadata: dict[str, str] | None = None, **options
) -> bytes:
    """A file of the same messages, metadata and attachments, these before the messages, by the mcap library.

    `edit(topic, time)` says which messages stay, `metadata` what is stated instead; the options are those of
    `mcap.writer.Writer`.
    """
    with tempfile.TemporaryDirectory() as folder:
        reader = make_reader(io.BytesIO(write_episode(Path(folder) / "a.mcap", episode).read_bytes()))
    file = io.BytesIO()
    writer = Writer(file, **{"enable_data_crcs": True} | options)
    writer.start(library="test")
    for record in reader.iter_metadata():
        writer.add_metadata(record.name, record.metadata | (metadata or {}))
    for record in reader.iter_attachments():
        writer.add_attachment(0, 0, record.name, record.media_type, record.data)
    channels: dict[str, int] = {}
    for kind, channel, message in reader.iter_messages():
        if edit is not None and not edit(channel.topic, message.log_time):
            continue
        if channel.topic not in channels:
            schema = writer.register_schema(kind.name, kind.encoding, kind.data)
            channels[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema)
        writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
    writer.finish()
    return file.getvalue()


@dataclasses.dataclass(frozen=True)
class Base:
    """A whole file, the episode in it, and whether each chunk has a CRC."""

    data: bytes
    episode: Episode
    checked: bool


@cache
def bases() -> tuple[Base, ...]:
    """Whole files: as EndoTwin writes them, and as others may, with small chunks or none, without CRCs."""
    short, planes = make_episode(60), make_episode(40, planes=2, drive=True)
    gaps = np.where(np.arange(60) % 7 == 3, np.nan, short.measured_bend)
    holes = dataclasses.replace(short, measured_bend=gaps)
    plain = CompressionType.NONE
    with tempfile.TemporaryDirectory() as folder:
        own = write_episode(Path(folder) / "a.mcap", short).read_bytes()
    return (
        Base(own, short, True),
        Base(rewritten(planes, chunk_size=6000), planes, True),
        Base(rewritten(holes, chunk_size=4000), holes, True),
        Base(rewritten(short, chunk_size=3000, compression=plain), short, True),
        Base(rewritten(short, chunk_size=3000, use_statistics=False, enable_data_crcs=False), short, True),
        Base(rewritten(short, chunk_size=5000, compression=plain, enable_crcs=False), short, False),
        Base(rewritten(short, use_chunking=False), short, False),
    )


def mutated(seed: int) -> tuple[bytes, Base, bool]:
    """A damaged file, what it was, and whether its CRCs still tell of every change to a message."""
    rng = np.random.default_rng(seed)
    base = bases()[rng.integers(len(bases()))]
    data, honest = base.data, base.checked
    for _ in range(rng.choice([1, 1, 1, 2, 5])):
        if rng.random() < 0.35:
            data, honest = inside_chunk(rng, data), False
        else:
            mutation = MUTATIONS[rng.integers(len(MUTATIONS))]
            data = mutation(rng, data)
        if len(data) < 2 * len(MAGIC):
            break
    if rng.random() < 0.5:
        data, honest = without_crcs(data), False
    elif rng.random() < 0.3:
        data = with_crcs(data)
    return data, base, honest


def records(data: bytes) -> list[bytes]:
    """The records of a file, as far as their lengths make sense; the last one may be the rest of it."""
    found, offset = [], len(MAGIC)
    while offset < len(data):
        length = int.from_bytes(data[offset + 1 : offset + 9], "little")
        end = offset + 9 + length if offset + 9 + length <= len(data) else len(data)
        found.append(data[offset:end])
        offset = end
    return found


def with_crcs(data: bytes) -> bytes:
    """The CRCs of data section and summary made right again, as a tool leaves them that copies blindly."""
    parts, at = records(data), len(MAGIC)
    for index, part in enumerate(parts):
        if part[0] == DATA_END and len(part) == 13:
            parts[index] = part[:9] + struct.pack("<I", zlib.crc32(data[:at]))
        if part[0] == FOOTER and len(part) == 29:
            start = int.from_bytes(part[9:17], "little")
            summary = b"".join([MAGIC, *parts[:index], part[:25]])[start:]
            parts[index] = part[:25] + struct.pack("<I", zlib.crc32(summary))
        at += len(part)
    return MAGIC + b"".join(parts)


def without_crcs(data: bytes) -> bytes:
    """Every CRC set to 0, which means that there is none."""
    parts = records(data)
    for index, part in enumerate(parts):
        place = {CHUNK: CHUNK_CRC, DATA_END: 9, FOOTER: 25}.get(part[0])
        if place is not None and len(part) >= place + 4:
            parts[index] = part[:place] + bytes(4) + part[place + 4 :]
    return MAGIC + b"".join(parts)


def inside_chunk(rng: Generator, data: bytes) -> bytes:
    """Damage the contents of a chunk before they were packed, with the right sizes and the right CRC."""
    parts = records(data)
    places = [index for index, part in enumerate(parts) if part[0] == CHUNK and len(part) > 60]
    if not places:
        return flip(rng, data)
    place = places[rng.integers(len(places))]
    try:
        head, packed, kind = split_chunk(parts[place])
        raw = zstandard.decompress(packed, max_output_size=2**20) if kind else packed
    except (zstandard.ZstdError, struct.error):
        return flip(rng, data)
    for _ in range(rng.integers(1, 4)):
        raw = MUTATIONS[rng.integers(len(MUTATIONS))](rng, MAGIC + raw)[len(MAGIC) :]
    parts[place] = chunk(raw, kind, head)
    return MAGIC + b"".join(parts)


def split_chunk(part: bytes) -> tuple[bytes, bytes, bytes]:
    """The times, the data and the compression of the record of a chunk."""
    (size,) = struct.unpack_from("<I", part, CHUNK_CRC + 4)
    kind = part[CHUNK_CRC + 8 : CHUNK_CRC + 8 + size]
    return part[9 : 9 + 16], part[CHUNK_CRC + 8 + size + 8 :], kind


def chunk(raw: bytes, kind: bytes = b"zstd", times: bytes = bytes(16), claimed: int | None = None) -> bytes:
    """The record of a chunk."""
    packed = zstandard.compress(raw) if kind == b"zstd" else raw
    size = len(raw) if claimed is None else claimed
    head = times + struct.pack("<QII", size, zlib.crc32(raw), len(kind)) + kind
    return record(CHUNK, head + struct.pack("<Q", len(packed)) + packed)


def record(opcode: int, body: bytes) -> bytes:
    """Any record."""
    return struct.pack("<BQ", opcode, len(body)) + body


def described(channel: int, topic: str) -> bytes:
    """The record of a channel without a schema."""
    builder = RecordBuilder()
    Channel(channel, topic, "protobuf", {}, 0).write(builder)
    return builder.end()


def message(channel: int, time: int, data: bytes) -> bytes:
    """The record of a message, which is all zeros but for these."""
    return record(MESSAGE, struct.pack("<HIQQ", channel, 0, time, time) + data)


def flip(rng: Generator, data: bytes) -> bytes:
    """Turn single bits over."""
    changed = bytearray(data)
    for place in rng.integers(8 * len(data), size=rng.choice([1, 1, 2, 30])):
        changed[place // 8] ^= 1 << place % 8
    return bytes(changed)


def overwrite(rng: Generator, data: bytes) -> bytes:
    """Write a run of bytes over others: zeros as after a power cut, ones, or anything."""
    place, size = rng.integers(len(data)), int(rng.choice([1, 4, 8, 512, 4096]))
    run = [bytes(size), b"\xff" * size, rng.bytes(size)][rng.integers(3)]
    return (data[:place] + run + data[place + size :])[: len(data)]


def cut(rng: Generator, data: bytes) -> bytes:
    """Keep the beginning."""
    return data[: rng.integers(len(data))]


def leave_out(rng: Generator, data: bytes) -> bytes:
    """Leave a run of bytes out."""
    place = rng.integers(len(data))
    return data[:place] + data[place + int(rng.choice([1, 9, 512, 4096])) :]


def insert(rng: Generator, data: bytes) -> bytes:
    """Put bytes between others, new ones or some from elsewhere in the file."""
    place, other, size = rng.integers(len(data)), rng.integers(len(data)), int(rng.choice([1, 9, 512, 4096]))
    run = rng.bytes(size) if rng.random() < 0.5 else data[other : other + size]
    return data[:place] + run + data[place:]


def move_records(rng: Generator, data: bytes) -> bytes:
    """Swap two records, write one twice, or leave one out; mostly chunks, where there are some."""
    parts = records(data)
    chunks = [index for index, part in enumerate(parts) if part[:1] == bytes([CHUNK])]
    places = chunks if chunks and rng.random() < 0.7 else list(range(len(parts)))
    if not places:
        return data
    first, second = rng.choice(places, size=2)
    match rng.integers(3):
        case 0:
            parts[first], parts[second] = parts[second], parts[first]
        case 1:
            parts.insert(second, parts[first])
        case _:
            del parts[first]
    return MAGIC + b"".join(parts)


def set_number(rng: Generator, data: bytes) -> bytes:
    """Set the length of a record, or a number in it, to something that is large, small or slightly wrong."""
    parts = records(data)
    if not parts:
        return data
    index = rng.integers(len(parts))
    part = parts[index]
    form, size = [("<Q", 8), ("<I", 4), ("<H", 2)][rng.integers(3)]
    place = 1 if rng.random() < 0.4 else int(rng.integers(1, max(2, min(len(part), 80) - size)))
    if place + size > len(part):
        return data
    (old,) = struct.unpack_from(form, part, place)
    new = [0, 1, 2**31, 2**60, 2**64 - 1, old + 1, old - 1, 2 * old, int(rng.integers(2**40))]
    changed = struct.pack(form, new[rng.integers(len(new))] % 2 ** (8 * size))
    parts[index] = part[:place] + changed + part[place + size :]
    return MAGIC + b"".join(parts)


MUTATIONS = (flip, overwrite, cut, leave_out, insert, move_records, set_number)
