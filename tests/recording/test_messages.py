"""The messages of an episode against the same messages built one by one, field by field, by the library."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.timestamp_pb2 import Timestamp
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.writer import Writer
from mcap_protobuf.schema import build_file_descriptor_set
from recorded import LINK, assert_equal, make_episode, messages

from twin.episode import Episode
from twin.recording import endotwin_pb2 as schema
from twin.recording import read_episode, write_episode
from twin.recording.chunks import varint_sizes, varints
from twin.recording.messages import SCHEMAS, to_nanoseconds
from twin.recording.scene import scene

SECOND = 10**9  # [ns]


def stamp(message: Any, nanoseconds: int) -> None:
    message.seconds, message.nanos = nanoseconds // SECOND, nanoseconds % SECOND


def built(episode: Episode, k: int, nanoseconds: int) -> dict[str, Any]:
    """The messages of one sample by topic, but for /scene, each number put where the schemas say."""
    wires = "abcd" if len(episode.lateral_pull) else "ab"
    command = schema.Command(pull_mm=(episode.pull * 1e3)[k])
    truth = schema.Truth(truth_deg=np.degrees(episode.bend)[k])
    if len(episode.lateral_pull):
        command.lateral_pull_mm = (episode.lateral_pull * 1e3)[k]
        truth.lateral_bend_deg = np.degrees(episode.lateral_bend)[k]
    if len(episode.pulley):
        truth.pulley_mm = (episode.pulley * 1e3)[k]
        truth.sheath_bend_deg = np.degrees(episode.sheath_bend)[k]
    for wire, name in enumerate(wires):
        getattr(truth, f"wire_tension_{name}_n").extend(episode.wire_tension[k, wire])
        getattr(truth, f"sheath_friction_{name}_n").extend(episode.sheath_friction[k, wire])
        if len(episode.wire_slack):
            getattr(truth, f"wire_slack_{name}_mm").extend(episode.wire_slack[k, wire] * 1e3)
    found: dict[str, Any] = {"/command": command, "/truth": truth}
    if np.isfinite(episode.measured_bend[k]):
        found["/measurement"] = schema.Measurement(measured_deg=np.degrees(episode.measured_bend)[k])
    if episode.wire_tension.shape[2] > 0:
        found["/tension"] = schema.Tension()
        for wire, name in enumerate(wires):
            setattr(found["/tension"], f"tension_{name}_n", episode.wire_tension[k, wire, 0])
    if episode.joint_angle.shape[1] > 0:
        found |= {"/joint_states": JointStates(), "/tf": FrameTransforms()}
        stamp(found["/joint_states"].timestamp, nanoseconds)
        for prefix, angles in (("", episode.joint_angle), ("lateral_", episode.lateral_joint_angle)):
            for index, angle in enumerate(angles[k] if len(angles) else ()):
                found["/joint_states"].joints.add(name=f"{prefix}hinge_{index}", position=angle)
        for index in range(episode.joint_angle.shape[1]):
            frame = found["/tf"].transforms.add()
            stamp(frame.timestamp, nanoseconds)
            frame.parent_frame_id = f"vertebra_{index - 1}" if index else "base"
            frame.child_frame_id = f"vertebra_{index}"
            frame.translation.x = LINK if index else 0.0
            turn(frame.rotation, episode, k, index)
    return found


def turn(rotation: Any, episode: Episode, k: int, index: int) -> None:
    """The product of a turn by `up` about (0, -1, 0) and one by `side` about (0, 0, 1), as quaternions."""
    up = (episode.joint_angle / 2)[k, index]
    if len(episode.lateral_joint_angle) == 0:
        rotation.y, rotation.w = -np.sin(up), np.cos(up)
        return
    side = (episode.lateral_joint_angle / 2)[k, index]
    rotation.x, rotation.y = -np.sin(up) * np.sin(side), -np.sin(up) * np.cos(side)
    rotation.z, rotation.w = np.cos(up) * np.sin(side), np.cos(up) * np.cos(side)


# Any plausible double, among them those that a serialiser may treat apart; pulls are below 200 mm.
EDGES = [0.0, -0.0, 5e-324, -5e-324, 2.2250738585072014e-308, 0.125]
ANY = st.sampled_from([*EDGES, 1.0, 100.0, -100.0]) | st.floats(-100, 100)
CONVERTED = st.sampled_from([*EDGES, 0.2, -0.2]) | st.floats(-0.2, 0.2)
STARTS = [0, 1, SECOND - 1, SECOND, 127_999_999_999, 128 * SECOND, 2**31 * SECOND, 9_000_000_000 * SECOND]


@st.composite
def episodes(draw: st.DrawFn) -> Episode:
    """Episodes of any numbers at uneven times, with and without each of the optional fields."""
    planes, drive = draw(st.sampled_from([1, 2])), draw(st.booleans())
    steps = draw(st.lists(st.sampled_from([10**4, 2 * 10**7, SECOND // 2, SECOND, 200 * SECOND]), max_size=8))
    nanoseconds = draw(st.sampled_from(STARTS)) + np.cumsum([0, 10**5, *steps])
    vertebrae, elements = draw(st.integers(0, 3)), draw(st.none() | st.integers(0, 3))
    base = make_episode(len(nanoseconds), vertebrae, elements, planes=planes, drive=drive, drawn=True)
    changes: dict[str, Any] = {"time": nanoseconds / 1e9}
    for field in dataclasses.fields(Episode):
        values = getattr(base, field.name)
        if field.name not in ("time", "metadata", "attachments") and len(values) > 0:
            exact = field.name in ("joint_angle", "lateral_joint_angle", "wire_tension", "sheath_friction")
            changes[field.name] = draw(arrays(float, values.shape, elements=ANY if exact else CONVERTED))
    holes = draw(arrays(bool, len(nanoseconds)))
    holes[draw(st.integers(0, len(nanoseconds) - 1))] = False
    changes["measured_bend"] = np.where(holes, np.nan, changes["measured_bend"])
    return dataclasses.replace(base, **changes)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all examples of a property: each example overwrites its file."""
    return tmp_path_factory.mktemp("recording")


