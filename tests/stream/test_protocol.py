"""The lines of a live stream: what is a sample, what is said of one that is none, and the schema of all."""

import json
import math

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from repository import REPOSITORY

from twin.errors import InputError
from twin.estimation.health import Health
from twin.runtime.reading import Alarm, Reading, Source
from twin.stream.lines import LONGEST_LINE
from twin.stream.protocol import LONGEST_ERROR, error_line, protocol_schema, read_sample, reading_line
from twin.stream.sample import StreamSample

SCHEMA = json.loads((REPOSITORY / "assets/run_protocol.schema.json").read_text())
FLOATS = st.floats(allow_nan=False, allow_infinity=False)


VALIDATORS = {
    kind: jsonschema.Draft202012Validator({**SCHEMA, "anyOf": [{"$ref": f"#/$defs/{kind}"}]})
    for kind in ("SampleLine", "ReadingLine", "ErrorLine")
}


def valid(kind: str, line: str) -> None:
    """Refuse a line that the shipped schema does not call one of a kind."""
    VALIDATORS[kind].validate(json.loads(line))


def reading(bend=1.0, low=0.0, high=2.0, source=Source.ADVANCED, health=Health.GOOD, alarms=Alarm.NONE):
    return Reading(bend, low, high, source, health, alarms)


def test_the_shipped_schema_is_that_of_the_models():
    assert protocol_schema() == SCHEMA, "run `make schema`"
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@given(FLOATS, *[st.none() | FLOATS] * 3)
def test_a_sample_is_read_to_the_last_bit(time_s, pull_mm, measurement_deg, reference_deg):
    given = {
        "time_s": time_s,
        "pull_mm": pull_mm,
        "measurement_deg": measurement_deg,
        "reference_deg": reference_deg,
    }
    for values in (given, {name: value for name, value in given.items() if value is not None}):
        line = json.dumps(values)
        valid("SampleLine", line)
        read = read_sample(line.encode())
        for got, sent in zip(read, given.values(), strict=False):
            assert math.isnan(got) if sent is None else got == sent
        assert read.coming_deg == []


@given(st.lists(FLOATS, max_size=256))
def test_angles_that_come_are_read_to_the_last_bit(coming):
    line = json.dumps({"time_s": 1.0, "reference_deg": 2.0, "coming_deg": coming})
    valid("SampleLine", line)
    assert read_sample(line.encode()).coming_deg == coming


@pytest.mark.parametrize("coming", [[1.0] * 257, [None], ["1"], 1.0, [[1.0]], [True]])
def test_what_is_no_list_of_angles_is_refused(coming):
    with pytest.raises(ValueError, match="coming_deg"):
        read_sample(json.dumps({"time_s": 1.0, "reference_deg": 2.0, "coming_deg": coming}).encode())


@given(
    FLOATS,
    FLOATS,
    st.floats() | st.floats(-90, 400),
    st.sampled_from(Source),
    st.lists(st.sampled_from(list(Health))),
    st.lists(st.sampled_from(list(Alarm))),
)
def test_every_answer_is_valid_and_says_all_of_the_reading(time_s, bend, end, source, faults, alarms):
    health, alarm = Health.GOOD, Alarm.NONE
    for flag in faults:
        health |= flag
    for flag in alarms:
        alarm |= flag
    line = reading_line(StreamSample(time_s, 0.0, 0.0, reading(bend, -1.0, end, source, health, alarm)))
    valid("ReadingLine", line)
    assert "\n" not in line
    told = json.loads(line)
    assert (told["time_s"], told["bend_deg"], told["source"]) == (time_s, bend, source.value)
    assert told["interval_deg"] == ([-1.0, end] if abs(end + 1) < 359.999999 else None)
    assert set(told["health"]["sample"]) == {flag.name for flag in faults}
    assert set(told["health"]["alarms"]) == {flag.name for flag in alarms}


