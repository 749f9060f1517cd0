"""The recording: what is written comes back, and no damage to a file passes unnoticed or unexplained."""

import contextlib
import csv
import dataclasses
import io
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, Footer, Header
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory

from twin.episode import Episode
from twin.recording import EpisodeWriter, read_dataset, read_episode, write_csv, write_episode
from twin.recording import endotwin_pb2 as schema
from twin.recording.messages import REQUIRED_TOPICS, SCHEMAS

MAGIC = b"\x89MCAP0\r\n"
LINK = 0.01  # [m] section_length / vertebrae of the preset below


def make_episode(
    samples: int = 12, vertebrae: int = 3, elements: int | None = 2, seed: int = 0, start: float = 0.0
) -> Episode:
    """Random numbers that use every digit of a double; `elements=None`: no load cells, as when measured."""
    rng = np.random.default_rng(seed)
    lengths, elements = (0, 0) if elements is None else (elements + 1, elements)
    return Episode(
        time=start + np.arange(samples) * 0.02,
        pull=rng.normal(scale=1e-3, size=samples),
        bend=rng.normal(size=samples),
        measured_bend=rng.normal(size=samples),
        joint_angle=rng.normal(size=(samples, vertebrae)),
        wire_tension=rng.normal(size=(samples, 2, lengths)),
        sheath_friction=rng.normal(size=(samples, 2, elements)),
        metadata={
            "seed": seed,
            "preset": {"name": "Öse", "vertebrae": vertebrae, "section_length": LINK * vertebrae},
            "versions": {"mujoco": "3.17", "strokes_mm": [2.0, 4.25]},
        },
        attachments={"endoscope.xml": b"<mujoco/>", "empty.bin": b"", "preset.yaml": bytes(range(256))},
    )


def assert_equal(read: Episode, written: Episode) -> None:
    for field in ("time", "pull", "bend", "measured_bend"):
        np.testing.assert_allclose(
            getattr(read, field), getattr(written, field), rtol=1e-12, atol=0, strict=True
        )
    for field in ("joint_angle", "wire_tension", "sheath_friction"):
        np.testing.assert_array_equal(getattr(read, field), getattr(written, field), strict=True)
    assert read.metadata == written.metadata
    assert read.attachments == written.attachments


def fault_of(path: Path) -> str:
    """What is said of a damaged file: one line that begins with its name."""
    with pytest.raises(ValueError, match="mcap") as caught:
        read_episode(path)
    assert type(caught.value) is ValueError
    text = str(caught.value)
    assert text.startswith(f"{path} ")
    assert len(text.splitlines()) == 1
    return text.removeprefix(f"{path} ")


