"""What others read: topics, frames, metadata and the CSV table."""

import csv
import dataclasses
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from recorded import LINK, make_episode, messages
from scipy.spatial.transform import Rotation

from twin.recording import EpisodeWriter, write_csv, write_episode
from twin.recording import endotwin_pb2 as schema
from twin.recording.camera import CAMERA_TOPIC, picture_message
from twin.recording.messages import REQUIRED_TOPICS, SCHEMAS
from twin.recording.scene import scene


def test_an_independent_reader_sees_the_same(tmp_path):
    episode = make_episode(samples=40, start=1234.56)  # these times times 1e9 fall short of whole numbers
    seen = messages(write_episode(tmp_path / "a.mcap", episode))
    nanoseconds = [1_234_560_000_000 + 20_000_000 * k for k in range(40)]
    assert set(seen) == {"/command", "/truth", "/measurement", "/tension", "/joint_states", "/tf"}
    assert {tuple(record.sequence for record, _ in rows) for rows in seen.values()} == {tuple(range(40))}
    for rows in seen.values():
        assert [record.log_time for record, _ in rows] == nanoseconds
        assert [record.publish_time for record, _ in rows] == nanoseconds
    assert_fields_of_all_wires(seen, episode, "ab")
    angles = column(seen, "/joint_states", lambda m: [joint.position for joint in m.joints])
    np.testing.assert_array_equal(angles, episode.joint_angle)
    names = column(seen, "/joint_states", lambda m: [joint.name for joint in m.joints])
    assert names[-1] == ["hinge_0", "hinge_1", "hinge_2"]
    assert column(seen, "/joint_states", lambda m: m.timestamp.ToNanoseconds()) == nanoseconds


def test_an_independent_reader_sees_what_is_sideways_and_what_the_drive_did(tmp_path):
    episode = make_episode(planes=2, drive=True)
    seen = messages(write_episode(tmp_path / "a.mcap", episode))
    assert_fields_of_all_wires(seen, episode, "abcd")
    for wire, name in enumerate("abcd"):
        slack_mm = field(seen, "/truth", f"wire_slack_{name}_mm")
        np.testing.assert_allclose(slack_mm, episode.wire_slack[:, wire] * 1000, rtol=1e-12)
    for topic, name, wanted in (
        ("/command", "lateral_pull_mm", episode.lateral_pull * 1000),
        ("/truth", "lateral_bend_deg", np.rad2deg(episode.lateral_bend)),
        ("/truth", "pulley_mm", episode.pulley * 1000),
        ("/truth", "sheath_bend_deg", np.rad2deg(episode.sheath_bend)),
    ):
        np.testing.assert_allclose(field(seen, topic, name), wanted, rtol=1e-12)
    names = column(seen, "/joint_states", lambda m: [joint.name for joint in m.joints])
    assert names[0] == [f"{side}hinge_{index}" for side in ("", "lateral_") for index in range(3)]
    angles = column(seen, "/joint_states", lambda m: [joint.position for joint in m.joints])
    np.testing.assert_array_equal(angles, np.hstack([episode.joint_angle, episode.lateral_joint_angle]))


def test_what_was_not_recorded_is_absent_from_the_messages(tmp_path):
    seen = messages(write_episode(tmp_path / "a.mcap", make_episode()))
    for (record, _), pull_mm in zip(seen["/command"], make_episode().pull_mm, strict=True):
        assert record.data == b"\x09" + struct.pack("<d", pull_mm)  # as before there were optional fields
    for topic, names in (
        ("/command", ["lateral_pull_mm"]),
        ("/truth", ["lateral_bend_deg", "pulley_mm", "sheath_bend_deg"]),
        ("/tension", ["tension_c_n", "tension_d_n"]),
    ):
        assert not any(column(seen, topic, lambda m, names=names: any(m.HasField(name) for name in names)))
    assert not any(
        len(values) for name in "abcd" for values in field(seen, "/truth", f"wire_slack_{name}_mm")
    )


