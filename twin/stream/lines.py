"""Lines of a byte stream, one at a time and each of bounded length, however long its sender makes them."""

from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

LONGEST_LINE = 65_536
"""Bytes of a line without its end; a sample has about a hundred."""


class NumberedLine(NamedTuple):
    """One line that is not empty.

    Attributes:
        number: its place in the stream, from 1 on; empty lines count.
        content: its bytes; None where it is longer than `LONGEST_LINE`.
    """

    number: int
    content: bytes | None


def numbered_lines(stream: BinaryIO) -> Iterator[NumberedLine]:
    """Yield the lines of a stream as they come; those of white space alone are passed over.

    A line that is too long is yielded, without its content, as soon as that is known; the rest of it is
    skipped piece by piece. The last line needs no end.

    Args:
        stream: buffered; no more of it is read than the next line needs, but for the buffer.
    """
    number = 0
    while content := stream.readline(LONGEST_LINE + 1):
        number += 1
        if len(content) > LONGEST_LINE and not content.endswith(b"\n"):
            yield NumberedLine(number, None)
            while content and not content.endswith(b"\n"):
                content = stream.readline(LONGEST_LINE + 1)
        elif not content.isspace():
            yield NumberedLine(number, content)
