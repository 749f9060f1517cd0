"""Salvage of a damaged MCAP file: every record that can still be found and verified."""

import contextlib
import itertools
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from twin.errors import InputError
from twin.recording.contents import Contents, Found
from twin.recording.mcap_file.records import HEAD, MAGIC, FileRecord, parse, record_at, summary_fault
from twin.recording.reader import one_line

# Compression field of a zstd chunk, which follows opcode, length, two times, size and CRC.
_ZSTD_MARK = b"\x04\x00\x00\x00zstd"
_ZSTD_MARK_PLACE = HEAD.size + 3 * 8 + 4
_CHUNK_FIELDS = 4 * 8 + 2 * 4  # [bytes] of a chunk beside its compression and its data
_FOOTER_SIZE = HEAD.size + 2 * 8 + 4
_CRC_SIZE = 4

_MOST_FAULTS = 20

_INDEXED = {
    Opcode.CHUNK_INDEX: (Opcode.CHUNK, "chunk_start_offset"),
    Opcode.METADATA_INDEX: (Opcode.METADATA, "offset"),
    Opcode.ATTACHMENT_INDEX: (Opcode.ATTACHMENT, "offset"),
}

_PARSED = (*_INDEXED, *(kind for kind, _ in _INDEXED.values()), Opcode.SCHEMA, Opcode.CHANNEL, Opcode.FOOTER)


