"""A live stream is recorded as it came: readers of MCAP and our own find all of it in a file of its own."""

import io
import math
import os
import threading

import numpy as np
import pytest
from live_streams import ESTIMATE, METHOD, good_samples, record, sample
from mcap.exceptions import EndOfFile
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from recorded import messages, of_kind

from twin.recording import read_episode, read_estimates, read_metadata, recover_episode, write_episode
from twin.recording.live import FLUSH_S, LiveRecording
from twin.recording.messages import REFERENCE_TOPIC

SAMPLES = good_samples(3000)


def nanoseconds(samples):
    return [round(one.time_s * 1e9) for one in samples]


def test_an_independent_reader_finds_all_that_was_added(tmp_path):
    record(tmp_path / "a.mcap", SAMPLES)
    seen = messages(tmp_path / "a.mcap")
    assert set(seen) == {"/command", "/measurement", ESTIMATE, "/health"}
    measured = [one for one in SAMPLES if not math.isnan(one.measurement_deg)]
    for topic, samples in (
        ("/command", SAMPLES),
        (ESTIMATE, SAMPLES),
        ("/health", SAMPLES),
        ("/measurement", measured),
    ):
        assert [message.log_time for message, _ in seen[topic]] == nanoseconds(samples)
        assert [message.publish_time for message, _ in seen[topic]] == nanoseconds(samples)
    assert [message.sequence for message, _ in seen["/command"]] == list(range(len(SAMPLES)))
    assert [decoded.pull_mm for _, decoded in seen["/command"]] == [one.pull_mm for one in SAMPLES]
    assert [decoded.measured_deg for _, decoded in seen["/measurement"]] == [
        one.measurement_deg for one in measured
    ]
    estimates = [(decoded.estimate_deg, decoded.low_deg, decoded.high_deg) for _, decoded in seen[ESTIMATE]]
    assert estimates == [one.reading[:3] for one in SAMPLES]
    assert {(tuple(d.faults), tuple(d.alarms), d.source) for _, d in seen["/health"]} == {
        ((), (), "advanced")
    }


def test_it_is_read_as_a_measured_log(tmp_path):
    samples = good_samples(3000, start_s=1_795_438_574.5)
    record(tmp_path / "a.mcap", samples, metadata={"sensor": "FBG", "seed": 7})
    episode = read_episode(tmp_path / "a.mcap")
    assert episode.is_measured
    assert read_metadata(tmp_path / "a.mcap") == episode.metadata
    assert episode.metadata["method"] == METHOD
    assert (episode.metadata["sensor"], episode.metadata["seed"]) == ("FBG", 7)
    np.testing.assert_allclose(episode.time, [one.time_s for one in samples], rtol=0, atol=3e-7)
    np.testing.assert_allclose(episode.pull_mm, [one.pull_mm for one in samples], rtol=1e-12)
    wanted = np.array([one.measurement_deg for one in samples])
    np.testing.assert_allclose(episode.measured_deg, wanted, rtol=1e-12)
    known = ~np.isnan(wanted)
    filled = np.interp(episode.time, episode.time[known], wanted[known])
    np.testing.assert_allclose(episode.truth_deg, filled, rtol=1e-9, atol=1e-9)
    assert episode.truth_deg[-1] == episode.truth_deg[-2]  # level after the last measurement
    without = read_episode(tmp_path / "a.mcap", hidden=False)
    np.testing.assert_array_equal(without.bend, episode.bend)
    again = read_episode(write_episode(tmp_path / "b.mcap", episode))
    np.testing.assert_allclose(again.bend, episode.bend, rtol=1e-12)


def test_the_angle_that_was_wanted_stands_at_the_sample_that_it_was_wanted_at(tmp_path):
    references = [math.nan, 5.0, 6.0, math.nan, 1e9, 7.0, 8.0]
    samples = [
        one._replace(reference_deg=wanted) for one, wanted in zip(good_samples(7), references, strict=True)
    ]
    record(tmp_path / "run.mcap", samples, controlled=True)
    wanted = read_estimates(tmp_path / "run.mcap", REFERENCE_TOPIC)
    np.testing.assert_array_equal(wanted, [math.nan, math.nan, 5.0, 6.0, 6.0, 6.0, 7.0])
    record(tmp_path / "other.mcap", samples)
    assert len(read_estimates(tmp_path / "other.mcap", REFERENCE_TOPIC)) == 0


