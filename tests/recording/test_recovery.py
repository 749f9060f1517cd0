"""Of a damaged file, every complete sample before its first fault comes back, and nothing else."""

import dataclasses
import json
import os
import tracemalloc

import mutated
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mutated import CHUNK, MAGIC
from recorded import make_episode
from recovering import EPISODE, SPLIT, check, messages_of_chunks, offsets, recover, samples_before

from twin.recording import read_episode, recover_episode

METADATA = 12


@settings(max_examples=40, deadline=None)
@given(place=st.floats(0, 1, exclude_max=True))
def test_file_cut_anywhere_gives_its_whole_chunks(tmp_path_factory, place):
    cut = int(place * len(SPLIT))
    path = tmp_path_factory.getbasetemp() / "cut.mcap"
    samples = samples_before(cut)
    if len(samples) < 2:
        with pytest.raises(ValueError, match="is cut off: ") as caught:
            recover(path, SPLIT[:cut])
        assert str(caught.value).startswith(f"{path} ")
        return
    check(recover(path, SPLIT[:cut]), samples, None)


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_samples_before_the_first_damaged_chunk_come_back(tmp_path_factory, data):
    starts = offsets(SPLIT, CHUNK)
    damaged = bytearray(SPLIT)
    lost = data.draw(st.sets(st.integers(0, len(starts) - 1), min_size=1, max_size=4))
    for index in lost:
        damaged[starts[index] + 60 + data.draw(st.integers(0, 200))] ^= 0xFF
    samples = samples_before(starts[min(lost)])
    path = tmp_path_factory.getbasetemp() / "gaps.mcap"
    if len(samples) < 2:
        with pytest.raises(ValueError, match="nothing can be recovered"):
            recover(path, bytes(damaged))
        return
    check(recover(path, bytes(damaged)), samples, None)


def test_number_of_samples_in_the_metadata_is_expected(tmp_path):
    episode = dataclasses.replace(EPISODE, metadata={"samples": 60})
    data = mutated.rewritten(episode, chunk_size=4000)
    found = recover(tmp_path / "a.mcap", data[: offsets(data, CHUNK)[4]])
    assert found.samples_expected == 60
    assert found.summary.startswith(f"{found.samples} of 60 samples ({found.samples * 0.02:.1f} of 1.2 s) ")
    data = mutated.rewritten(EPISODE, metadata={"samples": json.dumps(3)}, chunk_size=4000)
    assert recover(tmp_path / "a.mcap", data[: offsets(data, CHUNK)[4]]).samples_expected is None


def test_swapped_and_repeated_chunks_are_put_in_order(tmp_path):
    parts = mutated.records(SPLIT)
    places = [index for index, part in enumerate(parts) if part[0] == CHUNK]
    parts[places[2]], parts[places[4]] = parts[places[4]], parts[places[2]]
    parts.insert(places[5], parts[places[1]])
    (tmp_path / "a.mcap").write_bytes(MAGIC + b"".join(parts))
    with pytest.raises(ValueError, match="damaged"):
        read_episode(tmp_path / "a.mcap")
    check(recover(tmp_path / "a.mcap", MAGIC + b"".join(parts)), list(range(60)), None)


def test_missing_measurements_are_kept_only_before_the_last_one(tmp_path):
    """A chunk ends after /truth of a sample whose /measurement is in the next one."""
    measured = np.where(np.isin(np.arange(60), [3, 45]), np.nan, EPISODE.measured_bend)
    bare = make_episode(60, vertebrae=0, elements=None)
    bare = dataclasses.replace(bare, measured_bend=measured)
    data = mutated.rewritten(bare, chunk_size=400)
    chunks = messages_of_chunks(data)
    last = [max((sample for topic, sample in one if topic == "/truth"), default=-1) for one in chunks]
    split = next(k for k, one in enumerate(chunks) if last[k] > 3 and ("/measurement", last[k]) not in one)
    found = recover(tmp_path / "a.mcap", data[: offsets(data, CHUNK)[split + 1] + 20])
    assert np.flatnonzero(np.isnan(found.episode.measured_bend)).tolist() == [3]
    check(found, list(range(last[split])), None, bare)


def test_zeros_at_the_end_take_no_memory(tmp_path):
    """A file system may have given the file its size before the power failed."""
    path, start = tmp_path / "a.mcap", offsets(SPLIT, CHUNK)[3]
    path.write_bytes(SPLIT[:start])
    os.truncate(path, 2**30)
    tracemalloc.start()
    found = recover_episode(path)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    check(found, samples_before(start), None)
    assert most < 2**26


def test_nothing_to_recover_gives_one_line(tmp_path):
    path = tmp_path / "a.mcap"
    parts = mutated.records(SPLIT)
    without = MAGIC + b"".join(part for part in parts[:-2] if part[0] != METADATA)
    one = mutated.rewritten(EPISODE, lambda _, time: time == 0)
    for data, reason in (
        (b"time_s,pull_mm", "is not an MCAP file"),
        (b"", "is cut off: it is empty"),
        (without, "nothing can be recovered: metadata record 'endotwin' is missing"),
        (SPLIT[: offsets(SPLIT, CHUNK)[0]], "nothing can be recovered: 0 samples are complete"),
        (one, "a record needs at least 2 samples, got 1; nothing can be recovered"),
    ):
        with pytest.raises(ValueError, match=reason) as caught:
            recover(path, data)
        assert str(caught.value).startswith(f"{path} ")
        assert len(str(caught.value).splitlines()) == 1
    with pytest.raises(FileNotFoundError, match="no file"):
        recover_episode(tmp_path / "b.mcap")
