"""Answers to the lines of a live stream, one for each, whatever the lines are."""

from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from twin.runtime.assured import AssuredEstimator
from twin.stream.lines import NumberedLine, numbered_lines
from twin.stream.protocol import error_line, read_sample, reading_line
from twin.stream.sample import StreamSample


class Answer(NamedTuple):
    """Answer to one line.

    Attributes:
        text: line to send, without its end.
        sample: the sample and its reading; None where the line was none.
    """

    text: str
    sample: StreamSample | None


def answer(runtime: AssuredEstimator, line: NumberedLine) -> Answer:
    """Take a line into a runtime and return the answer; one that is no sample leaves it as it is."""
    try:
        time_s, pull_mm, measurement_deg = read_sample(line.content)
    except ValueError as error:
        return Answer(error_line(error, line.number), None)
    reading = runtime.push(time_s, pull_mm, measurement_deg)
    sample = StreamSample(time_s, pull_mm, measurement_deg, reading)
    return Answer(reading_line(sample), sample)


def answers(runtime: AssuredEstimator, stream: BinaryIO) -> Iterator[Answer]:
    """Yield the answer to each line of a stream before the next one is read."""
    return (answer(runtime, line) for line in numbered_lines(stream))
