"""Reader of JSON: what `json` writes comes back; what could fell a command is refused quickly."""

import json
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.errors import InputError
from twin.files.json_text import MOST_BYTES, parse_json, parse_json_object, read_json

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@given(VALUES)
def test_what_json_writes_comes_back(values):
    assert parse_json(json.dumps(values)) == values
    assert parse_json(json.dumps(values, ensure_ascii=False, indent=1).encode()) == values


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('{"a": 1, "a": 2}', "has the key 'a' twice"),
        ('{"a": NaN}', "holds NaN, which is no number"),
        ("[-Infinity]", "holds -Infinity"),
        ('{"a": 1e999}', "beyond the largest number"),
        ("9" * 100_000, "a number of more than 300 digits"),
        ('{"a": "\\ud800"}', "no UTF-8 text"),
        (b"\xff", "no UTF-8 text"),
        (b"\xef\xbb\xbf{}", "is not JSON"),
        ("", "is not JSON: Expecting value: line 1, column 1"),
        ("{}x", "is not JSON: Extra data"),
        ("[" * 200_000, "nested too deeply"),
        ('{"a":' * 200_000, "nested too deeply"),
        ('"' + '\\"' * 1_000_000, "is not JSON: Unterminated string"),
        ('"' + "\\" * 1_000_001, "is not JSON"),
        (" " * (MOST_BYTES + 1), "bytes: at most"),
    ],
)
def test_what_is_not_plain_is_refused_at_once(text, fault):
    begin = time.process_time()
    with pytest.raises(InputError, match=fault) as refused:
        parse_json(text)
    assert "\n" not in str(refused.value)
    assert time.process_time() - begin < 5


def test_a_file_is_named_and_must_hold_an_object(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("[1]")
    with pytest.raises(InputError, match=r"a\.json is not a JSON object with keys"):
        read_json(path)
    with pytest.raises(InputError, match="is not a JSON object"):
        parse_json_object("null")


def test_the_deepest_texts_do_not_fell_the_interpreter():
    program = (
        "from twin.errors import InputError\n"
        "from twin.files.json_text import parse_json\n"
        "from twin.files.yaml_text import parse_yaml\n"
        "for parse in (parse_json, parse_yaml):\n"
        "    for text in ('[' * 200_000, '{\"a\":' * 200_000, '- ' * 200_000, '? ' * 200_000):\n"
        "        try:\n            parse(text)\n"
        "        except InputError as error:\n            print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr[-300:]
    assert len(done.stdout.splitlines()) == 8
