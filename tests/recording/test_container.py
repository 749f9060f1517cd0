"""The MCAP files by the public readers: chunks, indexes, the summary, and what is in front of what."""

import dataclasses
import functools
import io
import itertools
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import ReadDataStream
from mcap.reader import NonSeekingReader, SeekingReader, make_reader
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import breakup_chunk
from recorded import assert_equal, in_file_order, make_episode, of_kind, records_of

from twin.episode import Episode
from twin.recording import EpisodeWriter, read_episode, write_episode
from twin.recording import endotwin_pb2 as schema

SAMPLES = 900
CHUNK = 2**18  # [bytes]
SEEN_OFTEN = {"/command", "/truth", "/tension", "/joint_states", "/tf"}


@functools.cache
def long_episode() -> Episode:
    """Some chunks' worth of samples, from 127 s on, where the seconds of a time stamp become longer."""
    episode = make_episode(SAMPLES, 16, 10, start=120.0, planes=2, drive=True, drawn=True)
    measured = episode.measured_bend.copy()
    measured[np.random.default_rng(5).random(SAMPLES) < 0.1] = np.nan
    return dataclasses.replace(episode, measured_bend=measured)


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("recording") / "long.mcap"
    return write_episode(path, long_episode()).read_bytes()


def test_seeking_and_streaming_readers_give_the_same_in_the_order_of_the_file(content):
    streamed, seeking, flowing = (
        [(channel.topic, message) for channel, message in found]
        for found in (
            in_file_order(content),
            (found[1:] for found in SeekingReader(io.BytesIO(content), validate_crcs=True).iter_messages()),
            (
                found[1:]
                for found in NonSeekingReader(io.BytesIO(content), validate_crcs=True).iter_messages()
            ),
        )
    )
    assert seeking == streamed
    assert flowing == streamed
    holes = int(np.isnan(long_episode().measured_bend).sum())
    assert len(streamed) == SAMPLES * (len(SEEN_OFTEN) + 1) - holes + 1


@settings(max_examples=8, deadline=None)
@given(
    ends=st.lists(st.integers(-50, SAMPLES + 50), min_size=2, max_size=2).map(sorted),
    topics=st.sets(st.sampled_from(["/command", "/measurement", "/scene", "/tf"]), min_size=1),
)
def test_seeking_by_time_finds_exactly_the_messages_of_that_time(content, ends, topics):
    start, end = (120_000_000_000 + 20_000_000 * k - 1 for k in ends)
    reader = make_reader(io.BytesIO(content), validate_crcs=True)
    found = reader.iter_messages(topics=topics, starting_at=start, ending_before=end)
    wanted = [
        (channel.topic, message)
        for channel, message in in_file_order(content)
        if channel.topic in topics and start <= message.log_time < end
    ]
    assert [(channel.topic, message) for _, channel, message in found] == wanted


def test_chunks_hold_whole_samples_about_a_mebibyte_each(content):
    records = records_of(content)
    topics = {channel.id: channel.topic for channel in of_kind(records, Channel)}
    measured = np.isfinite(long_episode().measured_bend)
    chunks, sample = of_kind(records, Chunk), 0
    for chunk in chunks:
        inside = breakup_chunk(chunk, validate_crc=True)
        by_sample = itertools.groupby(inside, key=lambda message: message.log_time)
        for number, (time, messages) in enumerate(by_sample, start=sample):
            seen = {topics[message.channel_id] for message in messages}
            assert time == 120_000_000_000 + 20_000_000 * number
            once = {"/scene"} if number == 0 else set()
            assert seen == SEEN_OFTEN | ({"/measurement"} if measured[number] else set()) | once
        times = [message.log_time for message in inside]
        assert (chunk.message_start_time, chunk.message_end_time) == (times[0], times[-1])
        assert chunk.compression == "zstd"
        assert chunk.uncompressed_crc != 0
        sample = number + 1
    assert sample == SAMPLES
    assert len(chunks) >= 3
    sizes = np.array([chunk.uncompressed_size for chunk in chunks])
    row = sizes.sum() / SAMPLES
    assert (np.abs(sizes[:-1] - CHUNK) < 5 * row).all()  # the drawing is larger than a sample
    assert sizes[-1] < CHUNK + row


def test_message_indexes_point_at_each_message(content):
    records = records_of(content)
    indexes, indexed = of_kind(records, ChunkIndex), 0
    for chunk, listed in zip(of_kind(records, Chunk), indexes, strict=True):
        place = listed.chunk_start_offset
        stream = ReadDataStream(io.BytesIO(content[place + 9 : place + listed.chunk_length]))
        assert content[place] == 6  # the opcode of a chunk
        assert Chunk.read(stream) == chunk
        raw = zstandard.decompress(chunk.data, chunk.uncompressed_size)
        after = place + listed.chunk_length
        for channel, offset in listed.message_index_offsets.items():
            assert content[offset] == 7  # the opcode of a message index
            index = MessageIndex.read(ReadDataStream(io.BytesIO(content[offset + 9 :])))
            assert index.channel_id == channel
            assert offset == after
            after += 9 + int.from_bytes(content[offset + 1 : offset + 9], "little")
            for time, start in index.records:
                assert raw[start] == 5  # the opcode of a message
                length = int.from_bytes(raw[start + 1 : start + 9], "little")
                message = Message.read(ReadDataStream(io.BytesIO(raw[start + 9 :])), length)
                assert (message.channel_id, message.log_time) == (channel, time)
            assert index.records == sorted(index.records)
            indexed += len(index.records)
        assert after == place + listed.chunk_length + listed.message_index_length
    assert indexed == len(in_file_order(content))


def test_summary_counts_and_finds_everything(content):
    records = records_of(content)
    (statistics,) = of_kind(records, Statistics)
    counts = Counter(message.channel_id for _, message in in_file_order(content))
    assert statistics == Statistics(
        attachment_count=3,
        channel_count=7,
        channel_message_counts=dict(counts),
        chunk_count=len(of_kind(records, Chunk)),
        message_count=counts.total(),
        message_end_time=120_000_000_000 + 20_000_000 * (SAMPLES - 1),
        message_start_time=120_000_000_000,
        metadata_count=1,
        schema_count=7,
    )
    for kind in (Schema, Channel):  # once in front of the chunks, and once again
        described = of_kind(records, kind)
        assert described[7:] == described[:7]
    (footer,) = of_kind(records, Footer)
    place = footer.summary_start
    for group in of_kind(records, SummaryOffset):
        assert group.group_start == place
        while place < group.group_start + group.group_length:
            assert content[place] == group.group_opcode
            place += 9 + int.from_bytes(content[place + 1 : place + 9], "little")
        assert place == group.group_start + group.group_length
    assert place == footer.summary_offset_start
    assert footer.summary_crc != 0
    assert of_kind(records, DataEnd)[0].data_section_crc != 0
    assert of_kind(records, Header) == [Header(profile="", library="endotwin")]


@settings(max_examples=20, deadline=None)
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


@pytest.mark.parametrize("time", [-1, 2**63])
def test_message_of_no_possible_time_is_refused(tmp_path: Path, time: int):
    def write() -> None:
        with EpisodeWriter(tmp_path / "a.mcap") as writer:
            writer.write(make_episode())
            writer.add_message("/estimate/A", schema.Measurement(), time)

    with pytest.raises(ValueError, match=f"/estimate/A: time {time} ns: a log time is from 0 to"):
        write()
    assert list(tmp_path.iterdir()) == []
