"""Vectorised serialisation of Protobuf messages of one form: a template, filled with arrays of numbers.

Messages that differ only in the values of doubles and of time stamps have the same bytes but at the places
of those numbers, if each number takes as many bytes in all of them: a double takes eight, the two parts of a
time stamp are varints of up to five (https://protobuf.dev/programming-guides/encoding). The places are not
computed but seen: where the output of the library changes when every number changes in every byte.
"""

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Indices = NDArray[np.intp]

SECOND = 10**9  # [ns]

_DOUBLE = 8  # [bytes]
_DIGIT = 7  # [bits] of a number that each byte of a varint holds
_MOST_FOUND = 1000


@dataclasses.dataclass(frozen=True)
class Stream:
    """Messages of one topic: at most one for each sample, all of one form.

    Attributes:
        topic: name of the topic.
        build: builds a message from a row of K numbers and the time of its sample [ns]. Which fields are set
            may depend on neither; each number of the row stands in exactly one double of the message,
            unchanged.
        numbers: numbers of each sample, (N, K); K is 0 where the message has none.
        present: mask of the samples that have a message, (N,).
    """

    topic: str
    build: Callable[[Sequence[float], int], Any]
    numbers: Array
    present: NDArray[np.bool_]


@dataclasses.dataclass(frozen=True)
class MessageLayout:
    """Offsets of the numbers in a serialised message.

    Attributes:
        template: one such message, (size,) [bytes].
        doubles: offset of each number of the row, (K,) [bytes].
        seconds: offsets of the seconds of each time stamp [bytes]; empty if they take no bytes.
        nanos: offsets of the nanoseconds within the second of each time stamp [bytes]; empty if they take no
            bytes.
    """

    template: Bytes
    doubles: Indices
    seconds: Indices
    nanos: Indices

    @property
    def size(self) -> int:
        """Size of a message [bytes]."""
        return len(self.template)

    def fill(self, out: Bytes, numbers: Array, seconds: Bytes, nanos: Bytes) -> None:
        """Serialise n messages into an array.

        Args:
            out: (n, size) is written to; its rows need not lie back to back.
            numbers: (n, K) the doubles of each message.
            seconds: (n, bytes) seconds of the time stamps, as varints.
            nanos: (n, bytes) nanoseconds within the second, as varints.
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


_found: dict[tuple[str, int, int, int, bytes], MessageLayout] = {}
"""Layouts of messages that were written before, by topic and template: a dataset has thousands of files."""


def find_layout(stream: Stream, seconds_size: int, nanos_size: int) -> MessageLayout:
    """Return the layout of those messages of a stream whose time stamps have parts of these lengths.

    Args:
        stream: its `build` is called with placeholders.
        seconds_size: bytes of the seconds as a varint.
        nanos_size: bytes of the nanoseconds within the second as a varint, at most 5.

    Raises:
        ValueError: a number of the row does not stand in exactly one double of the message.
    """
    count = stream.numbers.shape[1]
    # With all bits inverted, a double from 1 on is a negative number: no byte is the same, both are finite.
    row = np.arange(1.0, count + 1)
    inverted = (~row.view(np.uint64)).view(np.float64)
    seconds, nanos = _extremes(seconds_size), _extremes(nanos_size)

    def serialise(row: Array, seconds: int, nanos: int) -> Bytes:
        message = stream.build(row.tolist(), seconds * SECOND + nanos)
        return np.frombuffer(message.SerializeToString(deterministic=True), dtype=np.uint8)

    template = serialise(row, seconds[0], nanos[0])
    told = stream.topic, count, seconds_size, nanos_size, template.tobytes()
    if told in _found:
        return _found[told]
    changed = serialise(inverted, seconds[0], nanos[0])
    doubles = _changed(stream, template, changed, _DOUBLE)
    found, negative = (_numbers_at(doubles, message) for message in (template, changed))
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
    _found[told] = layout
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
    # The lowest digits come first; the top bit says that another byte follows.
    digits = values[:, None] >> (_DIGIT * np.arange(size)) & 0x7F
    digits[:, :-1] |= 0x80
    return digits.astype(np.uint8)


def _extremes(size: int) -> tuple[int, int]:
    """Return the smallest number whose varint has that size, and a large one that differs in every byte."""
    if size == 0:
        return 0, 0
    return 1 << _DIGIT * (size - 1), min((1 << _DIGIT * size) - 1, SECOND - 1)


def _numbers_at(places: Indices, message: Bytes) -> Array:
    """Return the doubles (K,) at these offsets."""
    doubles: Array = message[places[:, None] + np.arange(_DOUBLE)].view("<f8")[:, 0]
    return doubles


def _changed(stream: Stream, one: Bytes, other: Bytes, size: int) -> Indices:
    """Return the offsets of the numbers of `size` bytes that differ between two serialised messages."""
    if size == 0:
        return np.empty(0, dtype=np.intp)
    places = np.flatnonzero(one != other) if len(one) == len(other) else np.empty(1, dtype=np.intp)
    numbers = places[: len(places) // size * size].reshape(-1, size)
    if numbers.size != places.size or (np.diff(numbers, axis=1) != 1).any():
        raise InputError(f"{stream.topic}: its messages differ in more than their numbers")
    return numbers[:, 0]
