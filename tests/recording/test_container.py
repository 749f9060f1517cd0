"""The MCAP files by the public readers: chunks, indexes, the summary, and what is in front of what."""

import contextlib
import dataclasses
import functools
import io
import itertools
from collections import Counter

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import ReadDataStream
from mcap.reader import NonSeekingReader, SeekingReader, make_reader
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Metadata,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import StreamReader, breakup_chunk
from recorded import assert_equal, in_file_order, make_episode, of_kind, records_of

from twin.episode import Episode
from twin.recording import read_episode, write_episode

SAMPLES = 1200
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


@settings(max_examples=25, deadline=None)
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


def test_where_it_comes_from_and_what_it_is_stands_in_front_of_the_first_chunk(content):
    kinds = [type(record) for record in records_of(content)]
    first = kinds.index(Chunk)
    assert kinds[:first] == [
        Header,
        Metadata,
        *[Attachment] * 3,
        *[Schema, Channel] * 7,
    ]
    end = kinds.index(DataEnd)
    assert set(kinds[first:end]) == {Chunk, MessageIndex}


@settings(max_examples=30, deadline=None)
@given(part=st.floats(0, 1))
def test_file_cut_after_its_first_chunk_is_still_understood(content, part):
    records = records_of(content)
    indexes, reader = of_kind(records, ChunkIndex), make_reader(io.BytesIO(content))
    first_end = indexes[0].chunk_start_offset + indexes[0].chunk_length
    cut = content[: first_end + int(part * (len(content) - first_end))]
    found: list[tuple[str, str, Message]] = []
    channels, schemas, metadata, attachments = {}, {}, [], {}
    with contextlib.suppress(Exception):  # the library has many words for an end that comes too early
        for record in StreamReader(io.BytesIO(cut)).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record.topic, schemas[record.schema_id].name
            elif isinstance(record, Message):
                found.append((*channels[record.channel_id], record))
            elif isinstance(record, Metadata):
                metadata.append(record)
            elif isinstance(record, Attachment):
                attachments[record.name] = record.data
    whole = sum(index.chunk_start_offset + index.chunk_length <= len(cut) for index in indexes)
    end = indexes[whole - 1].message_end_time
    wanted = [
        (channel.topic, kind.name, message) for kind, channel, message in reader.iter_messages(ending_at=end)
    ]
    assert found[: len(wanted)] == wanted
    assert metadata == list(reader.iter_metadata())
    assert attachments == long_episode().attachments


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


def test_same_long_episode_same_bytes(tmp_path, content):
    assert write_episode(tmp_path / "again.mcap", long_episode()).read_bytes() == content


def test_more_samples_than_are_serialised_at_once_are_numbered_on(tmp_path):
    written = make_episode(2**13 + 100, vertebrae=0, elements=None)
    path = write_episode(tmp_path / "a.mcap", written)
    found = [message for channel, message in in_file_order(path.read_bytes()) if channel.topic == "/command"]
    assert [message.sequence for message in found] == list(range(2**13 + 100))
    assert_equal(read_episode(path), written)