def test_one_message_draws_the_endoscope(tmp_path):
    episode = make_episode(start=1234.0, planes=2, drawn=True)
    ((record, drawing),) = messages(write_episode(tmp_path / "a.mcap", episode))["/scene"]
    assert (record.log_time, record.publish_time, record.sequence) == (1_234_000_000_000,) * 2 + (0,)
    assert drawing.DESCRIPTOR.full_name == "foxglove.SceneUpdate"
    assert drawing.SerializeToString() == scene(episode, 1_234_000_000_000).SerializeToString()
    assert {entity.frame_id for entity in drawing.entities} == {"base", *(f"vertebra_{k}" for k in range(3))}


def test_a_picture_goes_beside_the_episode(tmp_path):
    with EpisodeWriter(tmp_path / "a.mcap") as writer:
        writer.write(make_episode())
        writer.add_message(CAMERA_TOPIC, picture_message(b"\xff\xd8 a picture", 1_040_000_000), 1_040_000_000)
    ((record, picture),) = messages(tmp_path / "a.mcap")["/camera/image"]
    assert picture.DESCRIPTOR.full_name == "foxglove.CompressedImage"
    assert (picture.data, picture.format, picture.frame_id) == (b"\xff\xd8 a picture", "jpeg", "camera")
    assert record.log_time == picture.timestamp.ToNanoseconds() == 1_040_000_000


def column(seen, topic, read):
    return [read(message) for _, message in seen[topic]]


def field(seen, topic, name):
    return column(seen, topic, lambda message: getattr(message, name))


def assert_fields_of_all_wires(seen, episode, wires):
    np.testing.assert_allclose(field(seen, "/command", "pull_mm"), episode.pull * 1000, rtol=1e-12)
    np.testing.assert_allclose(field(seen, "/truth", "truth_deg"), np.rad2deg(episode.bend), rtol=1e-12)
    np.testing.assert_allclose(
        field(seen, "/measurement", "measured_deg"), np.rad2deg(episode.measured_bend), rtol=1e-12
    )
    assert episode.wire_tension.shape[1] == len(wires)
    for wire, name in enumerate(wires):
        tension, friction = episode.wire_tension[:, wire], episode.sheath_friction[:, wire]
        np.testing.assert_array_equal(field(seen, "/tension", f"tension_{name}_n"), tension[:, 0])
        np.testing.assert_array_equal(field(seen, "/truth", f"wire_tension_{name}_n"), tension)
        np.testing.assert_array_equal(field(seen, "/truth", f"sheath_friction_{name}_n"), friction)


def test_frames_follow_the_hinges(tmp_path):
    episode = make_episode(samples=60, start=1234.0)
    for k, (record, message) in enumerate(messages(write_episode(tmp_path / "a.mcap", episode))["/tf"]):
        position, angle = np.zeros(2), 0.0
        for index, frame in enumerate(message.transforms):
            assert frame.parent_frame_id == (f"vertebra_{index - 1}" if index else "base")
            assert frame.child_frame_id == f"vertebra_{index}"
            assert frame.timestamp.ToNanoseconds() == record.log_time
            q = frame.rotation
            assert q.x == q.z == frame.translation.y == frame.translation.z == 0
            # A quaternion turns the x axis to (1 - 2 y^2, 0, -2 y w) when its x and z are 0.
            turned = [1 - 2 * q.y**2, -2 * q.y * q.w]
            own = episode.joint_angle[k, index]
            np.testing.assert_allclose(turned, [np.cos(own), np.sin(own)], atol=1e-12)
            position = position + frame.translation.x * np.array([np.cos(angle), np.sin(angle)])
            angle += own
        sums = np.cumsum(episode.joint_angle[k])[:-1]
        np.testing.assert_allclose(
            position, LINK * np.array([np.cos(sums).sum(), np.sin(sums).sum()]), atol=1e-15
        )


def test_frames_follow_the_hinges_of_both_planes(tmp_path):
    episode = make_episode(planes=2)
    for k, (_, message) in enumerate(messages(write_episode(tmp_path / "a.mcap", episode))["/tf"]):
        for index, frame in enumerate(message.transforms):
            q = frame.rotation
            up = Rotation.from_rotvec([0, -episode.joint_angle[k, index], 0])
            sideways = Rotation.from_rotvec([0, 0, episode.lateral_joint_angle[k, index]])
            np.testing.assert_allclose(
                Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(), (up * sideways).as_matrix(), atol=1e-12
            )
            # Seen from its parent, a frame points where its first hinge lifts it and its second turns it.
            x, y, z = Rotation.from_quat([q.x, q.y, q.z, q.w]).apply([1, 0, 0])
            own, lateral = episode.joint_angle[k, index], episode.lateral_joint_angle[k, index]
            wanted = [np.cos(own) * np.cos(lateral), np.sin(lateral), np.sin(own) * np.cos(lateral)]
            np.testing.assert_allclose([x, y, z], wanted, atol=1e-12)


