"""A process that records a live stream is killed at any moment: all but the last second is there.

`make endurance` kills sixty times.
"""

import io
import subprocess
import sys
import time

import live_streams
import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory
from repository import ENVIRONMENT, endotwin

from twin.recording import read_episode, recover_episode

LONGEST_LOSS_S = 1.0
BUSY_S = 2.0  # by which a machine with more to do than cores may be late


def independent(data: bytes) -> dict[str, list]:
    """Every message of a cut file by topic, as (log time, decoded): mcap's own readers and decoder."""
    schemas, channels, found = {}, {}, {}
    factory = DecoderFactory()
    try:
        for one in StreamReader(io.BytesIO(data), validate_crcs=True).records:
            if isinstance(one, Schema):
                schemas[one.id] = one
            elif isinstance(one, Channel):
                channels[one.id] = one
            elif isinstance(one, Message):
                channel = channels[one.channel_id]
                decode = factory.decoder_for(channel.message_encoding, schemas[channel.schema_id])
                found.setdefault(channel.topic, []).append((one.log_time, decode(one.data)))
    except EndOfFile:
        pass
    return found


def killed(path, seconds: float) -> float:
    """Record the wall clock for some seconds, kill the process; returns when that was."""
    words = [sys.executable, live_streams.__file__, str(path)]
    process = subprocess.Popen(words, env=ENVIRONMENT)
    partial = path.with_name(path.name + ".partial")
    while not partial.exists() or partial.stat().st_size == 0:
        assert process.poll() is None
        time.sleep(0.01)
    time.sleep(seconds)
    now = time.time()
    process.kill()
    process.wait()
    return now


@pytest.mark.parametrize("kills", [2, pytest.param(60, marks=pytest.mark.endurance)])
def test_killed_recording_is_whole_but_for_its_last_second(tmp_path, kills):
    rng = np.random.default_rng(kills)
    losses = []
    for number in range(kills):
        path = tmp_path / f"{number}.mcap"
        end = killed(path, seconds=float(rng.uniform(2.0, 6.0 if kills > 2 else 3.0)))
        partial = tmp_path / f"{number}.mcap.partial"
        assert not path.exists()
        seen = independent(partial.read_bytes())
        times = [time / 1e9 for time, _ in seen["/command"]]
        # Nothing is missing in between: pulls count the samples.
        pulls = [decoded.pull_mm for _, decoded in seen["/command"]]
        np.testing.assert_allclose(pulls, np.arange(len(pulls)) * 1e-6, atol=1e-9)
        assert [time for time, _ in seen[live_streams.ESTIMATE]] == [time for time, _ in seen["/command"]]
        losses.append(end - times[-1])

        recovered = recover_episode(partial)
        assert recovered.samples == len(pulls)
        np.testing.assert_array_equal(recovered.episode.time, times)
        np.testing.assert_allclose(recovered.episode.pull_mm, pulls, rtol=1e-12)
        assert recovered.episode.is_measured
    print(f"{kills} kills: {np.median(losses):.2f} s lost, {max(losses):.2f} s at most")
    assert max(losses) < LONGEST_LOSS_S + BUSY_S


def test_what_a_kill_left_is_exported_and_kept_by_the_next_recording(tmp_path):
    path = tmp_path / "a.mcap"
    killed(path, seconds=1.5)
    left = (tmp_path / "a.mcap.partial").read_bytes()
    with pytest.raises(ValueError, match=r"a\.mcap\.partial is cut off: .*recover_episode"):
        read_episode(tmp_path / "a.mcap.partial")
    live_streams.record(path, live_streams.good_samples(100))
    assert len(read_episode(path).time) == 100
    assert (tmp_path / "a.mcap.partial").read_bytes() == left
    words = ["export", "a.mcap.partial", "--recover", "--format", "mcap", "--out", "saved"]
    done = endotwin(*words, cwd=tmp_path, timeout=100)
    assert done.returncode == 0, done.stderr
    saved = read_episode(tmp_path / "saved" / "a.mcap")
    assert len(saved.time) == recover_episode(tmp_path / "a.mcap.partial").samples > 50
