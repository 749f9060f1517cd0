"""Of a damaged file, all that is whole comes back, nothing else, and it is said how much is missing."""

import dataclasses
import json
import os
import struct
import tracemalloc

import mutated
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType
from mutated import CHUNK, MAGIC
from recorded import assert_equal, make_episode
from recovering import (
    EPISODE,
    SPLIT,
    check,
    lengths,
    messages_of_chunks,
    offsets,
    recover,
    whole_samples,
)

from twin.recording import read_episode, recover_episode, write_episode

METADATA, ATTACHMENT = 12, 9


@pytest.mark.parametrize("base", mutated.bases())
def test_whole_file_is_read_as_ever(tmp_path, base):
    found = recover(tmp_path / "a.mcap", base.data)
    assert_equal(found.episode, read_episode(tmp_path / "a.mcap"))
    assert found.faults == ()
    assert found.samples == found.samples_expected == len(base.episode.time)
    assert found.chunks == len(offsets(base.data, CHUNK))
    assert found.chunks_lost == 0
    seconds = len(base.episode.time) * 0.02
    assert found.seconds == pytest.approx(seconds)
    count = len(base.episode.time)
    assert found.summary == f"{count} of {count} samples ({seconds:.1f} of {seconds:.1f} s) are whole"


@settings(max_examples=80, deadline=None)
@given(place=st.floats(0, 1, exclude_max=True))
def test_file_cut_anywhere_gives_its_whole_chunks(tmp_path_factory, place):
    cut = int(place * len(SPLIT))
    chunks = messages_of_chunks(SPLIT)
    ends = [
        start + length for start, length in zip(offsets(SPLIT, CHUNK), lengths(SPLIT, CHUNK), strict=True)
    ]
    lost = {index for index, end in enumerate(ends) if end > cut}
    samples = whole_samples(chunks, lost)
    path = tmp_path_factory.getbasetemp() / "cut.mcap"
    if len(samples) < 2:
        with pytest.raises(ValueError, match="is cut off: ") as caught:
            recover(path, SPLIT[:cut])
        assert str(caught.value).startswith(f"{path} ")
        return
    (end_of_data,) = offsets(SPLIT, mutated.DATA_END)
    complete = cut >= end_of_data + 13
    found = recover(path, SPLIT[:cut])
    check(found, samples, 60 if complete else None)
    assert found.chunks == len(ends) - len(lost)
    assert found.chunks_lost == (0 if complete else None)


def test_cut_is_said_in_one_sentence(tmp_path):
    start = offsets(SPLIT, CHUNK)[3]
    found = recover(tmp_path / "a.mcap", SPLIT[: start + 40])
    count = found.samples
    assert found.summary == (
        f"{count} samples ({count * 0.02:.1f} s) are whole of an unknown number; cut off in chunk 4; "
        "1 sample without all topics: left out"
    )
    found = recover(tmp_path / "a.mcap", SPLIT[:start])
    assert "; cut off after chunk 3" in found.summary


def test_number_of_samples_that_the_metadata_tells_is_expected(tmp_path):
    episode = dataclasses.replace(EPISODE, metadata={"samples": 60})
    data = mutated.rewritten(episode, chunk_size=4000)
    found = recover(tmp_path / "a.mcap", data[: offsets(data, CHUNK)[4]])
    assert found.samples_expected == 60
    assert found.summary.startswith(
        f"{found.samples} of 60 samples ({found.seconds:.1f} of 1.2 s) are whole; "
    )
    for wrong in (3, -1, 2**70, "60", True):
        data = mutated.rewritten(EPISODE, metadata={"samples": json.dumps(wrong)}, chunk_size=4000)
        assert recover(tmp_path / "a.mcap", data[: offsets(data, CHUNK)[4]]).samples_expected is None


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_damaged_chunks_leave_gaps(tmp_path_factory, data):
    chunks = messages_of_chunks(SPLIT)
    lost = data.draw(st.sets(st.integers(0, len(chunks) - 1), min_size=1, max_size=4))
    damaged = bytearray(SPLIT)
    for index in lost:
        body = 9 + lengths(SPLIT, CHUNK)[index] - 60
        damaged[offsets(SPLIT, CHUNK)[index] + 60 + data.draw(st.integers(0, body - 60))] ^= 0xFF
    samples = whole_samples(chunks, lost)
    if len(samples) < 2:
        return
    found = recover(tmp_path_factory.getbasetemp() / "gaps.mcap", bytes(damaged))
    check(found, samples, 60)
    assert found.chunks_lost == len(lost)


@pytest.mark.parametrize("value", [0, 1, 2**31, 2**60, 2**64 - 1])
@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.NONE])
def test_nonsense_length_costs_nothing_where_the_summary_is_whole(tmp_path, value, compression):
    data = mutated.rewritten(EPISODE, chunk_size=4000, compression=compression)
    start = offsets(data, CHUNK)[3]
    damaged = data[: start + 1] + struct.pack("<Q", value) + data[start + 9 :]
    found = recover(tmp_path / "a.mcap", damaged)
    check(found, list(range(60)), 60)
    assert found.chunks_lost == 0