@pytest.mark.parametrize(
    ("episode", "topics"),
    [
        (make_episode(vertebrae=0, elements=None), set(REQUIRED_TOPICS)),
        (make_episode(vertebrae=0, drawn=True), {*REQUIRED_TOPICS, "/tension"}),
        (make_episode(drawn=True), {*SCHEMAS}),
        (make_episode(elements=None), {*REQUIRED_TOPICS, "/joint_states", "/tf"}),
        (
            dataclasses.replace(make_episode(), metadata={"preset": "ureteroscope"}),
            {*REQUIRED_TOPICS, "/tension", "/joint_states"},
        ),
    ],
)
def test_what_was_not_recorded_has_no_topic(tmp_path, episode, topics):
    assert set(messages(write_episode(tmp_path / "a.mcap", episode))) == topics


def test_file_describes_itself_by_metadata_and_attachments(tmp_path):
    episode = make_episode()
    with write_episode(tmp_path / "a.mcap", episode).open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        (record,) = reader.iter_metadata()
        attachments = list(reader.iter_attachments())
        chunks = reader.get_summary().chunk_indexes
    assert record.name == "endotwin"
    assert {name: json.loads(text) for name, text in record.metadata.items()} == episode.metadata
    assert {item.name: item.data for item in attachments} == episode.attachments
    assert {(item.create_time, item.log_time) for item in attachments} == {(0, 0)}
    assert {chunk.compression for chunk in chunks} == {"zstd"}


def test_csv_holds_the_same_doubles(tmp_path):
    episode = make_episode()
    rows = list(csv.reader(write_csv(tmp_path / "a.csv", episode).open()))
    assert rows[0] == ["time_s", "pull_mm", "bend_deg", "tension_a_n", "tension_b_n"]
    wanted = np.column_stack([episode.time, episode.pull * 1e3, np.degrees(episode.bend), episode.tension])
    np.testing.assert_array_equal(np.array(rows[1:], dtype=float), wanted)
    bare = write_csv(tmp_path / "b.csv", make_episode(elements=None)).read_text()
    assert bare.splitlines()[0] == "time_s,pull_mm,bend_deg"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.csv"]


def test_csv_has_the_pulley_angle_where_the_radius_is_known_and_what_is_sideways(tmp_path):
    episode = make_episode(planes=2)
    episode.metadata["preset"]["pulley_radius"] = 0.02
    header, *rows = csv.reader(write_csv(tmp_path / "a.csv", episode).open())
    assert ",".join(header) == (
        "time_s,pull_mm,bend_deg,command_deg,tension_a_n,tension_b_n,tension_c_n,tension_d_n,"
        "lateral_pull_mm,lateral_bend_deg"
    )
    table = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    np.testing.assert_allclose(table["command_deg"], episode.pull / (2 * np.pi * 0.02) * 360, rtol=1e-12)
    np.testing.assert_array_equal(table["tension_d_n"], episode.tension[:, 3])
    np.testing.assert_array_equal(table["lateral_pull_mm"], episode.lateral_pull * 1e3)
    np.testing.assert_array_equal(table["lateral_bend_deg"], np.degrees(episode.lateral_bend))


def test_generated_code_is_that_of_the_schema_file(tmp_path):
    protoc = pytest.importorskip("grpc_tools.protoc")
    committed = Path(schema.__file__)
    source = committed.with_name("endotwin.proto")
    assert protoc.main(["protoc", f"-I{source.parent}", f"--python_out={tmp_path}", str(source)]) == 0

    def descriptor(generated: Path) -> list[str]:
        return [line for line in generated.read_text().splitlines() if "AddSerializedFile" in line]

    assert len(descriptor(committed)) == 1
    assert descriptor(tmp_path / committed.name) == descriptor(committed)