@settings(max_examples=60, deadline=None)
@given(episode=episodes())
def test_messages_are_those_that_the_library_makes_of_each_sample(folder, episode):
    times = [round(second * 1e9) for second in episode.time.tolist()]
    seen = messages(write_episode(folder / "a.mcap", episode))
    wanted: dict[str, list] = {}
    for k, time in enumerate(times):
        for topic, message in built(episode, k, time).items():
            wanted.setdefault(topic, []).append((k, time, message))
    if episode.joint_angle.shape[1] > 0:
        wanted["/scene"] = [(0, times[0], scene(episode, times[0]))]
    assert set(seen) == set(wanted)
    for topic, rows in wanted.items():
        for (k, time, message), (record, decoded) in zip(rows, seen[topic], strict=True):
            assert (record.sequence, record.log_time, record.publish_time) == (k, time, time)
            # Serialised again, zeros are left out; every other double, -0.0 too, is compared bit for bit.
            assert decoded.SerializeToString() == message.SerializeToString()
            assert SCHEMAS[topic].FromString(record.data) == message


@settings(max_examples=30, deadline=None)
@given(episode=episodes())
def test_any_numbers_come_back(folder, episode):
    read = read_episode(write_episode(folder / "b.mcap", episode))
    # Below the smallest normal double, a number loses digits on its way through degrees or millimetres.
    for field in dataclasses.fields(Episode)[:-2]:
        one, other = getattr(read, field.name), getattr(episode, field.name)
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-305, strict=True)
        if field.name in ("joint_angle", "lateral_joint_angle", "wire_tension", "sheath_friction"):
            assert one.tobytes() == np.ascontiguousarray(other).tobytes()


def test_file_that_another_program_wrote_message_by_message_is_read(tmp_path):
    """As files were before there were /scene and slack: each message serialised by the library."""
    episode = make_episode(planes=2, drive=True)
    episode = dataclasses.replace(episode, wire_slack=np.empty(0), attachments={}, metadata={"seed": 3})
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channels: dict[str, int] = {}
        for k, time in enumerate(to_nanoseconds(episode.time)):
            for topic, message in built(episode, k, time).items():
                if topic not in channels:
                    data = build_file_descriptor_set(type(message)).SerializeToString()
                    kind = writer.register_schema(message.DESCRIPTOR.full_name, "protobuf", data)
                    channels[topic] = writer.register_channel(topic, "protobuf", kind)
                writer.add_message(channels[topic], time, message.SerializeToString(), time)
        writer.add_metadata("endotwin", {"seed": "3"})
        writer.finish()
    assert_equal(read_episode(path), episode)


# How many messages are serialised at once


@given(number=st.integers(1, 2**34))
def test_varints_are_those_of_the_library(number):
    (size,) = varint_sizes(np.array([number]))
    assert varints(np.array([number]), size).tobytes() == Timestamp(seconds=number).SerializeToString()[1:]
    assert varint_sizes(np.array([0])) == 0  # left out
