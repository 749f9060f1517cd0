"""What others read: topics, frames, metadata and the CSV table."""

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from recorded import make_episode, messages

from twin.recording import EpisodeWriter, write_csv, write_episode
from twin.recording import endotwin_pb2 as schema
from twin.recording.camera import CAMERA_TOPIC, picture_message
from twin.recording.messages import SCHEMAS, required_topics

REQUIRED_TOPICS = required_topics(measured=False)


def test_a_picture_goes_next_to_the_episode(tmp_path):
    with EpisodeWriter(tmp_path / "a.mcap") as writer:
        writer.write(make_episode())
        writer.add_message(CAMERA_TOPIC, picture_message(b"\xff\xd8 a picture", 1_040_000_000), 1_040_000_000)
    ((record, picture),) = messages(tmp_path / "a.mcap")["/camera/image"]
    assert picture.DESCRIPTOR.full_name == "foxglove.CompressedImage"
    assert (picture.data, picture.format, picture.frame_id) == (b"\xff\xd8 a picture", "jpeg", "camera")
    assert record.log_time == picture.timestamp.ToNanoseconds() == 1_040_000_000


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
