"""Answers to the lines of a live stream, one for each, whatever the lines are."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

from twin.errors import InputError
from twin.runtime.assured import AssuredEstimator
from twin.stream.lines import NumberedLine, numbered_lines
from twin.stream.protocol import error_line, read_sample, reading_line
from twin.stream.sample import StreamSample

if TYPE_CHECKING:
    from twin.control.live import LiveCommands


class Answer(NamedTuple):
    """Answer to one line.

    Attributes:
        text: line to send, without its end.
        sample: the sample and its reading; None where the line was none.
    """

    text: str
    sample: StreamSample | None


def answer(runtime: AssuredEstimator, line: NumberedLine, commands: "LiveCommands | None" = None) -> Answer:
    """Take a line into a runtime and return the answer; one that is no sample leaves it as it is.

    Args:
        runtime: that takes it in.
        line: from the stream.
        commands: that are made beside it; None where nobody asks for any.
    """
    try:
        time_s, pull_mm, measurement_deg, reference_deg, coming_deg = read_sample(line.content)
        if commands is None and not math.isnan(reference_deg):
            raise InputError("reference_deg: no commands are made here, as no stroke is given")
        if coming_deg and math.isnan(reference_deg):
            raise InputError("coming_deg: needs reference_deg, the angle that is wanted before these")
    except ValueError as error:
        return Answer(error_line(error, line.number), None)
    if commands is not None and math.isnan(pull_mm):
        pull_mm = commands.command_mm
    reading = runtime.push(time_s, pull_mm, measurement_deg)
    sample = StreamSample(time_s, pull_mm, measurement_deg, reading, reference_deg)
    command_mm = None if commands is None else commands.after(pull_mm, reference_deg, coming_deg)
    return Answer(reading_line(sample, command_mm), sample)


def answers(
    runtime: AssuredEstimator, stream: BinaryIO, commands: "LiveCommands | None" = None
) -> Iterator[Answer]:
    """Yield the answer to each line of a stream before the next one is read."""
    return (answer(runtime, line, commands) for line in numbered_lines(stream))
