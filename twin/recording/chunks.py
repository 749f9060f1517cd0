"""Contents of MCAP chunks: message records back to back, with an index of their offsets.

The records of samples whose messages have the same layouts are rows of one table: a template, filled with
arrays of numbers. Protobuf messages that differ only in doubles (8 bytes each) and time stamps (varints) have
the same bytes but at the places of those numbers (https://protobuf.dev/programming-guides/encoding): those
that change in the output of the library when every number changes in every byte.
"""

import dataclasses
import functools
import itertools
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from twin.errors import InputError

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Indices = NDArray[np.intp]
Integers = NDArray[np.int64]
# records of n samples of the same layout: indices (n,), rows (n, size), offset of each channel [bytes]
Table = tuple[Integers, Bytes, dict[int, int]]
SECOND = 10**9  # [ns]
CHUNK_SIZE = 2**18  # size from which on a chunk is full, before compression [bytes]
_BATCH = 2**13  # samples serialised at once: more are hardly faster and take more memory
_DOUBLE = 8  # [bytes]
_DIGIT = 7  # [bits] of a number that each byte of a varint holds
_MOST_FOUND = 1000
_HEAD_FIELDS = struct.Struct("<BQHIQQ")  # header of a message record, before the data
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
_NOT_COUNTED = 9  # opcode and length of a record, which its length leaves out [bytes]


@dataclasses.dataclass(frozen=True)
class ChunkContent:
    """Message records of one chunk."""

    records: bytes  # back to back
    index: dict[int, Integers]  # by channel, log time [ns] and offset [bytes] of each message, (messages, 2)


class GrowingChunk:
    """Chunk that messages are added to one by one, in the order of their log times."""

    def __init__(self) -> None:
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
    """Group messages, (channel, sequence number, nanoseconds, data) in the order of time, into chunks."""
    chunk = GrowingChunk()
    for channel, sequence, time, data in messages:
        chunk.add(channel, sequence, time, time, data)
        if chunk.size >= CHUNK_SIZE:
            yield chunk.content()
            chunk = GrowingChunk()
    if chunk.size:
        yield chunk.content()


@dataclasses.dataclass(frozen=True)
class Stream:
    """Messages of one topic: at most one for each sample, all of one form.

    `build` makes a message of a row of K numbers and the time of its sample [ns]. Which fields are set does
    not depend on them; each number of the row is in exactly one double of the message, unchanged.
    """

    topic: str
    build: Callable[[Sequence[float], int], Any]
    numbers: Array  # of each sample, (N, K); K is 0 where the message has none
    present: NDArray[np.bool_]  # samples that have a message, (N,)


def sample_chunks(
    streams: Sequence[Stream], channels: Sequence[int], nanoseconds: Integers
) -> Iterator[ChunkContent]:
    """Group the messages of streams into chunks of whole samples."""
    layouts = functools.cache(lambda number, *sizes: find_layout(streams[number], *sizes))
    for first in range(0, len(nanoseconds), _BATCH):
        batch = np.arange(first, min(first + _BATCH, len(nanoseconds)))
        tables = [
            _table(streams, channels, nanoseconds, samples, layouts)
            for samples in _alike(streams, nanoseconds, batch)
        ]
        yield from _in_order(tables, nanoseconds[batch], first)


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
    layouts: "Callable[..., MessageLayout]",
) -> Table:
    """The records of samples that are alike; `layouts` finds that of a stream, by its place."""
    times = nanoseconds[samples]
    parts = np.divmod(times, SECOND)
    sizes = [int(varint_sizes(part[:1])[0]) for part in parts]
    digits = [varints(part, size) for part, size in zip(parts, sizes, strict=True)]
    found = {
        number: layouts(number, *sizes) for number, stream in enumerate(streams) if stream.present[samples[0]]
    }
    width = sum(_HEAD.itemsize + len(layout.template) for layout in found.values())
    rows = np.empty((len(samples), width), dtype=np.uint8)
    places, end = {}, 0
    for number, layout in found.items():
        size = len(layout.template)
        begin, data, end = end, end + _HEAD.itemsize, end + _HEAD.itemsize + size
        heads = np.empty(len(times), dtype=_HEAD)
        heads["opcode"], heads["length"] = Opcode.MESSAGE, _HEAD.itemsize - _NOT_COUNTED + size
        heads["channel"], heads["sequence"] = channels[number], samples
        heads["log_time"] = heads["publish_time"] = times
        rows[:, begin:data] = heads.view(np.uint8).reshape(len(times), _HEAD.itemsize)
        layout.fill(rows[:, data:end], streams[number].numbers[samples], *digits)
        places[channels[number]] = begin
    return samples, rows, places