def test_samples_are_in_the_file_within_a_second_even_if_none_follow(tmp_path):
    """By what an independent reader finds in the growing file; it waits as long as a busy machine needs."""
    with LiveRecording(tmp_path / "a.mcap", METHOD) as recording:
        recording.add(SAMPLES[0])
        for _ in range(100):
            threading.Event().wait(FLUSH_S / 5)
            if of_kind(growing(recording.partial), Chunk):
                break
        (chunk,) = of_kind(growing(recording.partial), Chunk)
        assert chunk.message_start_time == 0


def growing(path):
    """All whole records so far; the library raises where a file has no end."""
    found = []
    try:
        for one in StreamReader(io.BytesIO(path.read_bytes()), emit_chunks=True, validate_crcs=True).records:
            found.append(one)
    except EndOfFile:
        pass
    return found


def test_a_recording_replaces_its_like_when_it_is_whole(tmp_path):
    path = tmp_path / "a.mcap"
    record(path, SAMPLES[:100])
    before = path.read_bytes()
    with LiveRecording(path, METHOD) as recording:
        for one in SAMPLES[:200]:
            recording.add(one)
        assert path.read_bytes() == before
    assert len(read_episode(path).time) == 200


def test_a_recording_of_nothing_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.mcap"
    record(path, [])
    assert os.listdir(tmp_path) == []
    record(path, SAMPLES[:100])
    record(path, [sample(math.nan)])
    assert len(read_episode(path).time) == 100
    assert os.listdir(tmp_path) == ["a.mcap"]


@pytest.mark.parametrize("foreign", ["text", "episode", "folder", "link"])
def test_what_no_recording_left_is_not_replaced(tmp_path, foreign):
    path = tmp_path / "a.mcap"
    if foreign == "text":
        path.write_text("thesis")
    elif foreign == "episode":
        record(tmp_path / "b.mcap", SAMPLES[:9])
        write_episode(path, read_episode(tmp_path / "b.mcap"))
        (tmp_path / "b.mcap").unlink()
    elif foreign == "folder":
        path.mkdir()
    else:
        path.symlink_to(tmp_path / "elsewhere")
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(ValueError, match=r"a\.mcap "):
        record(path, SAMPLES[:9])
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]
    assert (path.read_bytes() if path.is_file() else None) == before


def test_a_file_that_takes_the_name_meanwhile_stays_and_so_does_the_recording(tmp_path):
    path = tmp_path / "a.mcap"

    def samples():
        yield from SAMPLES[:50]
        path.write_text("thesis")

    with pytest.raises(ValueError, match=r"a\.mcap is there and no such command made it"):
        record(path, samples())
    assert path.read_text() == "thesis"
    assert len(read_episode(tmp_path / "a.mcap.partial").time) == 50  # whole, under the other name


def test_full_disk_is_one_error_and_what_was_written_is_readable(small_disk):
    disk = small_disk(128)
    path, added = disk / "a.mcap", []

    def samples():
        rng = np.random.default_rng(0)
        for k in range(200_000):
            added.append(k)
            yield sample(k / 50, *rng.normal(size=2))

    with pytest.raises(OSError, match="No space left") as caught:
        record(path, samples())
    assert caught.value.filename == str(path) + ".partial"
    assert "recover_episode" in caught.value.strerror
    recovered = recover_episode(path.with_name("a.mcap.partial"))
    assert 500 < recovered.samples < len(added) < 200_000
    np.testing.assert_allclose(recovered.episode.time, np.arange(recovered.samples) / 50, atol=1e-9)
    assert os.listdir(disk) == ["a.mcap.partial"]
