"""Lines of hostile streams: bounded, numbered, and answered for as soon as they are too long."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.stream.lines import LONGEST_LINE, NumberedLine, numbered_lines


def split(data: bytes) -> list[NumberedLine]:
    """The same by splitting all of it at once."""
    lines = data.split(b"\n")
    if not lines[-1]:
        lines.pop()
    numbered = [NumberedLine(number, line) for number, line in enumerate(lines, 1)]
    return [
        NumberedLine(number, None if len(content) > LONGEST_LINE else content)
        for number, content in numbered
        if len(content) > LONGEST_LINE or content.strip()
    ]


PIECES = st.sampled_from(
    [b"\n", b"\r\n", b" ", b"a", b"{}", b"\xff", b"\0", b"x" * 1000, b"y" * LONGEST_LINE, b" " * LONGEST_LINE]
)


@given(st.lists(PIECES, max_size=12))
def test_they_are_those_of_the_whole_stream(pieces):
    data = b"".join(pieces)
    found = [
        NumberedLine(number, content if content is None else content.removesuffix(b"\n"))
        for number, content in numbered_lines(io.BytesIO(data))
    ]
    assert found == split(data)


@pytest.mark.parametrize("beyond", [0, 1])
def test_the_longest_line_is_read_and_one_byte_more_is_not(beyond):
    data = b"x" * (LONGEST_LINE + beyond) + b"\nnext\n"
    first, second = numbered_lines(io.BytesIO(data))
    assert (first.content is None) == bool(beyond)
    assert second == NumberedLine(2, b"next\n")


class Endless(io.RawIOBase):
    """A sender that never ends its line."""

    def __init__(self):
        self.sent = 0

    def readable(self):
        return True

    def readinto(self, buffer):
        self.sent += len(buffer)
        buffer[:] = b"x" * len(buffer)
        return len(buffer)


def test_a_line_without_end_is_told_of_before_it_ends():
    sender = Endless()
    line = next(numbered_lines(io.BufferedReader(sender)))
    assert line == NumberedLine(1, None)
    assert sender.sent <= LONGEST_LINE + 2 * io.DEFAULT_BUFFER_SIZE


def test_of_a_line_of_many_megabytes_no_more_than_a_piece_is_held():
    sizes = []

    class Watched(io.BytesIO):
        def readline(self, size=-1):
            content = super().readline(size)
            sizes.append(len(content))
            return content

    lines = [*numbered_lines(Watched(b"z" * 20_000_000 + b"\nlast"))]
    assert lines == [NumberedLine(1, None), NumberedLine(2, b"last")]
    assert max(sizes) <= LONGEST_LINE + 1