def _in_order(tables: Sequence[Table], times: Integers, first: int) -> Iterator[ChunkContent]:
    """Yield the rows of tables in the order of their samples, starting at sample `first`."""
    sizes = np.empty(len(times), dtype=np.int64)
    for samples, rows, _ in tables:
        sizes[samples - first] = rows.shape[1]
    ends = np.cumsum(sizes)
    begins = ends - sizes
    content = np.empty(ends[-1], dtype=np.uint8)
    places = {channel: np.full(len(times), -1) for *_, of in tables for channel in of}
    for indices, rows, offsets in tables:
        samples = indices - first
        # Samples that follow each other do so in the table too: they are copied together.
        breaks = [0, *(np.flatnonzero(np.diff(samples) > 1) + 1).tolist(), len(samples)]
        for start, stop in itertools.pairwise(breaks):
            content[begins[samples[start]] : ends[samples[stop - 1]]] = rows[start:stop].ravel()
        for channel, place in offsets.items():
            places[channel][samples] = begins[samples] + place

    edges = [0, *(np.flatnonzero(np.diff(begins // CHUNK_SIZE)) + 1).tolist(), len(times)]
    for start, stop in itertools.pairwise(edges):
        index = {}
        for channel in sorted(places):
            there = start + np.flatnonzero(places[channel][start:stop] >= 0)
            if len(there) > 0:
                index[channel] = np.column_stack([times[there], places[channel][there] - begins[start]])
        yield ChunkContent(content[begins[start] : ends[stop - 1]].tobytes(), index)


@dataclasses.dataclass(frozen=True)
class MessageLayout:
    """Offsets of the numbers in a serialised message."""

    template: Bytes  # one such message, (size,) [bytes]
    doubles: Indices  # offset of each number of the row, (K,) [bytes]
    seconds: Indices  # offsets of the seconds of each time stamp [bytes]; empty if they take no bytes
    nanos: Indices  # the same for the nanoseconds within the second

    def fill(self, out: Bytes, numbers: Array, seconds: Bytes, nanos: Bytes) -> None:
        """Serialise n messages into `out` (n, size) [bytes].

        Their doubles are `numbers` (n, K); the parts of their time stamps (n, bytes) are varints.
        """
        out[:] = self.template
        # Doubles that stand back to back, as those of a packed field do, go in as one block.
        breaks = np.flatnonzero(np.diff(self.doubles) != _DOUBLE) + 1
        edges = [0, *breaks.tolist(), len(self.doubles)]
        for first, end in itertools.pairwise(edges if len(self.doubles) > 0 else []):
            begin = self.doubles[first]
            out[:, begin : begin + _DOUBLE * (end - first)].view("<f8")[:] = numbers[:, first:end]
        for begins, digits in ((self.seconds, seconds), (self.nanos, nanos)):
            for begin in begins:
                out[:, begin : begin + digits.shape[1]] = digits


# Layouts found so far, by topic and template: a dataset has thousands of files.
_found: dict[tuple[str, int, int, int, bytes], MessageLayout] = {}


def find_layout(stream: Stream, seconds_size: int, nanos_size: int) -> MessageLayout:
    """Return the layout of the messages of a stream whose time stamps have parts of these sizes [bytes]."""
    count = stream.numbers.shape[1]
    # With all bits inverted, a double from 1 on is a negative number: no byte is the same, both are finite.
    row = np.arange(1.0, count + 1)
    inverted = (~row.view(np.uint64)).view(np.float64)
    seconds, nanos = _extremes(seconds_size), _extremes(nanos_size)

    def serialise(row: Array, seconds: int, nanos: int) -> Bytes:
        message = stream.build(row.tolist(), seconds * SECOND + nanos)
        return np.frombuffer(message.SerializeToString(deterministic=True), dtype=np.uint8)

    template = serialise(row, seconds[0], nanos[0])
    key = stream.topic, count, seconds_size, nanos_size, template.tobytes()
    if key in _found:
        return _found[key]
    changed = serialise(inverted, seconds[0], nanos[0])
    doubles = _changed(stream, template, changed, _DOUBLE)
    bytes_at = doubles[:, None] + np.arange(_DOUBLE)
    found, negative = (message[bytes_at].view("<f8")[:, 0] for message in (template, changed))
    order = np.argsort(found)
    if found[order].tolist() != row.tolist() or negative[order].tolist() != inverted.tolist():
        raise InputError(f"{stream.topic}: {count} numbers do not stand in a double of the message each")
    layout = MessageLayout(
        template=template,
        doubles=doubles[order],
        seconds=_changed(stream, template, serialise(row, seconds[1], nanos[0]), seconds_size),
        nanos=_changed(stream, template, serialise(row, seconds[0], nanos[1]), nanos_size),
    )
    if len(_found) >= _MOST_FOUND:
        _found.clear()
    _found[key] = layout
    return layout


def varint_sizes(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the size of each number as a varint [bytes]; 0 for zero, as Protobuf leaves that field out."""
    sizes = np.zeros(values.shape, dtype=np.int64)
    rest = values
    while rest.any():
        sizes += rest > 0
        rest = rest >> _DIGIT
    return sizes


def varints(values: NDArray[np.int64], size: int) -> Bytes:
    """Encode numbers as varints of `size` bytes each, (n, size)."""
    # The lowest digits come first; the top bit marks that another byte follows.
    digits = values[:, None] >> (_DIGIT * np.arange(size)) & 0x7F
    digits[:, :-1] |= 0x80
    return digits.astype(np.uint8)


def _extremes(size: int) -> tuple[int, int]:
    """Return the smallest number whose varint has that size, and a large one that differs in every byte."""
    if size == 0:
        return 0, 0
    return 1 << _DIGIT * (size - 1), min((1 << _DIGIT * size) - 1, SECOND - 1)


def _changed(stream: Stream, one: Bytes, other: Bytes, size: int) -> Indices:
    """Return the offsets of the numbers of `size` bytes that differ between two serialised messages."""
    if size == 0:
        return np.empty(0, dtype=np.intp)
    places = np.flatnonzero(one != other) if len(one) == len(other) else np.empty(1, dtype=np.intp)
    numbers = places[: len(places) // size * size].reshape(-1, size)
    if numbers.size != places.size or (np.diff(numbers, axis=1) != 1).any():
        raise InputError(f"{stream.topic}: its messages differ in more than their numbers")
    return numbers[:, 0]
