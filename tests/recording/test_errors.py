"""No damage to a file passes unnoticed or unexplained."""

import dataclasses
import io
from pathlib import Path

import mutated
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer
from mutated import MAGIC
from recorded import assert_equal, make_episode

from twin.episode import Episode
from twin.errors import InputError
from twin.recording import EpisodeWriter, read_dataset, read_episode, read_metadata, write_csv, write_episode
from twin.recording import endotwin_pb2 as schema
from twin.recording.messages import SCHEMAS, required_topics
from twin.recording.reader import HINT, TOPICS

REQUIRED_TOPICS = required_topics(measured=False)


def fault_of(path: Path) -> str:
    """What is said of a damaged file: one line that begins with its name."""
    with pytest.raises(ValueError, match="mcap") as caught:
        read_episode(path)
    assert type(caught.value) is InputError
    text = str(caught.value)
    assert text.startswith(f"{path} ")
    assert len(text.splitlines()) == 1
    return text.removeprefix(f"{path} ")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all examples of a property: each example overwrites its file."""
    return tmp_path_factory.mktemp("recording")


@pytest.fixture(scope="module")
def whole(folder: Path) -> bytes:
    return write_episode(folder / "whole.mcap", make_episode()).read_bytes()


@settings(max_examples=60, deadline=None)
@given(part=st.floats(0, 1, exclude_max=True))
def test_cut_file_is_said_to_be_cut(folder, whole, part):
    path = folder / "cut.mcap"
    path.write_bytes(whole[: int(part * len(whole))])
    fault = fault_of(path)
    assert fault == "is cut off: it is empty" or (fault.startswith("is cut off: ") and fault.endswith(HINT))


@settings(max_examples=150, deadline=None)
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


NAN = schema.Truth(truth_deg=float("nan")).SerializeToString()
SHORT = schema.Truth(wire_tension_a_n=[1.0]).SerializeToString()
UNEVEN = schema.Truth(wire_tension_a_n=[1.0, 2.0]).SerializeToString()


@pytest.mark.parametrize(
    ("edit", "fault"),
    [
        *((change(topic, None, None), f"topic {topic} is missing") for topic in REQUIRED_TOPICS),
        *(
            (change(topic, 4, None), f"topic {topic} has 11 messages, /command has 12")
            for topic in sorted(TOPICS - {"/command", "/measurement"})
        ),
        (
            lambda topic, k, data: None if k == 4 and topic not in ("/measurement", "metadata") else data,
            "the messages of /measurement are not at the times of those of /command",
        ),
        (
            lambda topic, k, data: None if k == 3 + (topic == "/truth") else data,
            "/truth are not at the times",
        ),
        (change("/truth", 0, SHORT), "wire_tension_a_n has 3 values at sample 1, 1 at sample 0"),
        (change("/truth", None, UNEVEN), "wire_tension_a_n has 2 columns, wire_tension_b_n has 0"),
        (change("/command", 5, b"\xff\xff"), "DecodeError"),
        (change("metadata", "seed", "{"), "metadata 'seed' is not JSON"),
        (change("metadata", "seed", "NaN"), "metadata 'seed' holds NaN, which is no number"),
        (change("metadata", "seed", "-1e999"), "metadata 'seed' holds -1e999, which is beyond the largest"),
        (change("metadata", "seed", "[" * 100_000), "metadata 'seed' is nested too deeply"),
        (change("metadata", "seed", None), "metadata record 'endotwin' is missing"),
    ],
)
def test_what_is_wrong_inside_a_sound_file_is_named(tmp_path, whole, edit, fault):
    text = fault_of(rewrite(whole, tmp_path / "a.mcap", edit))
    assert text.startswith("holds no whole episode: ")
    assert fault in text


def test_a_measurement_that_another_program_wrote_as_nan_is_missing(tmp_path, whole):
    nan = schema.Measurement(measured_deg=float("nan")).SerializeToString()
    measured = make_episode().measured_bend.copy()
    measured[5] = np.nan
    wanted = dataclasses.replace(make_episode(), measured_bend=measured, attachments={})
    for data in (nan, None):
        edited = rewrite(whole, tmp_path / "a.mcap", change("/measurement", 5, data))
        assert_equal(read_episode(edited), wanted)


def test_not_a_number_is_named_by_field_and_sample(tmp_path):
    bare = write_episode(tmp_path / "a.mcap", make_episode(vertebrae=0, elements=None)).read_bytes()
    path = rewrite(bare, tmp_path / "b.mcap", change("/truth", 7, NAN))
    assert fault_of(path) == "holds no whole episode: bend is not finite at sample 7"


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        (schema.Command(pull_mm=1e39), "pull_mm = 1e+39 at sample 3: must be from -200 to 200 mm"),
        (schema.Truth(truth_deg=-1e300), "truth_deg = -1e+300 at sample 3: must be from -7200 to 7200 deg"),
        (schema.Measurement(measured_deg=1e39), "measured_deg = 1e+39 at sample 3: must be from -1e+06 to"),
    ],
)
def test_implausible_numbers_are_named_although_checksums_are_valid(tmp_path, message, fault):
    bare = write_episode(tmp_path / "a.mcap", make_episode(vertebrae=0, elements=None)).read_bytes()
    topic = next(topic for topic, kind in SCHEMAS.items() if kind is type(message))
    path = rewrite(bare, tmp_path / "b.mcap", change(topic, 3, message.SerializeToString()))
    assert fault in fault_of(path)


def test_what_could_not_be_read_is_not_written(tmp_path):
    episode = dataclasses.replace(make_episode(), pull=np.linspace(0.0, 0.3, 12))
    with pytest.raises(InputError, match=r"pull_mm = 218\.182 at sample 8: must be"):
        write_episode(tmp_path / "far.mcap", episode)
    assert not any(tmp_path.iterdir())


@settings(max_examples=50, deadline=None)
@given(topic=st.sampled_from([*SCHEMAS]), index=st.integers(0, 11), data=st.binary(max_size=60))
def test_any_payload_gives_an_episode_or_a_value_error(folder, whole, topic, index, data):
    path = rewrite(whole, folder / "payload.mcap", change(topic, index, data))
    try:
        assert isinstance(read_episode(path), Episode)
    except ValueError:
        fault_of(path)


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


@settings(max_examples=60, deadline=None)
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


def test_topic_of_another_schema_is_refused(tmp_path):
    path = tmp_path / "a.mcap"
    with EpisodeWriter(path) as writer:
        writer.add_message("/command", schema.Measurement(measured_deg=1.0), 0)
        writer.write(make_episode())
    assert "topic /command has 'protobuf' messages of schema endotwin.Measurement" in fault_of(path)


def test_record_longer_than_the_file_is_cut_off(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + b"\x01" + (2**31).to_bytes(8, "little") + bytes(8) + MAGIC)
    assert fault_of(path).startswith("is cut off: a record claims ")


@pytest.mark.parametrize(
    ("inserted", "fault"),
    [
        (mutated.chunk(bytes(8)), "error: unpack"),
        (mutated.chunk(mutated.record(200, b"12")[:-1]), "a record claims 2 bytes: 1 are left"),
        (mutated.chunk(mutated.message(99, 0, b"")), "a message is on channel 99, which is not described"),
        (mutated.described(1, "/other") + mutated.described(1, "/more"), "channel 1 is described twice"),
        (mutated.described(99, "/other")[:-1] + b"\1", "is cut off: a record claims"),
    ],
)
def test_records_that_do_not_belong_together_are_named(tmp_path, whole, inserted, fault):
    header, *parts = mutated.records(whole)
    path = tmp_path / "a.mcap"
    path.write_bytes(mutated.without_crcs(MAGIC + b"".join([header, inserted, *parts])))
    for function in (read_episode, read_metadata):
        with pytest.raises(ValueError, match=fault) as caught:
            function(path)
        assert str(caught.value).startswith(f"{path} is ")


def test_metadata_of_a_damaged_file_is_not_read(tmp_path, whole):
    path = tmp_path / "a.mcap"
    for place in range(0, whole.rindex(bytes([15, 4, 0, 0, 0, 0, 0, 0, 0])), 97):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        texts = []
        for function in (read_metadata, read_episode):
            with pytest.raises(ValueError, match="mcap") as caught:
                function(path)
            texts.append(str(caught.value))
        assert texts[0] == texts[1]
