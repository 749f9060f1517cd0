"""YAML: plain values come back as PyYAML has them; what could stop a command is refused quickly."""

import time

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from twin.errors import InputError
from twin.files.yaml_text import MOST_BYTES, MOST_NODES, parse_yaml, read_yaml

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@given(VALUES)
def test_what_pyyaml_writes_comes_back(values):
    assert parse_yaml(yaml.safe_dump(values)) == values
    assert parse_yaml(yaml.safe_dump(values, default_flow_style=True, allow_unicode=True)) == values


@given(st.text(max_size=200) | st.binary(max_size=200))
def test_any_text_gives_values_or_one_line(text):
    said = ""
    try:
        parse_yaml(text)
    except InputError as error:
        said = str(error)
    assert said.isprintable()
    assert len(said) < 250


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("a: 1\nb: 2\na: 3", "line 3: the key 'a' is there twice"),
        ("x: {a: 1, 'a': 2}", "line 1: the key 'a' is there twice"),
        ("7: 1\n'7': 2", "line 2: the key '7' is there twice"),
        ("a: &x 1", r"line 1: an anchor or alias \(x\)"),
        ("a: *x", r"line 1: an anchor or alias \(x\)"),
        ("a: !!python/object/apply:os.system [ls]", "line 1: the tag "),
        ("a: !!int 5", "line 1: the tag "),
        ("--- 1\n--- 2", "line 2: a second document"),
        ("? [1]\n: 2", "line 1: a key must be text"),
        ("a: \x00", "control characters are not allowed"),
        (b"a: \xff", "no UTF-8 text, from byte 3 on"),
        ("a: 1".encode("utf-16"), "no UTF-8 text"),
        ("[" * 200_000, "nested deeper than 20 levels"),
        ("{a: " * 200_000, "nested deeper than 20 levels"),
        ("- " * 200_000, "nested deeper than 20 levels"),
        ("[" + "1," * MOST_NODES + "]", f"more than {MOST_NODES} values"),
        ("#" * (MOST_BYTES + 1), "bytes: at most"),
    ],
)
def test_what_is_not_plain_is_refused_with_its_line_and_at_once(text, fault):
    begin = time.process_time()
    with pytest.raises(InputError, match=fault) as refused:
        parse_yaml(text)
    assert "\n" not in str(refused.value)
    assert time.process_time() - begin < 5


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2020-13-01", "2020-13-01"),
        ("2020-01-01", "2020-01-01"),
        ("1:30", "1:30"),
        ("1e6", 1e6),
        ("010", "010"),
        ("9" * 301, "9" * 301),
        ("1.5e+3", 1500.0),
        ("yes", True),
        ("Off", False),
        ("~", None),
        ("'5'", "5"),
        ("-.inf", float("-inf")),
        ("1_000", 1000),
        ("<<", "<<"),
    ],
)
def test_words_stand_for_what_both_versions_of_yaml_say(text, value):
    found = parse_yaml(f"a: {text}")["a"]
    assert (found, type(found)) == (value, type(value))


def test_a_mark_of_byte_order_is_passed_over_and_the_file_is_named(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1")
    assert read_yaml(path) == {"a": 1}
    path.write_bytes(b"a: [1")
    with pytest.raises(InputError, match=r"a\.yaml is not a YAML file: line "):
        read_yaml(path)