HOSTILE = [
    (b"", "is not JSON"),
    (b"foo", "the line is not JSON: Expecting value, at column 1"),
    (b'{"time_s":1', "is not JSON"),
    (b'{"time_s":1}{"time_s":2}', "is not JSON: Extra data"),
    (b"\xff\xfe{}", "no UTF-8 text, from byte 0 on"),
    (b'\xef\xbb\xbf{"time_s":1}', "BOM"),
    (b'{"time_s":"\xc3\x28"}', "no UTF-8 text, from byte 11 on"),
    (b'{"time_s":NaN}', "the line holds NaN, which is no number"),
    (b'{"time_s":1,"pull_mm":Infinity}', "holds Infinity, which is no number"),
    (b'{"time_s":1,"pull_mm":-Infinity}', "holds -Infinity"),
    (b'{"time_s":1e999}', "holds 1e999, which is beyond the largest number"),
    (b'{"time_s":' + b"9" * 400 + b"}", "a number of more than 300 digits"),
    (b"[" * 60_000, "nested too deeply"),
    (b'{"a":' * 12_000, "nested too deeply"),
    (b'{"time_s":1,"time_s":2}', "has the key 'time_s' twice"),
    (b"[0.1,0.2,1.3]", "is not a JSON object with keys"),
    (b"1.5", "is not a JSON object with keys"),
    (b"null", "is not a JSON object with keys"),
    (b'"time_s"', "is not a JSON object with keys"),
    (b"{}", "time_s is missing, it must be there"),
    (b'{"time_s":null}', "time_s = None: must be a valid number"),
    (b'{"time_s":true}', "time_s = True: must be a valid number"),
    (b'{"time_s":1,"pull_mm":false}', "pull_mm = False: must be a valid number"),
    (b'{"time_s":"0.1"}', "time_s = '0.1': must be a valid number"),
    (b'{"time_s":1,"measurement_deg":[2]}', "measurement_deg = [2]: must be a valid number"),
    (b'{"time_s":1,"pull_mm":{}}', "pull_mm = {}: must be a valid number"),
    (
        b'{"time_s":1,"measurment_deg":2}',
        "unknown key measurment_deg; valid: time_s, pull_mm, measurement_deg, reference_deg",
    ),
    (b'{"time_s":1,"\\u001b[31m":2}', "unknown key"),
    (b'{"time_s":1,"pull_mm":"\\ud800"}', "no UTF-8 text"),
    (b'{"time_s":1,"' + b"k" * 60_000 + b'":2}', "unknown key kkk"),
    (None, f"the line is longer than {LONGEST_LINE} bytes"),
]


@pytest.mark.parametrize(("line", "said"), HOSTILE)
def test_a_line_that_is_no_sample_is_told_in_one_clear_line(line, said):
    with pytest.raises(InputError) as error:
        read_sample(line)
    text = str(error.value)
    assert said in text
    assert text.isprintable()
    assert len(text) <= LONGEST_ERROR
    valid("ErrorLine", error_line(error.value, 7))


@given(st.binary(max_size=200) | st.text(max_size=100).map(str.encode))
def test_no_bytes_do_harm(data):
    refused = None
    try:
        read_sample(data)
    except InputError as error:
        refused = error
    if refused:
        assert str(refused).isprintable()
        valid("ErrorLine", error_line(refused, 1))


def test_a_number_that_is_whole_is_a_number_and_a_huge_one_is_the_estimators_business():
    assert read_sample(b'{"time_s":1,"pull_mm":2,"measurement_deg":-0.0}')[:3] == (1.0, 2.0, 0.0)
    assert read_sample(b'{"time_s":' + b"9" * 300 + b"}")[0] == pytest.approx(1e300)


@pytest.mark.parametrize(("kind", "line"), [("SampleLine", '{"time_s":"1"}'), ("ErrorLine", '{"error":"a"}')])
def test_the_schema_refuses_what_is_none(kind, line):
    with pytest.raises(jsonschema.ValidationError):
        valid(kind, line)


@pytest.mark.parametrize(("command_mm", "told"), [(0.25, 0.25), (math.nan, None)])
def test_a_command_is_told_where_one_is_asked_for_and_null_before_it_can_be(command_mm, told):
    sample = StreamSample(1.0, 0.0, 0.0, reading())
    assert "command_mm" not in json.loads(reading_line(sample))
    line = reading_line(sample, command_mm)
    valid("ReadingLine", line)
    assert json.loads(line)["command_mm"] == told