def test_bytes_put_in_or_left_out_cost_the_chunk_they_are_in(tmp_path):
    chunks, start = messages_of_chunks(SPLIT), offsets(SPLIT, CHUNK)[3] + 500
    for damaged in (SPLIT[:start] + b"surplus" + SPLIT[start:], SPLIT[:start] + SPLIT[start + 100 :]):
        found = recover(tmp_path / "a.mcap", damaged)
        check(found, whole_samples(chunks, {3}), None)  # what the summary says is of other places
        assert found.chunks == len(chunks) - 1


def test_run_of_zeros_is_passed_over(tmp_path):
    """As where a disk was written to, but not all of it, when the power went."""
    starts = offsets(SPLIT, CHUNK)
    damaged = SPLIT[: starts[3]] + bytes(starts[5] - starts[3]) + SPLIT[starts[5] :]
    found = recover(tmp_path / "a.mcap", damaged)
    check(found, whole_samples(messages_of_chunks(SPLIT), {3, 4}), 60)
    assert found.chunks_lost == 2
    hole = f"bytes {starts[3]} to {starts[5]} hold no whole record: no record has opcode 0"
    assert found.faults[0] == hole


def test_zeros_behind_all_that_is_whole_take_no_memory(tmp_path):
    """As where a file system had given the file its size before the power went."""
    path = tmp_path / "a.mcap"
    path.write_bytes(SPLIT[: offsets(SPLIT, CHUNK)[3]])
    os.truncate(path, 2**31)
    tracemalloc.start()
    found = recover_episode(path)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    chunks = messages_of_chunks(SPLIT)
    check(found, whole_samples(chunks, {*range(3, len(chunks))}), None)
    assert found.chunks == 3
    assert most < 2**26


def test_damaged_attachment_is_left_out(tmp_path):
    data = bytearray(SPLIT)
    data[data.index(b"<mujoco/>")] ^= 1
    found = recover(tmp_path / "a.mcap", bytes(data))
    assert sorted(found.episode.attachments) == ["empty.bin", "preset.yaml"]
    assert found.faults == (f"attachment at byte {offsets(SPLIT, ATTACHMENT)[1]}: its CRC does not match",)
    assert found.samples == found.samples_expected == 60


def test_damaged_item_of_the_metadata_is_left_out(tmp_path):
    text = b'{"mujoco": "3.17"'
    assert SPLIT.count(text) == 1
    found = recover(tmp_path / "a.mcap", SPLIT.replace(text, b"[" + text[1:]))
    assert sorted(found.episode.metadata) == ["preset", "recovered", "seed"]
    assert found.faults[0].startswith("metadata 'versions' is not JSON: ")


def test_nothing_to_recover_is_said_in_one_line(tmp_path):
    path = tmp_path / "a.mcap"
    parts = mutated.records(SPLIT)
    for data, reason in (
        (b"time_s,pull_mm", "is not an MCAP file"),
        (b"", "is cut off: it is empty"),
        (MAGIC, "nothing can be recovered: metadata record 'endotwin' is missing"),
        (
            MAGIC + b"".join(part for part in parts[:-2] if part[0] != METADATA),
            "record 'endotwin' is missing",
        ),
        (
            SPLIT[: offsets(SPLIT, CHUNK)[0]],
            "nothing can be recovered: no message of topic /command is whole",
        ),
        (
            mutated.rewritten(EPISODE, lambda _, time: time == 0),
            "holds no whole episode: a record needs at least 2 samples, got 1",
        ),
    ):
        with pytest.raises(ValueError, match=reason) as caught:
            recover(path, data)
        assert str(caught.value).startswith(f"{path} ")
        assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(FileNotFoundError, match="no file"):
        recover_episode(tmp_path / "b.mcap")


def test_what_endotwin_writes_loses_no_more_than_the_chunk_that_is_cut(tmp_path):
    """Its chunks hold whole samples, so no sample beside them is lost."""
    episode = make_episode(4000)
    data = write_episode(tmp_path / "a.mcap", episode).read_bytes()
    starts, chunks = offsets(data, CHUNK), messages_of_chunks(data)
    assert len(starts) >= 3
    for index in range(1, len(starts)):
        found = recover(tmp_path / "b.mcap", data[: starts[index] + 100])
        count = len({sample for chunk in chunks[:index] for _, sample in chunk})
        assert found.samples == count == len(found.episode.time)
        assert found.chunks == index
        check(found, list(range(count)), None, episode)


def test_recovered_episode_can_be_written_and_says_what_it_is(tmp_path):
    found = recover(tmp_path / "a.mcap", SPLIT[: offsets(SPLIT, CHUNK)[4]])
    again = read_episode(write_episode(tmp_path / "b.mcap", found.episode))
    assert again.metadata["recovered"] == {"samples": found.samples, "expected": None}
    assert_equal(again, found.episode)
