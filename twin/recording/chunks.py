"""Contents of MCAP chunks: message records back to back, with an index of their offsets.

Of an episode, the records of all samples whose messages have the same layouts are the rows of one table.
"""

import dataclasses
import functools
import itertools
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from twin.recording.layout import SECOND, MessageLayout, Stream, find_layout, varint_sizes, varints

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]

CHUNK_SIZE = 2**18
"""Size from which on a chunk is full, before compression [bytes]."""

_BATCH = 2**13
"""Number of samples serialised at once: more are hardly faster and take more memory."""

_HEAD = np.dtype(
    [
        ("opcode", "<u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
"""Header of a message record, before the data."""

_HEAD_FIELDS = struct.Struct("<BQHIQQ")  # the same, of one message

_NOT_COUNTED = 9  # opcode and length of a record, which its length leaves out [bytes]


@dataclasses.dataclass(frozen=True)
class ChunkContent:
    """Message records of one chunk.

    Attributes:
        records: the message records, back to back.
        index: log time [ns] and offset [bytes] in `records` of each message, by channel, (messages, 2).
    """

    records: bytes
    index: dict[int, Integers]


class GrowingChunk:
    """Chunk that messages are added to one by one, in the order of their log times.

    Attributes:
        size: size of its records, before compression [bytes].
    """

    def __init__(self) -> None:
        """Begin without a message."""
        self.size = 0
        self._pieces: list[bytes] = []
        self._index: dict[int, list[tuple[int, int]]] = {}

    def add(self, channel: int, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message; times are in nanoseconds."""
        length = _HEAD.itemsize - _NOT_COUNTED + len(data)
        head = _HEAD_FIELDS.pack(Opcode.MESSAGE, length, channel, sequence, log_time, publish_time)
        self._index.setdefault(channel, []).append((log_time, self.size))
        self._pieces += [head, data]
        self.size += len(head) + len(data)

    def content(self) -> ChunkContent:
        """Return what is to be written."""
        index = {channel: np.array(rows) for channel, rows in self._index.items()}
        return ChunkContent(b"".join(self._pieces), index)


def message_chunks(messages: Iterable[tuple[int, int, int, bytes]]) -> Iterator[ChunkContent]:
    """Group messages into chunks.

    Args:
        messages: channel, sequence number, nanoseconds and data of each, in the order of time.
    """
    chunk = GrowingChunk()
    for channel, sequence, time, data in messages:
        chunk.add(channel, sequence, time, time, data)
        if chunk.size >= CHUNK_SIZE:
            yield chunk.content()
            chunk = GrowingChunk()
    if chunk.size:
        yield chunk.content()


def sample_chunks(
    streams: Sequence[Stream], channels: Sequence[int], nanoseconds: Integers
) -> Iterator[ChunkContent]:
    """Group the messages of streams into chunks of whole samples.

    Args:
        streams: the messages of each topic.
        channels: the channel of each.
        nanoseconds: (N,) time of each sample; its place is the sequence number of its messages.
    """
    layouts = functools.cache(lambda number, *sizes: find_layout(streams[number], *sizes))
    for first in range(0, len(nanoseconds), _BATCH):
        batch = np.arange(first, min(first + _BATCH, len(nanoseconds)))
        tables = [
            _table(streams, channels, nanoseconds, samples, layouts)
            for samples in _alike(streams, nanoseconds, batch)
        ]
        yield from _in_order(tables, nanoseconds[batch], first)


@dataclasses.dataclass(frozen=True)
class _Table:
    """Message records of n samples that have the same layout.

    Attributes:
        samples: indices of the samples, (n,).
        rows: records of each sample, (n, size) [bytes].
        places: offset of the message record of each channel in a row [bytes].
    """

    samples: Integers
    rows: Bytes
    places: dict[int, int]


def _alike(streams: Sequence[Stream], nanoseconds: Integers, batch: Integers) -> list[Integers]:
    """Split the samples of a batch into groups that have the same messages of the same layouts."""
    seconds, nanos = np.divmod(nanoseconds[batch], SECOND)
    kind = varint_sizes(seconds) << 3 | varint_sizes(nanos)
    for stream in streams:
        kind = kind << 1 | stream.present[batch]
    return [batch[kind == one] for one in np.unique(kind)]


def _table(
    streams: Sequence[Stream],
    channels: Sequence[int],
    nanoseconds: Integers,
    samples: Integers,
    layouts: Callable[..., MessageLayout],
) -> _Table:
    """The records of samples that are alike; `layouts` finds that of a stream, by its place."""
    times = nanoseconds[samples]
    parts = np.divmod(times, SECOND)
    sizes = [int(varint_sizes(part[:1])[0]) for part in parts]
    digits = [varints(part, size) for part, size in zip(parts, sizes, strict=True)]
    found = {
        number: layouts(number, *sizes) for number, stream in enumerate(streams) if stream.present[samples[0]]
    }
    width = sum(_HEAD.itemsize + layout.size for layout in found.values())
    rows = np.empty((len(samples), width), dtype=np.uint8)
    places, end = {}, 0
    for number, layout in found.items():
        begin, data, end = end, end + _HEAD.itemsize, end + _HEAD.itemsize + layout.size
        rows[:, begin:data] = _heads(channels[number], layout.size, samples, times)
        layout.fill(rows[:, data:end], streams[number].numbers[samples], *digits)
        places[channels[number]] = begin
    return _Table(samples, rows, places)


def _in_order(tables: Sequence[_Table], times: Integers, first: int) -> Iterator[ChunkContent]:
    """Yield the rows of tables in the order of their samples, starting at sample `first`."""
    sizes = np.empty(len(times), dtype=np.int64)
    for table in tables:
        sizes[table.samples - first] = table.rows.shape[1]
    ends = np.cumsum(sizes)
    begins = ends - sizes
    content = np.empty(ends[-1], dtype=np.uint8)
    places = {channel: np.full(len(times), -1) for table in tables for channel in table.places}
    for table in tables:
        samples = table.samples - first
        # Samples that follow each other do so in the table too: they are copied together.
        breaks = [0, *(np.flatnonzero(np.diff(samples) > 1) + 1).tolist(), len(samples)]
        for start, stop in itertools.pairwise(breaks):
            content[begins[samples[start]] : ends[samples[stop - 1]]] = table.rows[start:stop].ravel()
        for channel, place in table.places.items():
            places[channel][samples] = begins[samples] + place

    edges = [0, *(np.flatnonzero(np.diff(begins // CHUNK_SIZE)) + 1).tolist(), len(times)]
    for start, stop in itertools.pairwise(edges):
        index = {}
        for channel in sorted(places):
            there = start + np.flatnonzero(places[channel][start:stop] >= 0)
            if len(there) > 0:
                index[channel] = np.column_stack([times[there], places[channel][there] - begins[start]])
        yield ChunkContent(content[begins[start] : ends[stop - 1]].tobytes(), index)


def _heads(channel: int, data_size: int, sequence: Integers, times: Integers) -> Bytes:
    """Return the headers of messages of equal length, (n, bytes)."""
    heads = np.empty(len(times), dtype=_HEAD)
    heads["opcode"] = Opcode.MESSAGE
    heads["length"] = _HEAD.itemsize - _NOT_COUNTED + data_size
    heads["channel"] = channel
    heads["sequence"] = sequence
    heads["log_time"] = heads["publish_time"] = times
    return heads.view(np.uint8).reshape(len(times), _HEAD.itemsize)
