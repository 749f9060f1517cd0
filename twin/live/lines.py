"""Lines of a live stream, each one JSON object: samples in, readings and errors out, one answer for each.

`assets/run_protocol.schema.json` is the schema for programs in other languages (`make schema` writes it), and
`docs/deployment.md` describes the lines.
"""

import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, NamedTuple

from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import models_json_schema

from twin.errors import InputError
from twin.files.json_text import parse_json_object, validated
from twin.live.assured import AssuredEstimator
from twin.live.reading import Alarm, Health, Source, StreamSample, flag_names

if TYPE_CHECKING:
    from twin.control.compensator import LiveCommands

LONGEST_LINE = 65_536  # bytes of a line without its end; a sample has about a hundred
MOST_COMING = 256  # wanted angles ahead that a sample may contain
LONGEST_ERROR = 300  # characters of the text of an error

_ENCODER = json.JSONEncoder(separators=(",", ":"), allow_nan=False)

Number = Annotated[float, Field(allow_inf_nan=False)]
SampleFault = Annotated[str, Field(json_schema_extra={"enum": [flag.name for flag in Health]})]
AlarmName = Annotated[str, Field(json_schema_extra={"enum": [flag.name for flag in Alarm]})]
SourceName = Annotated[str, Field(json_schema_extra={"enum": [source.value for source in Source]})]


class SampleLine(BaseModel):
    """Line in: one sample."""

    model_config = ConfigDict(extra="forbid", strict=True)

    time_s: Annotated[Number, Field(description="time stamp, later than the one before [s]")]
    pull_mm: Annotated[
        Number | None,
        Field(description="commanded pulling distance; if missing, it goes on at its speed [mm]"),
    ] = None
    measurement_deg: Annotated[
        Number | None, Field(description="measured bending angle; without it, it is missing [deg]")
    ] = None
    reference_deg: Annotated[
        Number | None,
        Field(description="bending angle that is wanted at the next sample; without it, the last one [deg]"),
    ] = None
    reference_preview_deg: Annotated[
        list[Number] | None,
        Field(max_length=MOST_COMING, description="angles that are wanted at the samples after that [deg]"),
    ] = None


class HealthPart(BaseModel):
    """Faults of a sample, and reasons not to trust the trained estimator."""

    model_config = ConfigDict(extra="forbid")

    sample: Annotated[list[SampleFault], Field(description="faults of this sample; none, if it is good")]
    alarms: Annotated[list[AlarmName], Field(description="reasons not to trust the trained estimator")]


class ReadingLine(BaseModel):
    """Line out: the answer to a sample."""

    model_config = ConfigDict(extra="forbid")

    time_s: Annotated[float, Field(description="time stamp of the sample, as it came [s]")]
    bend_deg: Annotated[float, Field(description="estimate of the bending angle [deg]")]
    interval_deg: Annotated[
        tuple[float, float] | None, Field(description="95 % interval, low and high; null if unknown [deg]")
    ]
    source: Annotated[SourceName, Field(description="source of the estimate")]
    health: HealthPart
    command_mm: Annotated[
        float | None,
        Field(description="pull to command next, where a stroke is given; null before a reference [mm]"),
    ] = None


class ErrorLine(BaseModel):
    """Line out: the answer to a line that is not a sample. The estimator has not seen it."""

    model_config = ConfigDict(extra="forbid")

    error: Annotated[str, Field(max_length=LONGEST_ERROR, description="the fault, in one line")]
    line: Annotated[int, Field(ge=1, description="number of the line in the stream, empty lines counted")]


class Answer(NamedTuple):
    """Answer to one line."""

    text: str  # line to send, without its end
    sample: StreamSample | None  # the sample and its reading; None where the line was not a sample


def numbered_lines(stream: BinaryIO) -> Iterator[tuple[int, bytes | None]]:
    """Yield number (from 1 on) and bytes of each line of a buffered stream that is not only white space.

    A line longer than `LONGEST_LINE` is yielded as None as soon as that is known; the rest of it is skipped
    piece by piece. The last line needs no end.
    """
    number = 0
    while content := stream.readline(LONGEST_LINE + 1):
        number += 1
        if len(content) > LONGEST_LINE and not content.endswith(b"\n"):
            yield number, None
            while content and not content.endswith(b"\n"):
                content = stream.readline(LONGEST_LINE + 1)
        elif not content.isspace():
            yield number, content


def read_sample(line: bytes | None) -> SampleLine:
    """Return the sample in a line; None is a line that was too long to be read."""
    if line is None:
        raise InputError(f"the line is longer than {LONGEST_LINE} bytes")
    try:
        values = parse_json_object(line, LONGEST_LINE + 1)
    except ValueError as error:
        raise InputError(f"the line {error}".replace(": line 1, column", ", at column")) from None
    return validated(SampleLine, values)


def answers(
    runtime: AssuredEstimator, stream: BinaryIO, commands: "LiveCommands | None" = None
) -> Iterator[Answer]:
    """Yield the answer to each line of a stream before the next one is read.

    A line that is not a sample leaves the runtime as it is. `commands` adds the pull to command next.
    """
    return (_answer(runtime, number, line, commands) for number, line in numbered_lines(stream))


def _answer(
    runtime: AssuredEstimator, number: int, line: bytes | None, commands: "LiveCommands | None"
) -> Answer:
    try:
        given = read_sample(line)
        if commands is None and given.reference_deg is not None:
            raise InputError("reference_deg: no commands are made here, as no stroke is given")
        if given.reference_preview_deg and given.reference_deg is None:
            raise InputError(
                "reference_preview_deg: needs reference_deg, the angle that is wanted before these"
            )
    except ValueError as error:
        return Answer(_ENCODER.encode({"error": str(error)[:LONGEST_ERROR], "line": number}), None)
    pull_mm, measurement_deg, reference_deg = (
        math.nan if value is None else value
        for value in (given.pull_mm, given.measurement_deg, given.reference_deg)
    )
    if commands is not None and math.isnan(pull_mm):
        pull_mm = commands.command_mm
    reading = runtime.push(given.time_s, pull_mm, measurement_deg)
    sample = StreamSample(given.time_s, pull_mm, measurement_deg, reading, reference_deg)
    if commands is None:
        return Answer(reading_line(sample), sample)
    command_mm = commands.after(pull_mm, reference_deg, given.reference_preview_deg or [])
    return Answer(reading_line(sample, command_mm), sample)


def reading_line(sample: StreamSample, command_mm: float | None = None) -> str:
    """Return the line that answers a sample; `command_mm` is NaN before the first, None without commands."""
    reading = sample.reading
    values: dict[str, Any] = {
        "time_s": sample.time_s,
        "bend_deg": reading.bend_deg,
        "interval_deg": reading.interval_deg,
        "source": reading.source.value,
        "health": {"sample": flag_names(reading.health), "alarms": flag_names(reading.alarms)},
    }
    if command_mm is not None:
        values["command_mm"] = None if math.isnan(command_mm) else command_mm
    return _ENCODER.encode(values)


def protocol_schema() -> dict[str, Any]:
    """Return the JSON Schema of all lines: any of them is valid, `$defs` holds each kind."""
    models: tuple[type[BaseModel], ...] = (SampleLine, ReadingLine, ErrorLine)
    _, definitions = models_json_schema([(model, "serialization") for model in models])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Lines of `endotwin run`",
        "description": "One JSON object in each line: samples in, readings and errors out, one for each.",
        "anyOf": [{"$ref": f"#/$defs/{model.__name__}"} for model in models],
        **definitions,
    }


if __name__ == "__main__":
    print(json.dumps(protocol_schema(), indent=2))