class Salvage:
    """Contents salvaged from a file: a scan of its records, then those that only the summary index finds."""

    def __init__(self, data: bytes) -> None:
        """Salvage the contents of a file.

        Args:
            data: a file that begins with the MCAP mark.
        """
        self.contents = Contents(len(data))
        self.statistics: Any = None
        """Statistics of the summary, if its CRC is right; else None."""
        self.data_whole = False
        """True if the CRC of the data section is right."""
        self._data = data
        self._faults: list[str] = []
        self._indexes: list[tuple[int, Opcode, Any]] = []
        # First and last log time of the chunk or message at each offset; () for other topics, None if lost.
        self._pieces: dict[int, tuple[int, ...] | None] = {}
        self._lost_spans: list[tuple[int, int]] = []  # first and last log time of lost chunks
        self._taken: set[tuple[int, int]] = set()  # place and opcode
        self._chunks_seen = 0
        self._all_seen = True  # as far as chunks go
        self._read_summary()
        self._scan()
        self._follow_indexes()

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults of the file, one line each, in the order of the file."""
        more = len(self._faults) - _MOST_FAULTS
        return (*self._faults[:_MOST_FAULTS], *([f"{more} more faults"] if more > 0 else []))

    @property
    def chunks(self) -> int:
        """Number of intact chunks."""
        return self.contents.counts["chunk"]

    @property
    def chunks_lost(self) -> int | None:
        """Number of lost chunks; None if unknown."""
        indexed = sum(kind == Opcode.CHUNK for _, kind, _ in self._indexes)
        if self.statistics is not None or indexed > 0:
            return max(0, (int(self.statistics.chunk_count) if self.statistics else indexed) - self.chunks)
        return self._chunks_seen - self.chunks if self._all_seen else None

    def doubtful(self, times: list[int]) -> NDArray[np.bool_]:
        """Return the mask of log times [ns] at which a message may have been lost.

        That is within the times of a lost chunk, and at the edges of what is next to something lost: a
        writer may begin a chunk in the middle of a sample.

        Args:
            times: (N,) in any order.

        Returns:
            (N,) True where something may be lost.
        """
        samples = np.array(times, dtype=np.uint64)
        edges = {(time, time) for time in self._edges()}
        spans = [span for span in {*self._lost_spans, *edges} if span[0] <= span[1]]
        if not spans:
            return np.zeros(len(samples), dtype=bool)
        first, last = np.array(spans, dtype=np.uint64).T
        # As many spans have begun by then as have ended before: none is open.
        begun = np.searchsorted(np.sort(first), samples, side="right")
        ended = np.searchsorted(np.sort(last), samples, side="left")
        return np.asarray(begun > ended)

    def _edges(self) -> Iterator[int]:
        """Yield the log times at which a chunk or message borders on something lost."""
        # Chunks without a topic of the episode do not count as neighbours.
        pieces = [self._pieces[place] for place in sorted(self._pieces) if self._pieces[place] != ()]
        for before, after in itertools.pairwise(pieces):
            if before is None and after is not None:
                yield after[0]
            if before is not None and after is None:
                yield before[-1]

    def _read_summary(self) -> None:
        """Read channels, statistics and indexes from the summary, if its CRC is right."""
        end = len(self._data) - len(MAGIC)
        start = end - _FOOTER_SIZE
        if start < len(MAGIC) or self._data[start] != Opcode.FOOTER or not self._data.endswith(MAGIC):
            return
        try:
            footer = record_at(self._data, start, end)
            fields = parse(self._data, footer)
            if 0 in (fields.summary_start, fields.summary_crc) or summary_fault(self._data, footer):
                return
            offset = fields.summary_start
            while offset < start:
                record = record_at(self._data, offset, start)
                if record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self.contents.add(self._data, record)
                elif record.opcode == Opcode.STATISTICS:
                    self.statistics = parse(self._data, record)
                elif record.opcode in _INDEXED:
                    kind, field = _INDEXED[Opcode(record.opcode)]
                    index = parse(self._data, record)
                    self._indexes.append((getattr(index, field), kind, index))
                offset = record.end
        except Exception as error:  # as in the reader: no closed list
            self._faults.append(f"the summary cannot be read: {one_line(error)}")

    def _scan(self) -> None:
        """Read record after record; after a damaged one, continue at the next chunk that can be found."""
        data, offset, data_ended = self._data, len(MAGIC), False
        while offset < len(data):
            try:
                record = record_at(data, offset, len(data))
                self._take(record)
            except Exception as error:
                following = _find_chunk(data, offset + 1)
                if following is None:
                    self._lose_rest(offset, one_line(error), data_ended)
                    return
                self._faults.append(f"bytes {offset} to {following} hold no whole record: {one_line(error)}")
                self._pieces[offset] = None
                is_chunk = data[offset] == Opcode.CHUNK
                self._chunks_seen += is_chunk
                self._all_seen &= is_chunk
                offset = following
                continue
            if record.opcode == Opcode.DATA_END:
                data_ended = True
                self.data_whole = (
                    zlib.crc32(memoryview(data)[:offset]) == parse(data, record).data_section_crc
                )
            offset = record.end
            if record.opcode == Opcode.FOOTER:
                if offset != len(data) - len(MAGIC):
                    self._faults.append("the file does not end after its footer")
                return
        self._lose_rest(offset, "the file ends", data_ended)

    def _lose_rest(self, offset: int, reason: str, data_ended: bool) -> None:
        """Note the fault of a file in which nothing more was found from `offset` on."""
        if data_ended:
            self._faults.append("the summary is cut off or damaged")
            return
        self._pieces[offset] = None
        self._all_seen = False
        if self._data.endswith(MAGIC):
            self._faults.append(f"no whole record follows after byte {offset}: {reason}")
        elif self._data[offset : offset + 1] == bytes([Opcode.CHUNK]):
            self._faults.append(f"cut off in chunk {self._chunks_seen + 1}")
        else:
            self._faults.append(f"cut off after chunk {self._chunks_seen}")

    def _take(self, record: FileRecord) -> None:
        """Add one record, or note why its contents are lost.

        Raises:
            Exception: the length of the record is not credible either.
        """
        if record.opcode == 0:
            raise InputError("no record has opcode 0")
        fields: Any = parse(self._data, record) if record.opcode in _PARSED else None
        length = record.end - record.body
        if record.opcode == Opcode.CHUNK:
            if length != _CHUNK_FIELDS + len(fields.compression) + len(fields.data):
                raise InputError("a chunk is not as long as its fields")
            self._chunks_seen += 1
        if record.opcode == Opcode.MESSAGE_INDEX:
            size = int.from_bytes(self._data[record.body + 2 : record.body + 6], "little")
            if length != 2 + 4 + size:
                raise InputError("a message index is not as long as its fields")
        self._taken.add((record.start, record.opcode))

        try:
            if record.opcode == Opcode.ATTACHMENT:
                _check_attachment(self._data, record)
            found = self.contents.add(self._data, record)
        except Exception as error:
            self._faults.append(f"{_name(record.opcode)} at byte {record.start}: {one_line(error)}")
            if record.opcode == Opcode.CHUNK:
                self._pieces[record.start] = None
                self._lost_spans.append((fields.message_start_time, fields.message_end_time))
        else:
            if record.opcode in (Opcode.CHUNK, Opcode.MESSAGE):
                self._pieces[record.start] = _span(found)

    def _follow_indexes(self) -> None:
        """Add the records that the summary lists and the scan has missed, even where a length is damaged."""
        for offset, kind, index in sorted(self._indexes, key=lambda entry: entry[0]):
            if (offset, int(kind)) not in self._taken:
                length = index.chunk_length if kind == Opcode.CHUNK else index.length
                try:
                    if offset + length > len(self._data):
                        raise InputError(f"{offset + length - len(self._data)} bytes of it are missing")
                    if offset not in self._pieces:
                        self._faults.append(
                            f"{_name(kind)} at byte {offset}: it was taken for another record"
                        )
                    self._take(FileRecord(kind, offset, offset + HEAD.size, offset + length))
                except Exception as error:
                    if offset not in self._pieces:
                        self._faults.append(f"{_name(kind)} at byte {offset}: {one_line(error)}")
                    self._pieces[offset] = None
            if kind == Opcode.CHUNK and self._pieces.get(offset) is None:
                self._lost_spans.append((index.message_start_time, index.message_end_time))


def _find_chunk(data: bytes, offset: int) -> int | None:
    """Return the offset of the next zstd chunk that fits into the file; None if there is none."""
    mark = data.find(_ZSTD_MARK, offset + _ZSTD_MARK_PLACE)
    while mark >= 0:
        start = mark - _ZSTD_MARK_PLACE
        with contextlib.suppress(ValueError):
            record = record_at(data, start, len(data))
            # Its two lengths must agree before anything is copied: false marks may be many.
            place = mark + len(_ZSTD_MARK)
            size = int.from_bytes(data[place : place + 8], "little")
            agree = record.end - record.body == _CHUNK_FIELDS + len("zstd") + size
            if record.opcode == Opcode.CHUNK and agree:
                return start
        mark = data.find(_ZSTD_MARK, mark + 1)
    return None


def _check_attachment(data: bytes, record: FileRecord) -> None:
    """Check the CRC at the end of an attachment, where it has one."""
    expected = int.from_bytes(data[record.end - _CRC_SIZE : record.end], "little")
    if expected not in (0, zlib.crc32(memoryview(data)[record.body : record.end - _CRC_SIZE])):
        raise InputError("its CRC does not match")


def _name(opcode: int) -> str:
    return Opcode(opcode).name.lower().replace("_", " ")


def _span(found: Found) -> tuple[int, ...]:
    """Return the first and last log time of messages; an empty tuple if there are none."""
    times = [time for times, _ in found.values() for time in times]
    return (min(times), max(times)) if times else ()
