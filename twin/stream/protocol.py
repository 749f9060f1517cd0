"""The lines of a live stream: samples in, readings and errors out, each one JSON object; and their schema.

`assets/run_protocol.schema.json` is this module's schema for programs in other languages; `make schema`
writes it anew.
"""

import functools
import json
import math
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import models_json_schema

from twin.errors import InputError
from twin.estimation.health import Health
from twin.files.json_text import parse_json_object, validated
from twin.runtime.reading import Alarm, Source
from twin.stream.lines import LONGEST_LINE
from twin.stream.sample import StreamSample

MOST_COMING = 256
"""Wanted angles ahead that a sample may tell."""
LONGEST_ERROR = 300
"""Characters of the text of an error."""

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
        Number | None, Field(description="commanded pulling distance; without it, the last one stands [mm]")
    ] = None
    measurement_deg: Annotated[
        Number | None, Field(description="measured bending angle; without it, it is missing [deg]")
    ] = None
    reference_deg: Annotated[
        Number | None,
        Field(description="bending angle that is wanted at the next sample; without it, the last one [deg]"),
    ] = None
    coming_deg: Annotated[
        list[Number] | None,
        Field(max_length=MOST_COMING, description="angles that are wanted at the samples after that [deg]"),
    ] = None


class HealthPart(BaseModel):
    """Faults of a sample, and reasons not to trust the trained estimator."""

    model_config = ConfigDict(extra="forbid")

    sample: Annotated[list[SampleFault], Field(description="faults of this sample; none, if it is good")]
    alarms: Annotated[list[AlarmName], Field(description="what speaks against the trained estimator")]


class ReadingLine(BaseModel):
    """Line out: the answer to a sample."""

    model_config = ConfigDict(extra="forbid")

    time_s: Annotated[float, Field(description="time stamp of the sample, as it came [s]")]
    bend_deg: Annotated[float, Field(description="estimate of the bending angle [deg]")]
    interval_deg: Annotated[
        tuple[float, float] | None, Field(description="95 % interval, low and high; null if unknown [deg]")
    ]
    source: Annotated[SourceName, Field(description="who made the estimate")]
    health: HealthPart
    command_mm: Annotated[
        float | None,
        Field(description="pull to command next, where a stroke is given; null before a reference [mm]"),
    ] = None


class ErrorLine(BaseModel):
    """Line out: the answer to a line that is no sample. The estimator has not seen it."""

    model_config = ConfigDict(extra="forbid")

    error: Annotated[str, Field(max_length=LONGEST_ERROR, description="the fault, in one line")]
    line: Annotated[int, Field(ge=1, description="number of the line in the stream, empty lines counted")]


class StreamLine(NamedTuple):
    """Content of a line of a stream; NaN, and no angles, where it says nothing.

    Attributes:
        time_s: time stamp [s].
        pull_mm: commanded pulling distance [mm].
        measurement_deg: measured angle [deg].
        reference_deg: angle that is wanted at the next sample [deg].
        coming_deg: angles that are wanted at the samples after that [deg].
    """

    time_s: float
    pull_mm: float
    measurement_deg: float
    reference_deg: float
    coming_deg: list[float]


def read_sample(line: bytes | None) -> StreamLine:
    """Return what a line says.

    Args:
        line: its bytes; None where it was too long to be read.

    Raises:
        ValueError: it is no sample; the text says why.
    """
    if line is None:
        raise InputError(f"the line is longer than {LONGEST_LINE} bytes")
    try:
        values = parse_json_object(line, LONGEST_LINE + 1)
    except ValueError as error:
        raise InputError(f"the line {error}".replace(": line 1, column", ", at column")) from None
    sample = validated(SampleLine, values)
    given = sample.pull_mm, sample.measurement_deg, sample.reference_deg
    pull_mm, measurement_deg, reference_deg = (math.nan if value is None else value for value in given)
    return StreamLine(sample.time_s, pull_mm, measurement_deg, reference_deg, sample.coming_deg or [])


def reading_line(sample: StreamSample, command_mm: float | None = None) -> str:
    """Return the line that answers a sample, without its end.

    Args:
        sample: with its reading.
        command_mm: pull to command next, NaN where none can be told yet; None where none is asked for [mm].
    """
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


def error_line(error: ValueError, number: int) -> str:
    """Return the line that answers one that is no sample, without its end."""
    return _ENCODER.encode({"error": str(error)[:LONGEST_ERROR], "line": number})


@functools.lru_cache(maxsize=4096)
def flag_names(flags: Health | Alarm) -> list[str]:
    """Return the names of the flags that are set."""
    return [str(flag.name) for flag in flags]


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
