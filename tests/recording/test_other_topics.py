"""Messages beside those of an episode: estimates and pictures, in chunks of their own."""

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Channel, Chunk
from mcap.stream_reader import breakup_chunk
from recorded import assert_equal, in_file_order, make_episode, of_kind, records_of

from twin.recording import EpisodeWriter, read_episode
from twin.recording import endotwin_pb2 as schema

CHUNK = 2**18  # [bytes]


@settings(max_examples=40, deadline=None)
@given(
    before=st.lists(st.tuples(st.sampled_from(["/estimate/A", "/estimate/B"]), st.integers(0, 400))),
    after=st.lists(st.tuples(st.sampled_from(["/estimate/B", "/estimate/C"]), st.integers(0, 400))),
)
def test_other_topics_go_into_chunks_of_their_own_in_the_order_of_time(tmp_path_factory, before, after):
    path = tmp_path_factory.getbasetemp() / "others.mcap"
    with EpisodeWriter(path) as writer:
        for number, (topic, time) in enumerate(before):
            writer.add_message(topic, schema.Measurement(measured_deg=number), time)
        writer.write(make_episode())
        for number, (topic, time) in enumerate(after, start=len(before)):
            writer.add_message(topic, schema.Measurement(measured_deg=number), time)
    content = path.read_bytes()
    found = [
        (channel.topic, message.log_time, schema.Measurement.FromString(message.data).measured_deg)
        for channel, message in in_file_order(content)
        if channel.topic.startswith("/estimate")
    ]
    given_order = [(topic, time, number) for number, (topic, time) in enumerate([*before, *after])]
    assert found == sorted(given_order, key=lambda row: row[1])
    others = {channel.id for channel in of_kind(records_of(content), Channel) if "estimate" in channel.topic}
    for chunk in of_kind(records_of(content), Chunk):
        assert len({record.channel_id in others for record in breakup_chunk(chunk)}) == 1
    for topic in ("/estimate/A", "/estimate/B", "/estimate/C"):
        messages = [message for channel, message in in_file_order(content) if channel.topic == topic]
        assert [message.sequence for message in messages] == list(range(len(messages)))
    reader = make_reader(io.BytesIO(content), validate_crcs=True)
    assert sum(1 for _ in reader.iter_messages()) == len(in_file_order(content))
    assert_equal(read_episode(path), make_episode())


def test_many_large_messages_fill_chunks(tmp_path):
    rng = np.random.default_rng(0)
    rows = [schema.Truth(wire_tension_a_n=rng.normal(size=10_000)) for _ in range(60)]
    with EpisodeWriter(tmp_path / "a.mcap") as writer:
        writer.write(make_episode())
        for time, row in enumerate(rows):
            writer.add_message("/estimate/rows", row, time)
    records = records_of((tmp_path / "a.mcap").read_bytes())
    sizes = [chunk.uncompressed_size for chunk in of_kind(records, Chunk)[1:]]
    assert len(sizes) == 15
    assert all(CHUNK <= size < CHUNK + 81_000 for size in sizes[:-1])


@pytest.mark.parametrize("time", [-1, 2**63])
def test_message_of_no_possible_time_is_refused(tmp_path: Path, time: int):
    def write() -> None:
        with EpisodeWriter(tmp_path / "a.mcap") as writer:
            writer.write(make_episode())
            writer.add_message("/estimate/A", schema.Measurement(), time)

    with pytest.raises(ValueError, match=f"/estimate/A: time {time} ns: a log time is from 0 to"):
        write()
    assert list(tmp_path.iterdir()) == []
