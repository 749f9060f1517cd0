"""One table says what an episode holds: messages, their comments, columns and the document agree with it."""

import csv
import re
from pathlib import Path

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.descriptor import Descriptor
from recorded import make_episode

from twin.recording import messages, write_csv
from twin.recording.endotwin_pb2 import DESCRIPTOR
from twin.recording.features import COMMAND_ANGLE, FEATURES, TABLE, UNITS, Feature, column_names, recorded
from twin.recording.messages import SCHEMAS

PROTO = Path(messages.__file__).with_name("endotwin.proto").read_text()
DOCUMENT = (Path(__file__).parents[2] / "docs" / "dataset.md").read_text()
WIRES = "abcd"
OF_ESTIMATORS = {"Estimate", "Health"}
"""Messages that no episode holds: what an estimator said of one."""


def fields_of(feature: Feature) -> list[str]:
    return [feature.field.replace("*", wire) for wire in WIRES] if "*" in feature.field else [feature.field]


def comments(message: str) -> dict[str, str]:
    """The comment above each field of a message of ours."""
    (body,) = re.findall(rf"message {message} {{\n(.*?)\n}}", PROTO, re.DOTALL)
    found = re.findall(r"//([^\n]*(?:\n *//[^\n]*)*)\n *(?:optional |repeated )?double (\w+) =", body)
    return {field: " ".join(re.sub(r"\n *//", "", text).split()) for text, field in found}


def of_any_wire(text: str) -> str:
    return re.sub(r"\b(each wire|wire [a-d])\b", "wire", text).lower()


@pytest.mark.parametrize("feature", FEATURES, ids=lambda feature: feature.name)
def test_every_quantity_is_a_field_of_the_message_of_its_topic(feature):
    message: Descriptor = SCHEMAS[feature.topic].DESCRIPTOR
    if message is JointStates.DESCRIPTOR:
        assert feature.field == "joints[].position"
        assert "position" in message.fields_by_name["joints"].message_type.fields_by_name
        return
    for field in fields_of(feature):
        assert message.fields_by_name[field].type == message.fields_by_name[field].TYPE_DOUBLE
    assert feature.field.rpartition("_")[2] == feature.name.rpartition("_")[2]  # the unit


def test_every_field_of_our_messages_is_a_quantity():
    wanted = {
        (SCHEMAS[feature.topic].DESCRIPTOR.name, field)
        for feature in FEATURES
        for field in fields_of(feature)
    }
    ours = {
        (message.name, field)
        for message in DESCRIPTOR.message_types_by_name.values()
        if message.name not in OF_ESTIMATORS
        for field in message.fields_by_name
    }
    assert ours == {(message, field) for message, field in wanted if message != JointStates.DESCRIPTOR.name}


@pytest.mark.parametrize(
    "feature", [one for one in FEATURES if one.topic != "/joint_states"], ids=lambda feature: feature.name
)
def test_comment_of_every_field_begins_with_the_meaning_and_the_unit(feature):
    of_message = comments(SCHEMAS[feature.topic].DESCRIPTOR.name)
    for field in fields_of(feature):
        wanted = of_any_wire(f"{feature.meaning} [{feature.unit}]")
        assert of_any_wire(of_message[field]).startswith(wanted), of_message[field]
        if "*" in feature.field:
            assert f"wire {field[-3] if field.endswith('_n') else field[-4]}" in of_message[field]


def test_document_lists_these_quantities_with_topic_unit_and_meaning_and_no_others():
    (table,) = re.findall(r"\| topic \(schema\) \| field .*\n\|[-|]+\n((?:\|.*\n)+)", DOCUMENT)
    topic, rows = "", []
    for line in table.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        topic = re.match(r"`([^`]+)`", cells[0])[1] if cells[0] else topic
        if topic in {feature.topic for feature in FEATURES}:
            rows.append((topic, cells[1].strip("`"), cells[2], cells[3]))
    assert len(rows) == len(FEATURES)
    for (topic, field, unit, what), feature in zip(rows, FEATURES, strict=True):
        assert (topic, field, unit) == (feature.topic, feature.field, feature.unit)
        assert re.match(rf"{re.escape(feature.meaning)}($|[,;.])", what), what


def test_every_unit_is_used_and_every_name_ends_in_one():
    assert {feature.name.rpartition("_")[2] for feature in FEATURES} == set(UNITS)


def columns_of(tmp_path, *, everything: bool) -> list[str]:
    episode = make_episode(planes=2, drive=True)
    episode.metadata["preset"]["pulley_radius"] = 0.01
    path = write_csv(tmp_path / "a.csv", episode, everything=everything)
    return next(csv.reader(path.open()))


def test_columns_of_a_table_are_those_of_the_quantities_that_it_names(tmp_path):
    assert set(TABLE) - {feature.column for feature in FEATURES} == {COMMAND_ANGLE}
    held = recorded(make_episode(planes=2, drive=True))
    shapes = {feature.column: (feature, held[feature.name].shape[1:]) for feature in FEATURES}
    of_table = [column_names(*shapes[name]) if name in shapes else (name,) for name in TABLE]
    short = ["time_s", *(column for columns in of_table for column in columns)]
    assert columns_of(tmp_path, everything=False) == short
    rest = [column_names(*shapes[name]) for name in shapes if name not in TABLE]
    assert columns_of(tmp_path, everything=True) == [
        *short,
        *(column for columns in rest for column in columns),
    ]


def test_columns_of_parquet_files_are_the_quantities_each_once():
    frames = pytest.importorskip("twin.export.columns")
    episode = make_episode(planes=2, drive=True)
    columns = frames.frame_columns(episode, per_second=50, episode_index=0, first_index=0, task_index=0)
    own = {"timestamp", "frame_index", "episode_index", "index", "task_index"}  # LeRobot's
    held = recorded(episode)
    wanted: dict[str, list[str]] = {"observation.state": [], "action": []}
    for feature in FEATURES:
        joined = {"/measurement": "observation.state", "/tension": "observation.state", "/command": "action"}
        name = joined.get(feature.topic, f"truth.{feature.column}")
        wanted.setdefault(name, []).extend(column_names(feature, held[feature.name].shape[1:]))
    assert {name: list(column.names) for name, column in columns.items() if name not in own} == wanted
