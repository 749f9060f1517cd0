"""Lines of a live stream: bounded, read to the last bit, answered once each, valid by the shipped schema."""

import io
import json
import math

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from repository import REPOSITORY

from twin.episode import Record
from twin.errors import InputError
from twin.live import load_runtime
from twin.live.lines import (
    LONGEST_ERROR,
    LONGEST_LINE,
    answers,
    numbered_lines,
    protocol_schema,
    read_sample,
    reading_line,
)
from twin.live.log_run import replay
from twin.live.reading import Alarm, Health, Reading, RunCounts, Source, StreamSample

SCHEMA = json.loads((REPOSITORY / "assets/run_protocol.schema.json").read_text())
VALIDATORS = {
    kind: jsonschema.Draft202012Validator({**SCHEMA, "anyOf": [{"$ref": f"#/$defs/{kind}"}]})
    for kind in ("SampleLine", "ReadingLine", "ErrorLine")
}
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
FAULTY = b'\nnonsense\n{"time_s":NaN}\n   \n{"time_s":true}\n' + b"x" * 70_000 + b"\n[]\n"


def valid(kind: str, line: str) -> None:
    VALIDATORS[kind].validate(json.loads(line))


def split(data: bytes) -> list[tuple[int, bytes | None]]:
    """Numbered lines by splitting all of them at once."""
    lines = data.split(b"\n")[: None if data and not data.endswith(b"\n") else -1]
    return [
        (number, None if len(content) > LONGEST_LINE else content)
        for number, content in enumerate(lines, 1)
        if len(content) > LONGEST_LINE or content.strip()
    ]


def test_line_of_any_length_is_read_in_bounded_pieces():
    sizes = []

    class Watched(io.BytesIO):
        def readline(self, size=-1):
            content = super().readline(size)
            sizes.append(len(content))
            return content

    lines = numbered_lines(Watched(b"z" * 20_000_000 + b"\nlast"))
    assert next(lines) == (1, None)
    assert len(sizes) == 1  # refused before its end
    assert [*lines] == [(2, b"last")]
    assert max(sizes) <= LONGEST_LINE + 1


def test_shipped_schema_is_that_of_the_models():
    assert protocol_schema() == SCHEMA, "run `make schema`"
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    for kind, line in (("SampleLine", '{"time_s":"1"}'), ("ErrorLine", '{"error":"a"}')):
        with pytest.raises(jsonschema.ValidationError):
            valid(kind, line)


@given(FLOATS, *[st.none() | FLOATS] * 3, st.none() | st.lists(FLOATS, max_size=256))
def test_sample_is_read_to_the_last_bit(
    time_s, pull_mm, measurement_deg, reference_deg, reference_preview_deg
):
    given = {
        "time_s": time_s,
        "pull_mm": pull_mm,
        "measurement_deg": measurement_deg,
        "reference_deg": reference_deg,
        "reference_preview_deg": reference_preview_deg,
    }
    for values in (given, {name: value for name, value in given.items() if value is not None}):
        line = json.dumps(values)
        valid("SampleLine", line)
        assert read_sample(line.encode()).model_dump() == given


@given(
    FLOATS,
    FLOATS,
    st.floats() | st.floats(-90, 400),
    st.sampled_from(Source),
    st.lists(st.sampled_from(list(Health))),
    st.lists(st.sampled_from(list(Alarm))),
    st.none() | FLOATS | st.just(math.nan),
)
def test_every_answer_is_valid_and_has_the_complete_reading(
    time_s, bend, end, source, faults, alarms, command_mm
):
    health, alarm = Health.GOOD, Alarm.NONE
    for flag in faults:
        health |= flag
    for flag in alarms:
        alarm |= flag
    reading = Reading(bend, -1.0, end, source, health, alarm)
    line = reading_line(StreamSample(time_s, 0.0, 0.0, reading), command_mm)
    valid("ReadingLine", line)
    assert "\n" not in line
    answer = json.loads(line)
    assert (answer["time_s"], answer["bend_deg"], answer["source"]) == (time_s, bend, source.value)
    assert answer["interval_deg"] == ([-1.0, end] if abs(end + 1) < 359.999999 else None)
    assert set(answer["health"]["sample"]) == {flag.name for flag in faults}
    assert set(answer["health"]["alarms"]) == {flag.name for flag in alarms}
    assert ("command_mm" in answer) == (command_mm is not None)
    if command_mm is not None:
        assert answer["command_mm"] == (None if math.isnan(command_mm) else command_mm)


