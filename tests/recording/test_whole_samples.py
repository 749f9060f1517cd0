"""Which samples of a damaged file are whole, and in which order."""

import dataclasses
import struct

import mutated
import numpy as np
import pytest
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mutated import CHUNK, MAGIC
from recorded import make_episode
from recovering import (
    EPISODE,
    SPLIT,
    STEP,
    check,
    messages_of_chunks,
    offsets,
    recover,
    samples_of,
)

from twin.recording import endotwin_pb2 as schema
from twin.recording import read_episode


def test_swapped_and_repeated_chunks_are_put_in_order(tmp_path):
    parts = mutated.records(SPLIT)
    places = [index for index, part in enumerate(parts) if part[0] == CHUNK]
    parts[places[2]], parts[places[4]] = parts[places[4]], parts[places[2]]
    parts.insert(places[5], parts[places[1]])
    (tmp_path / "a.mcap").write_bytes(MAGIC + b"".join(parts))
    with pytest.raises(ValueError, match="damaged"):
        read_episode(tmp_path / "a.mcap")
    found = recover(tmp_path / "a.mcap", MAGIC + b"".join(parts))
    assert "at the time of another on the same topic" in found.summary
    check(found, list(range(60)), found.samples_expected)


def test_first_of_two_messages_at_a_time_is_the_one_that_counts(tmp_path):
    """As the second one is what does not belong there."""
    parts = mutated.records(SPLIT)
    other = mutated.chunk(mutated.message(1, 20 * STEP, schema.Command(pull_mm=99.0).SerializeToString()))
    last = max(index for index, part in enumerate(parts) if part[0] == CHUNK)
    parts.insert(last + 1, other)
    found = recover(tmp_path / "a.mcap", MAGIC + b"".join(parts))
    assert found.faults[0] == "1 message at the time of another on the same topic: left out"
    check(found, list(range(60)), None)  # the summary is not where it says


def test_samples_within_a_lost_chunk_of_measurements_are_not_whole(tmp_path):
    """A writer may give each topic chunks of its own: nothing else of these samples is missing."""
    others = mutated.records(mutated.rewritten(EPISODE, lambda topic, _: topic != "/measurement"))
    angles = EPISODE.measured_deg.tolist()
    messages = [
        mutated.message(99, k * STEP, schema.Measurement(measured_deg=angle).SerializeToString())
        for k, angle in enumerate(angles)
    ]
    halves = [
        mutated.chunk(
            b"".join(messages[first : first + 30]), times=struct.pack("<QQ", first * STEP, end * STEP)
        )
        for first, end in ((0, 29), (30, 59))
    ]
    halves[1] = halves[1][:33] + b"\1\2\3\4" + halves[1][37:]  # the CRC
    builder = RecordBuilder()
    Schema(id=99, data=b"", encoding="protobuf", name="endotwin.Measurement").write(builder)
    Channel(99, "/measurement", "protobuf", {}, 99).write(builder)
    found = recover(tmp_path / "a.mcap", MAGIC + b"".join([others[0], builder.end(), *halves, *others[1:]]))
    check(found, list(range(30)), None)


def test_missing_measurements_are_believed_only_away_from_what_is_lost(tmp_path):
    """A chunk ends after /truth of sample 20, and /measurement is the last topic: sample 20 is not whole."""
    measured = np.where(np.isin(np.arange(60), [3, 45]), np.nan, EPISODE.measured_bend)
    bare = make_episode(60, vertebrae=0, elements=None)
    bare = dataclasses.replace(bare, measured_bend=measured)
    data = mutated.rewritten(bare, chunk_size=400)
    chunks = messages_of_chunks(data)
    split = next(
        index
        for index, chunk in enumerate(chunks)
        if index > 3 and samples_of(chunk, "/truth")[-1] not in samples_of(chunk, "/measurement")
    )
    last = samples_of(chunks[split], "/truth")[-1]
    found = recover(tmp_path / "a.mcap", data[: offsets(data, CHUNK)[split + 1] + 20])
    assert found.samples == last
    assert np.flatnonzero(np.isnan(found.episode.measured_bend)).tolist() == [3]
    check(found, list(range(last)), None, bare)
