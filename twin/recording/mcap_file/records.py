"""Parser of MCAP records that checks each before use (https://mcap.dev/spec)."""

import os
import struct
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from twin.errors import InputError
from twin.files.bounded import open_regular

MAGIC = b"\x89MCAP0\r\n"
"""Magic bytes at the start and the end of every MCAP file."""

HEAD = struct.Struct("<BQ")
"""Header of every record: opcode and length of the body."""

_FOOTER_CRC = 4  # [bytes] last field of the footer

_PARSERS = {
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.CHUNK: Chunk.read,
    Opcode.CHUNK_INDEX: ChunkIndex.read,
    Opcode.DATA_END: DataEnd.read,
    Opcode.FOOTER: Footer.read,
    Opcode.METADATA: Metadata.read,
    Opcode.METADATA_INDEX: MetadataIndex.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.STATISTICS: Statistics.read,
}

# Records of an endoscope that stands still unpack to about 40 times their size in a file, moving ones to 3
# or 4 times. Writers index each message by 16 bytes that are not compressed, unless told not to.
_SMALLEST_LIMIT = 2**26  # [bytes]
_LARGEST_RATIO = 64
_SMALLEST_RECORD_LIMIT = 200_000
_FEWEST_BYTES_PER_RECORD = 8

_BLOCK = 2**20  # [bytes]

MOST_BYTES = 4 * 2**30
"""Size of a file that is read: it is taken into memory whole."""


class FileRecord(NamedTuple):
    """Location of a record in the bytes of its file.

    Attributes:
        opcode: kind of the record.
        start: offset of the opcode [bytes].
        body: offset of the body, after opcode and length [bytes].
        end: offset of the end of the body [bytes].
    """

    opcode: int
    start: int
    body: int
    end: int


class Budget:
    """Remaining size that a file may unpack to: a guard against decompression bombs."""

    def __init__(self, file_size: int) -> None:
        """Set the limits for a file of `file_size` bytes."""
        self.bytes = max(_SMALLEST_LIMIT, _LARGEST_RATIO * file_size)
        self.records = max(_SMALLEST_RECORD_LIMIT, file_size // _FEWEST_BYTES_PER_RECORD)

    def take(self, size: int) -> None:
        """Count the bytes of a chunk before it is unpacked.

        Raises:
            ValueError: the file unpacks to more than its size explains.
        """
        if size > self.bytes:
            raise InputError(
                f"a chunk claims {size} bytes: a file of this size may unpack to {self.bytes} more"
            )
        self.bytes -= size


def mcap_bytes(path: Path, *, cut: bool = False) -> bytes:
    """Read a file and check that it begins as an MCAP file does.

    Args:
        path: of the file.
        cut: take a large file into memory even if it is cut off, as a recording is whose process was killed;
            without the zeros behind it, which a file system leaves where the power failed.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is a folder, is empty, or does not begin as MCAP files do.
    """
    descriptor = open_regular(path, "an MCAP file")
    with open(descriptor, "rb") as file:
        size = os.fstat(descriptor).st_size
        # A large file is not taken into memory before its ends tell that it is one.
        ends = [file.read(len(MAGIC))]
        if size > MOST_BYTES:
            raise InputError(f"{path} has {size} bytes: an MCAP file of at most {MOST_BYTES} is read")
        if size > _SMALLEST_LIMIT and not cut:
            file.seek(size - len(MAGIC))
            ends.append(file.read(len(MAGIC)))
        data = ends[0]
        if all(end == MAGIC for end in ends):
            file.seek(0)
            data = _read_cut(file, size) if cut else file.read(size)
    if not data:
        raise InputError(f"{path} is cut off: it is empty")
    if data[: len(MAGIC)] != MAGIC[: len(data)]:
        raise InputError(f"{path} is not an MCAP file: it does not begin with the MCAP mark")
    if ends[-1] != MAGIC and not cut and size > _SMALLEST_LIMIT:
        raise InputError(f"{path} is cut off: it does not end with the MCAP mark")
    return data


def _read_cut(file: BinaryIO, size: int) -> bytes:
    """Return at most `size` bytes of a file, without blocks of zeros at its end."""
    zeros = bytes(_BLOCK)
    end = size
    while end > 0:
        start = (end - 1) // _BLOCK * _BLOCK
        file.seek(start)
        if file.read(end - start) != zeros[: end - start]:
            break
        end = start
    file.seek(0)
    return file.read(end)


def record_at(data: bytes, offset: int, end: int) -> FileRecord:
    """Return the record that begins at `offset`.

    Raises:
        ValueError: it would go on beyond `end`.
    """
    if end - offset < HEAD.size:
        raise InputError(f"the record at byte {offset} is cut off")
    opcode, length = HEAD.unpack_from(data, offset)
    body = offset + HEAD.size
    if length > end - body:
        raise InputError(f"the record at byte {offset} claims {length} bytes: {end - body} are left")
    return FileRecord(opcode, offset, body, body + length)


class _Fields(ReadDataStream):
    """Stream that raises where it has fewer bytes than asked for; `ReadDataStream` returns fewer."""

    def read(self, length: int) -> bytes:
        try:
            data: bytes = super().read(length)
        except EndOfFile:
            data = b""
        if len(data) < length:
            raise InputError(f"a field of {length} bytes ends after {len(data)}")
        return data


def parse(data: bytes, record: FileRecord) -> Any:
    """Parse the fields of a record into an object of `mcap.records`.

    Not of a header, a message or a message index, whose fields are not needed.

    Raises:
        ValueError: a field goes on beyond the end of the record, or is no text.
    """
    return _PARSERS[Opcode(record.opcode)](_Fields(BytesIO(data[record.body : record.end])))


def unpack(chunk: Chunk, budget: Budget) -> bytes:
    """Decompress a chunk; its CRC is checked where it has one.

    Raises:
        ValueError: the chunk is not of the size that it claims or is larger than the budget allows, its
            compression is not supported, or the CRC does not match.
        zstandard.ZstdError: it does not unpack.
    """
    size, packed = chunk.uncompressed_size, chunk.data
    if chunk.compression == "zstd":
        # Whatever the frame claims would be allocated before the first byte is unpacked.
        budget.take(max(size, zstandard.frame_content_size(packed)))
        raw = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    elif chunk.compression == "":
        budget.take(size)
        raw = packed
    else:
        raise InputError(f"a chunk is compressed by {chunk.compression!r}: only zstd is supported")
    if len(raw) != size:
        raise InputError(f"a chunk unpacks to {len(raw)} bytes, not to the {size} that it claims")
    if chunk.uncompressed_crc not in (0, zlib.crc32(raw)):
        raise InputError("the CRC of a chunk does not match")
    return raw


def summary_fault(data: bytes, footer: FileRecord) -> str | None:
    """Check the CRC of the summary section; returns the fault, or None."""
    fields = parse(data, footer)
    if fields.summary_start == 0 or fields.summary_crc == 0:
        return None
    summary = data[fields.summary_start : footer.end - _FOOTER_CRC]
    return None if zlib.crc32(summary) == fields.summary_crc else "the CRC of the summary does not match"