HOSTILE = [
    *[
        (line, "is not JSON")
        for line in (b"", b'{"time_s":1', b'{"time_s":1}{"time_s":2}', b"\xef\xbb\xbf{}")
    ],
    (b"foo", "the line is not JSON: Expecting value, at column 1"),
    (b'{"time_s":"\xc3\x28"}', "no UTF-8 text, from byte 11 on"),
    (b'{"time_s":1,"pull_mm":"\\ud800"}', "no UTF-8 text"),
    (b'{"time_s":NaN}', "the line holds NaN, which is no number"),
    (b'{"time_s":1,"pull_mm":-Infinity}', "holds -Infinity"),
    (b'{"time_s":1e999}', "holds 1e999, which is beyond the largest number"),
    (b'{"time_s":' + b"9" * 400 + b"}", "a number of more than 300 digits"),
    *[(line, "nested too deeply") for line in (b"[" * 60_000, b'{"a":' * 12_000)],
    (b'{"time_s":1,"time_s":2}', "has the key 'time_s' twice"),
    *[(line, "is not a JSON object with keys") for line in (b"[0.1]", b"1.5", b"null", b'"time_s"')],
    (b"{}", "time_s is missing, it must be there"),
    (b'{"time_s":null}', "time_s = None: must be a valid number"),
    (b'{"time_s":true}', "time_s = True: must be a valid number"),
    (b'{"time_s":"0.1"}', "time_s = '0.1': must be a valid number"),
    (b'{"time_s":1,"measurement_deg":[2]}', "measurement_deg = [2]: must be a valid number"),
    (b'{"time_s":1,"pull_mm":{}}', "pull_mm = {}: must be a valid number"),
    (
        b'{"time_s":1,"measurment_deg":2}',
        "unknown key measurment_deg; valid: time_s, pull_mm, measurement_deg",
    ),
    (b'{"time_s":1,"\\u001b[31m":2}', "unknown key"),
    (b'{"time_s":1,"' + b"k" * 60_000 + b'":2}', "unknown key kkk"),
    *[
        (b'{"time_s":1,"reference_deg":2,"reference_preview_deg":%b}' % line, "reference_preview_deg")
        for line in (b"[null]", b'["1"]', b"1.0", b"[[1.0]]", b"[true]", b"[1" + b",1" * 256 + b"]")
    ],
    (None, f"the line is longer than {LONGEST_LINE} bytes"),
]


@pytest.mark.parametrize(("line", "message"), HOSTILE)
def test_line_that_is_not_a_sample_is_refused_in_one_clear_line(line, message):
    with pytest.raises(InputError) as error:
        read_sample(line)
    assert message in str(error.value)
    assert str(error.value).isprintable()
    assert len(str(error.value)) <= LONGEST_ERROR


@given(st.binary(max_size=200) | st.text(max_size=100).map(str.encode))
def test_no_bytes_do_harm(data):
    message = ""
    try:
        read_sample(data)
    except InputError as error:
        message = str(error)
    assert message.isprintable()


@pytest.fixture(scope="module")
def log() -> Record:
    """A log with a gap in time, missing measurements and an outlier."""
    time = np.delete(np.arange(80) * 0.1, slice(30, 36))
    measured = 60 + 20 * np.sin(time - 0.3) + np.random.default_rng(3).normal(size=len(time))
    measured[[5, 6, 50]] = np.nan
    measured[60] = 500.0
    return Record(time, 3 + np.sin(time), measured_deg=measured, source="measured")


@pytest.fixture(scope="module")
def runtime(ram_policy):
    return lambda: load_runtime(ram_policy, initial_bend_deg=55.0, noise_variance=1.0)


def test_live_stream_has_the_bits_of_the_log_however_many_bad_lines_are_between(runtime, log):
    samples = [*replay(runtime(), log)]
    expected = [sample.reading for sample in samples]
    lines = []
    for time_s, pull_mm, measured in zip(
        log.time.tolist(), log.pull_mm.tolist(), log.measured_deg.tolist(), strict=True
    ):
        seen = {} if math.isnan(measured) else {"measurement_deg": measured}
        lines.append(json.dumps({"time_s": time_s, "pull_mm": pull_mm} | seen).encode() + b"\n")
    for stream in (FAULTY.join([b"", *lines, b""]), b"".join(lines)[:-1]):
        given = [answer for answer in answers(runtime(), io.BytesIO(stream)) if answer.sample]
        assert [answer.sample.reading for answer in given] == expected
        values = [json.loads(answer.text) for answer in given]
        assert [line["bend_deg"] for line in values] == [reading.bend_deg for reading in expected]
        assert [line["time_s"] for line in values] == log.time.tolist()
    counts = RunCounts()
    for sample in samples:
        counts.add(sample)
    values = counts.to_dict()
    assert (values["samples"], values["faults"]["NO_MEASUREMENT"], values["faults"]["GAP"]) == (74, 3, 1)
    assert values["faulty"] == sum(bool(reading.health) for reading in expected)
    assert "74 samples" in str(counts)


def test_each_line_that_is_not_empty_is_answered_once_before_the_next_is_read(runtime):
    class Asking(io.BytesIO):
        asked = 0

        def readline(self, size=-1):
            self.asked += 1
            return super().readline(size)

    stream = b'{"time_s":0,"pull_mm":3}\n' + FAULTY + b'{"time_s":0.1}'
    texts = [answer.text for answer in answers(runtime(), io.BytesIO(stream))]
    assert [json.loads(text).get("line") for text in texts] == [None, 3, 4, 6, 7, 8, None]
    valid("ErrorLine", texts[1])
    asking = Asking(b'{"time_s":0,"pull_mm":3}\n' * 3)
    for number, _ in enumerate(answers(runtime(), asking), 1):
        assert asking.asked == number