def messages(path: Path) -> dict[str, list]:
    """Every message by topic as (record, decoded), by the public reader and the schemas inside the file."""
    result: dict[str, list] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            result.setdefault(channel.topic, []).append((message, decoded))
    return result


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all examples of a property: each example overwrites its file."""
    return tmp_path_factory.mktemp("recording")


@pytest.fixture(scope="module")
def whole(folder: Path) -> bytes:
    return write_episode(folder / "whole.mcap", make_episode()).read_bytes()


# What is written comes back


@settings(max_examples=60, deadline=None)
@given(
    samples=st.integers(2, 30),
    vertebrae=st.integers(0, 6),
    elements=st.none() | st.integers(0, 5),
    seed=st.integers(0, 2**32 - 1),
    start=st.sampled_from([0.0, 0.01, 1234.56]),
)
def test_round_trip(folder, samples, vertebrae, elements, seed, start):
    written = make_episode(samples, vertebrae, elements, seed, start)
    path = write_episode(folder / "round.mcap", written)
    assert_equal(read_episode(path), written)


@settings(max_examples=60, deadline=None)
@given(
    st.dictionaries(
        st.text(st.characters(codec="utf-8"), max_size=8),
        st.recursive(
            st.none()
            | st.booleans()
            | st.integers()
            | st.floats(allow_nan=False, allow_infinity=False)
            | st.text(),
            lambda inner: (
                st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
            ),
            max_leaves=6,
        ),
        max_size=4,
    ),
    st.dictionaries(st.text(st.characters(codec="utf-8"), max_size=8), st.binary(max_size=50), max_size=3),
)
def test_metadata_and_attachments_survive(folder, metadata, attachments):
    metadata = {name: value for name, value in metadata.items() if name != "preset"}
    written = dataclasses.replace(make_episode(2), metadata=metadata, attachments=attachments)
    assert_equal(read_episode(write_episode(folder / "meta.mcap", written)), written)


def test_numpy_numbers_in_metadata_are_plain_ones(tmp_path):
    written = dataclasses.replace(
        make_episode(), metadata={"seed": np.int64(7), "range": np.array([1.5, 2.5])}
    )
    assert read_episode(write_episode(tmp_path / "a.mcap", written)).metadata == {
        "seed": 7,
        "range": [1.5, 2.5],
    }


def test_same_episode_same_bytes(tmp_path, monkeypatch):
    episode = make_episode()
    shuffled = dataclasses.replace(
        episode,
        metadata=dict(reversed(episode.metadata.items())),
        attachments=dict(reversed(episode.attachments.items())),
    )
    first = write_episode(tmp_path / "a.mcap", episode).read_bytes()
    monkeypatch.setattr("time.time", lambda: 1e9)
    monkeypatch.setattr("time.time_ns", lambda: 10**18)
    assert write_episode(tmp_path / "b.mcap", shuffled).read_bytes() == first
    assert write_episode(tmp_path / "c.mcap", make_episode(seed=1)).read_bytes() != first


def test_dataset_is_in_the_order_of_names(tmp_path):
    for seed in (2, 0, 1):
        write_episode(tmp_path / f"episode_{seed:03}.mcap", make_episode(seed=seed))
    (tmp_path / "dataset.json").write_text("{}")
    (tmp_path / ".episode_009.mcap.partial").write_bytes(b"half")
    assert [episode.metadata["seed"] for episode in read_dataset(tmp_path)] == [0, 1, 2]
    assert [episode.metadata["seed"] for episode in read_dataset(tmp_path / "episode_001.mcap")] == [1]


# What others read


def test_an_independent_reader_sees_the_same(tmp_path):
    episode = make_episode(samples=40, start=1234.56)  # these times times 1e9 fall short of whole numbers
    seen = messages(write_episode(tmp_path / "a.mcap", episode))
    nanoseconds = [1_234_560_000_000 + 20_000_000 * k for k in range(40)]
    assert set(seen) == {"/command", "/truth", "/measurement", "/tension", "/joint_states", "/tf"}
    for rows in seen.values():
        assert [record.log_time for record, _ in rows] == nanoseconds
        assert [record.publish_time for record, _ in rows] == nanoseconds

    def column(topic, read):
        return [read(message) for _, message in seen[topic]]

    def field(topic, name):
        return column(topic, lambda message: getattr(message, name))

    np.testing.assert_allclose(field("/command", "pull_mm"), episode.pull * 1000, rtol=1e-12)
    np.testing.assert_allclose(field("/truth", "bend_deg"), np.rad2deg(episode.bend), rtol=1e-12)
    np.testing.assert_allclose(
        field("/measurement", "bend_deg"), np.rad2deg(episode.measured_bend), rtol=1e-12
    )
    for wire, name in enumerate("ab"):
        tension, friction = episode.wire_tension[:, wire], episode.sheath_friction[:, wire]
        np.testing.assert_array_equal(field("/tension", f"tension_{name}_n"), tension[:, 0])
        np.testing.assert_array_equal(field("/truth", f"wire_tension_{name}_n"), tension)
        np.testing.assert_array_equal(field("/truth", f"sheath_friction_{name}_n"), friction)
    angles = column("/joint_states", lambda m: [joint.position for joint in m.joints])
    np.testing.assert_array_equal(angles, episode.joint_angle)
    assert column("/joint_states", lambda m: [joint.name for joint in m.joints])[-1] == [
        "hinge_0",
        "hinge_1",
        "hinge_2",
    ]
    assert column("/joint_states", lambda m: m.timestamp.ToNanoseconds()) == nanoseconds


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


@pytest.mark.parametrize(
    ("episode", "topics"),
    [
        (make_episode(vertebrae=0, elements=None), set(REQUIRED_TOPICS)),
        (make_episode(vertebrae=0), {*REQUIRED_TOPICS, "/tension"}),
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


def test_generated_code_is_that_of_the_schema_file(tmp_path):
    protoc = pytest.importorskip("grpc_tools.protoc")
    committed = Path(schema.__file__)
    source = committed.with_name("endotwin.proto")
    assert protoc.main(["protoc", f"-I{source.parent}", f"--python_out={tmp_path}", str(source)]) == 0

    def descriptor(generated: Path) -> list[str]:
        return [line for line in generated.read_text().splitlines() if "AddSerializedFile" in line]

    assert len(descriptor(committed)) == 1
    assert descriptor(tmp_path / committed.name) == descriptor(committed)


# Written whole or not at all


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_exception_leaves_nothing(tmp_path, error):
    def fail_half_way() -> None:
        with EpisodeWriter(tmp_path / "a.mcap") as writer:
            writer.write(make_episode())
            assert [path.name for path in tmp_path.iterdir()] == [".a.mcap.partial"]
            raise error

    with pytest.raises(error):
        fail_half_way()
    assert list(tmp_path.iterdir()) == []


def test_exception_leaves_the_file_of_before(tmp_path):
    path = write_episode(tmp_path / "a.mcap", make_episode(seed=1))
    with pytest.raises(ValueError, match="is not JSON"):
        write_episode(path, dataclasses.replace(make_episode(), metadata={"seed": float("nan")}))
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
    assert read_episode(path).metadata["seed"] == 1


def test_block_without_a_whole_episode_leaves_nothing(tmp_path):
    def write(*episodes: Episode) -> None:
        with EpisodeWriter(tmp_path / "a.mcap") as writer:
            for episode in episodes:
                writer.write(episode)

    def write_heedlessly(episode: Episode) -> None:
        with EpisodeWriter(tmp_path / "a.mcap") as writer, contextlib.suppress(ValueError):
            writer.write(episode)

    late = dataclasses.replace(make_episode(), time=np.arange(12) * 1e-10)
    with pytest.raises(ValueError, match="no whole episode"):
        write()
    with pytest.raises(ValueError, match="no whole episode"):
        write_heedlessly(late)
    with pytest.raises(ValueError, match="one episode"):
        write(make_episode(), make_episode())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"time": np.arange(12) - 1.0}, "runs from -1 to 10 s"),
        ({"time": np.arange(12) * 1e9}, "0 to 9.2e9 s"),
        ({"time": np.arange(12) * 1e-10}, "sample 1 is less than 1 ns"),
        ({"wire_tension": np.zeros((12, 3, 1))}, r"wire_tension has shape \(12, 3, 1\)"),
        ({"joint_angle": np.zeros(12)}, r"must be \(N, vertebrae\)"),
        ({"joint_angle": np.zeros((12, 5))}, "joint_angle has 5 columns, the preset 3 vertebrae"),
        ({"metadata": {"when": object()}}, "metadata 'when' is not JSON: a object cannot be stored"),
    ],
)
def test_episode_that_does_not_fit_is_refused(tmp_path, changes, fault):
    with pytest.raises(ValueError, match=fault):
        write_episode(tmp_path / "a.mcap", dataclasses.replace(make_episode(), **changes))
    assert list(tmp_path.iterdir()) == []


def test_other_topics_are_passed_over(tmp_path):
    with EpisodeWriter(tmp_path / "a.mcap") as writer:
        writer.write(make_episode())
        writer.add_message("/estimate/EKF", schema.Measurement(bend_deg=12.5), 40_000_000)
    assert_equal(read_episode(tmp_path / "a.mcap"), make_episode())
    ((record, estimate),) = messages(tmp_path / "a.mcap")["/estimate/EKF"]
    assert (record.log_time, record.publish_time, estimate.bend_deg) == (40_000_000, 40_000_000, 12.5)


# Damage is named


@settings(max_examples=150, deadline=None)
@given(part=st.floats(0, 1, exclude_max=True))
def test_cut_file_is_said_to_be_cut(folder, whole, part):
    path = folder / "cut.mcap"
    path.write_bytes(whole[: int(part * len(whole))])
    assert fault_of(path).startswith("is cut off: ")


@settings(max_examples=400, deadline=None)
@given(data=st.data())
def test_flipped_bit_never_changes_an_episode(folder, whole, data):
    damaged = bytearray(whole)
    bit = data.draw(st.integers(0, 8 * len(whole) - 1))
    damaged[bit // 8] ^= 1 << bit % 8
    path = folder / "flip.mcap"
    path.write_bytes(damaged)
    try:
        episode = read_episode(path)
    except ValueError:
        fault_of(path)
    else:
        assert_equal(episode, make_episode())


@settings(max_examples=200, deadline=None)
@given(
    flips=st.lists(
        st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=2, max_size=20
    ),
    tail=st.binary(max_size=40),
)
def test_any_bytes_give_an_episode_or_a_value_error(folder, whole, flips, tail):
    damaged = bytearray(whole)
    for place, value in flips:
        damaged[int(place * len(whole))] = value
    path = folder / "fuzz.mcap"
    for content in (bytes(damaged), MAGIC + tail + MAGIC, tail, whole + tail + MAGIC):
        path.write_bytes(content)
        try:
            assert isinstance(read_episode(path), Episode)
        except ValueError:
            fault_of(path)


def rewrite(source: bytes, path: Path, edit) -> Path:
    """Write a file again with whole CRCs; `edit(topic, index, data)` gives new data, or None for none."""
    reader = make_reader(io.BytesIO(source))
    counts: dict[str, int] = {}
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channels: dict[str, int] = {}
        for kind, channel, message in reader.iter_messages():
            index = counts.get(channel.topic, 0)
            counts[channel.topic] = index + 1
            data = edit(channel.topic, index, message.data)
            if data is None:
                continue
            if channel.topic not in channels:
                schema_id = writer.register_schema(kind.name, kind.encoding, kind.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema_id)
            writer.add_message(channels[channel.topic], message.log_time, data, message.publish_time)
        for record in reader.iter_metadata():
            items = {name: edit("metadata", name, text) for name, text in record.metadata.items()}
            if None not in items.values():
                writer.add_metadata(record.name, items)
        writer.finish()
    return path


def change(topic, index, new):
    """An edit of one message (or of all, with `index=None`), or of one item of metadata."""
    return lambda at, k, data: new if at == topic and index in (k, None) else data


NAN = schema.Truth(bend_deg=float("nan")).SerializeToString()
SHORT = schema.Truth(wire_tension_a_n=[1.0]).SerializeToString()
UNEVEN = schema.Truth(wire_tension_a_n=[1.0, 2.0]).SerializeToString()


@pytest.mark.parametrize(
    ("edit", "fault"),
    [
        *((change(topic, None, None), f"topic {topic} is missing") for topic in REQUIRED_TOPICS),
        *(
            (change(topic, 4, None), f"topic {topic} has 11 messages, /command has 12")
            for topic in SCHEMAS
            if topic != "/command"
        ),
        (
            lambda topic, k, data: None if k == 3 + (topic == "/truth") else data,
            "/truth are not at the times",
        ),
        (change("/truth", 0, SHORT), "wire_tension_a_n has 3 values at sample 1, 1 at sample 0"),
        (change("/truth", None, UNEVEN), "wire_tension_a_n has 2 columns, wire_tension_b_n has 0"),
        (change("/command", 5, b"\xff\xff"), "DecodeError"),
        (change("metadata", "seed", "{"), "metadata 'seed' is not JSON"),
        (change("metadata", "seed", "NaN"), "metadata 'seed' is not JSON: NaN is not a number"),
        (change("metadata", "seed", "[" * 100_000), "RecursionError"),
        (change("metadata", "seed", None), "metadata record 'endotwin' is missing"),
    ],
)
def test_what_is_wrong_inside_a_sound_file_is_named(tmp_path, whole, edit, fault):
    text = fault_of(rewrite(whole, tmp_path / "a.mcap", edit))
    assert text.startswith("holds no whole episode: ")
    assert fault in text


def test_not_a_number_is_named_by_field_and_sample(tmp_path):
    bare = write_episode(tmp_path / "a.mcap", make_episode(vertebrae=0, elements=None)).read_bytes()
    path = rewrite(bare, tmp_path / "b.mcap", change("/truth", 7, NAN))
    assert fault_of(path) == "holds no whole episode: bend is not finite at sample 7"


@settings(max_examples=100, deadline=None)
@given(topic=st.sampled_from([*SCHEMAS]), index=st.integers(0, 11), data=st.binary(max_size=60))
def test_any_payload_gives_an_episode_or_a_value_error(folder, whole, topic, index, data):
    path = rewrite(whole, folder / "payload.mcap", change(topic, index, data))
    try:
        assert isinstance(read_episode(path), Episode)
    except ValueError:
        fault_of(path)


def test_topic_of_another_schema_is_refused(tmp_path):
    path = tmp_path / "a.mcap"
    with EpisodeWriter(path) as writer:
        writer.add_message("/command", schema.Measurement(bend_deg=1.0), 0)
        writer.write(make_episode())
    assert "topic /command has 'protobuf' messages of schema endotwin.Measurement" in fault_of(path)


@pytest.mark.parametrize(
    ("compression", "size", "fault"),
    [("zstd", 2**40, "claims 1099511627776 bytes"), ("lzma", 10, "compressed by 'lzma'")],
)
def test_absurd_chunk_is_refused_before_it_is_unpacked(tmp_path, compression, size, fault):
    builder = RecordBuilder()
    Header("", "").write(builder)
    Chunk(compression, b"\x28\xb5\x2f\xfd\x00\x00\x01\x00\x00", 0, 0, 0, size).write(builder)
    DataEnd(0).write(builder)
    Footer(0, 0, 0).write(builder)
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + builder.end() + MAGIC)
    assert fault in fault_of(path)


def test_record_longer_than_the_file_is_damage(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + b"\x01" + (2**31).to_bytes(8, "little") + bytes(8) + MAGIC)
    assert fault_of(path).startswith("is damaged: ")


def test_damaged_summary_is_noticed(tmp_path, whole):
    damaged = bytearray(whole)
    damaged[whole.rindex(b"/measurement") + 1] ^= 1
    path = tmp_path / "a.mcap"
    path.write_bytes(damaged)
    assert fault_of(path) == "is damaged: the CRC of the summary does not match"


def test_file_of_another_kind_is_named(tmp_path):
    assert fault_of(write_csv(tmp_path / "a.mcap", make_episode())).startswith("is not an MCAP file")
    (tmp_path / "b.mcap").mkdir()
    assert fault_of(tmp_path / "b.mcap") == "is a folder, not an MCAP file"


def test_missing_files_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no file .*a\.mcap"):
        read_episode(tmp_path / "a.mcap")
    with pytest.raises(FileNotFoundError, match="no file"):
        read_dataset(tmp_path / "nothing")
    with pytest.raises(FileNotFoundError, match=r"no \*\.mcap file in"):
        read_dataset(tmp_path)
    with pytest.raises(FileNotFoundError, match="no folder"):
        write_episode(tmp_path / "nothing" / "a.mcap", make_episode())
