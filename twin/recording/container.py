"""Writer of MCAP files whose bytes depend on nothing but what is written into them.

The format is that of the MCAP specification (https://mcap.dev/spec): messages in zstd chunks with an index of
each, CRCs over each chunk, the data section and the summary, and an index of everything at the end.
"""

import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np
import zstandard
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap import records as mcap
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from twin.recording.chunks import ChunkContent

MAGIC = b"\x89MCAP0\r\n"  # magic bytes at the start and the end of every MCAP file
LEVEL = 1  # level of compression: on episodes, zstd's own choice, 3, is slower and makes larger files
_CRC = 4  # [bytes]


class Container:
    """MCAP file that is being written, front to back."""

    def __init__(self, file: Any, library: str) -> None:
        self._file = file
        self._offset = 0
        self._crc = 0
        self._compressor = zstandard.ZstdCompressor(level=LEVEL)
        self._schemas: dict[str, mcap.Schema] = {}
        self._channels: dict[str, mcap.Channel] = {}
        # As bytes, a seventh of the objects: a live recording gets a chunk every second, for days.
        self._chunk_indexes = RecordBuilder()
        self._chunk_count = 0
        self._times: tuple[int, int] | None = None  # first and last log time of all messages [ns]
        self._attachments: list[mcap.AttachmentIndex] = []
        self._metadata: list[mcap.MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._write(MAGIC)
        self._add(mcap.Header("", library))

    def add_metadata(self, name: str, metadata: dict[str, str]) -> None:
        """Add a metadata record."""
        offset, length = self._add(mcap.Metadata(name, metadata))
        self._metadata.append(mcap.MetadataIndex(offset, length, name))

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment, with times of 0."""
        offset, length = self._add(mcap.Attachment(0, 0, name, media_type, data))
        self._attachments.append(mcap.AttachmentIndex(offset, length, 0, 0, len(data), name, media_type))

    def add_channel(self, topic: str, descriptor: Any) -> int:
        """Return the channel of a topic; it and its schema stand before the chunks, which may be lost."""
        if topic not in self._channels:
            name = descriptor.full_name
            if name not in self._schemas:
                data = schema_data(descriptor)
                self._schemas[name] = mcap.Schema(len(self._schemas) + 1, data, "protobuf", name)
                self._add(self._schemas[name])
            channel = mcap.Channel(len(self._channels) + 1, topic, "protobuf", {}, self._schemas[name].id)
            self._add(channel)
            self._channels[topic] = channel
        return int(self._channels[topic].id)

    def add_chunk(self, content: ChunkContent) -> None:
        """Add messages as one chunk, followed by its message indexes."""
        data, size = self._compressor.compress(content.records), len(content.records)
        start = min(int(rows[0, 0]) for rows in content.index.values())
        end = max(int(rows[-1, 0]) for rows in content.index.values())
        offset, length = self._add(mcap.Chunk("zstd", data, end, start, zlib.crc32(content.records), size))
        index_start = self._offset
        offsets = {channel: self._add_message_index(channel, rows) for channel, rows in content.index.items()}
        mcap.ChunkIndex(
            chunk_length=length,
            chunk_start_offset=offset,
            compression="zstd",
            compressed_size=len(data),
            message_end_time=end,
            message_index_length=self._offset - index_start,
            message_index_offsets=offsets,
            message_start_time=start,
            uncompressed_size=size,
        ).write(self._chunk_indexes)
        self._chunk_count += 1
        first, last = self._times or (start, end)
        self._times = min(first, start), max(last, end)

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
        self._add(mcap.DataEnd(self._crc))
        start = self._offset
        first, last = self._times or (0, 0)
        statistics = mcap.Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self._chunk_count,
            message_count=sum(self._counts.values()),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        summary, offsets = RecordBuilder(), RecordBuilder()
        for opcode, records in (
            (Opcode.SCHEMA, _bytes_of(self._schemas.values())),
            (Opcode.CHANNEL, _bytes_of(self._channels.values())),
            (Opcode.STATISTICS, _bytes_of([statistics])),
            (Opcode.CHUNK_INDEX, self._chunk_indexes.end()),
            (Opcode.ATTACHMENT_INDEX, _bytes_of(self._attachments)),
            (Opcode.METADATA_INDEX, _bytes_of(self._metadata)),
        ):
            if records:
                mcap.SummaryOffset(opcode, start + summary.count, len(records)).write(offsets)
                summary.write(records)
        offset_start = start + summary.count
        section = summary.end() + offsets.end()
        # The CRC covers the footer too, up to itself: its last field.
        crc = zlib.crc32(section + _bytes_of([mcap.Footer(start, offset_start, 0)])[:-_CRC])
        self._write(section + _bytes_of([mcap.Footer(start, offset_start, crc)]) + MAGIC)

    def _add(self, record: mcap.McapRecord) -> tuple[int, int]:
        """Write a record of the data section; returns its offset and length [bytes]."""
        offset = self._offset
        self._write(_bytes_of([record]))
        return offset, self._offset - offset

    def _write(self, data: bytes) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._file.write(data)
        self._offset += len(data)


def _bytes_of(records: Iterable[mcap.McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()
    return data


def schema_data(descriptor: Any) -> bytes:
    """Return the schema of a Protobuf message as a serialised FileDescriptorSet, with all that it imports."""
    files, known = FileDescriptorSet(), set()

    def add(file: Any) -> None:
        if file.name not in known:
            known.add(file.name)
            for dependency in file.dependencies:
                add(dependency)
            file.CopyToProto(files.file.add())

    add(descriptor.file)
    return files.SerializeToString(deterministic=True)
