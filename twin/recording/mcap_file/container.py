"""Writer of MCAP files whose bytes depend on nothing but what is written into them.

The format is that of the MCAP specification (https://mcap.dev/spec): messages in zstd chunks and where they
are in them, CRCs over each chunk, the whole data section and the summary, and an index of all at the end.
"""

import zlib
from typing import Any, BinaryIO

import numpy as np
import zstandard
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from twin.recording.mcap_file.chunks import ChunkContent
from twin.recording.mcap_file.records import MAGIC

_CRC = 4  # [bytes]


class Container:
    """MCAP file that is being written, front to back."""

    def __init__(self, file: BinaryIO, library: str) -> None:
        """Write the start of the file.

        Args:
            file: open for writing, and empty.
            library: who writes; without a version, so that all versions write the same.
        """
        self._file = file
        self._offset = 0
        self._crc = 0
        self._compressor = zstandard.ZstdCompressor()
        self._schemas: dict[str, Schema] = {}
        self._channels: dict[str, Channel] = {}
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._write(MAGIC)
        self._add(Header("", library))

    def add_metadata(self, name: str, metadata: dict[str, str]) -> None:
        """Add a metadata record."""
        offset, length = self._add(Metadata(name, metadata))
        self._metadata.append(MetadataIndex(offset, length, name))

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment, with times of 0."""
        offset, length = self._add(Attachment(0, 0, name, media_type, data))
        self._attachments.append(AttachmentIndex(offset, length, 0, 0, len(data), name, media_type))

    def add_channel(self, topic: str, descriptor: Any) -> int:
        """Add the channel of a topic, before the chunks rather than inside one, as a chunk may be lost.

        Args:
            topic: its name; nothing is added for one that is there.
            descriptor: of the Protobuf messages on it.

        Returns:
            The channel that messages of the topic are on.
        """
        if topic not in self._channels:
            channel = Channel(len(self._channels) + 1, topic, "protobuf", {}, self._schema(descriptor))
            self._add(channel)
            self._channels[topic] = channel
        return int(self._channels[topic].id)

    def add_chunk(self, content: ChunkContent) -> None:
        """Add messages as one chunk, followed by its message indexes."""
        data = self._compressor.compress(content.records)
        times = [(int(rows[0, 0]), int(rows[-1, 0])) for rows in content.index.values()]
        start, end = min(first for first, _ in times), max(last for _, last in times)
        chunk = Chunk(
            compression="zstd",
            data=data,
            message_end_time=end,
            message_start_time=start,
            uncompressed_crc=zlib.crc32(content.records),
            uncompressed_size=len(content.records),
        )
        offset, length = self._add(chunk)
        index_start = self._offset
        index_offsets = {
            channel: self._add_message_index(channel, rows) for channel, rows in content.index.items()
        }
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=offset,
                compression=chunk.compression,
                compressed_size=len(data),
                message_end_time=end,
                message_index_length=self._offset - index_start,
                message_index_offsets=index_offsets,
                message_start_time=start,
                uncompressed_size=chunk.uncompressed_size,
            )
        )

    def _add_message_index(self, channel: int, rows: NDArray[np.int64]) -> int:
        """Add times and places (messages, 2) of the messages of a channel; returns where that begins."""
        builder, offset = RecordBuilder(), self._offset
        builder.start_record(Opcode.MESSAGE_INDEX)
        builder.write2(channel)
        builder.write4(8 * rows.size)
        builder.write(rows.astype("<u8").tobytes())
        builder.finish_record()
        self._write(builder.end())
        self._counts[channel] = self._counts.get(channel, 0) + len(rows)
        return offset

    def finish(self) -> None:
        """Complete the file: the end of the data, the summary and the footer."""
        self._add(DataEnd(self._crc))
        start = self._offset
        summary, offsets = RecordBuilder(), RecordBuilder()
        for opcode, records in (
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ):
            begin = summary.count
            for record in records:
                record.write(summary)
            if records:
                SummaryOffset(opcode, start + begin, summary.count - begin).write(offsets)
        offset_start = start + summary.count
        section = summary.end() + offsets.end()
        # The CRC covers the footer too, up to itself: its last field.
        unsigned = _bytes_of(Footer(start, offset_start, 0))[:-_CRC]
        crc = zlib.crc32(section + unsigned)
        self._write(section + _bytes_of(Footer(start, offset_start, crc)) + MAGIC)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

    def _schema(self, descriptor: Any) -> int:
        name = descriptor.full_name
        if name not in self._schemas:
            files = FileDescriptorSet()
            _add_file(files, descriptor.file, set())
            data = files.SerializeToString(deterministic=True)
            self._schemas[name] = Schema(len(self._schemas) + 1, data, "protobuf", name)
            self._add(self._schemas[name])
        return int(self._schemas[name].id)

    def _add(self, record: McapRecord) -> tuple[int, int]:
        """Write a record of the data section; returns its offset and length [bytes]."""
        offset = self._offset
        self._write(_bytes_of(record))
        return offset, self._offset - offset

    def _write(self, data: bytes) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._file.write(data)
        self._offset += len(data)


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data


def _add_file(files: FileDescriptorSet, file: Any, known: set[str]) -> None:
    """Add the descriptor of a .proto file after those of its imports: the schema is self-contained."""
    if file.name in known:
        return
    known.add(file.name)
    for dependency in file.dependencies:
        _add_file(files, dependency, known)
    file.CopyToProto(files.file.add())
