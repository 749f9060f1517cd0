"""A run on a log: recorded with its estimates, scored, complete or not at all."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from recorded import assert_equal, make_episode, messages

from twin.live import load_runtime
from twin.live.log_run import log_targets, read_logs, replay, run_log
from twin.live.reading import RunCounts
from twin.recording import read_episode, write_episode

FACTS = {"method": "ram", "noise_variance_deg2": 0.1}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Two episodes at 0.02 s, one of which lacks measurements."""
    folder = tmp_path_factory.mktemp("records")
    found = {}
    for number in range(2):
        episode = make_episode(samples=50 + number, seed=number, start=3.0 * number)
        measured = np.where(np.arange(len(episode.time)) % 10 == 5, np.nan, 20 * episode.measured_bend)
        name = f"record_{number}"
        found[name] = write_episode(
            folder / f"{name}.mcap", dataclasses.replace(episode, measured_bend=measured)
        )
    return found


def ran(files, targets, policy, sink=None):
    new_runtime, shown = partial(load_runtime, policy), []
    logs = read_logs(files, 0.1)
    sink = sink or RunCounts()
    scores = run_log(files, logs, targets, "ram", new_runtime, sink, FACTS, lambda *done: shown.append(done))
    total = sum(len(log.time) for log in logs)
    assert shown[-1] == (total, total)
    return logs, scores, [[*replay(new_runtime(), log)] for log in logs]


def test_a_file_for_each_episode_has_it_and_the_bits_of_its_estimates(files, ram_policy, tmp_path):
    targets = log_targets(tmp_path, list(files))
    logs, scores, streams = ran(files, targets, ram_policy)
    assert scores.against == "truth"
    for (name, file), target, stream in zip(files.items(), targets, streams, strict=True):
        assert target == tmp_path / f"{name}.mcap"
        before, after = read_episode(file), read_episode(target)
        assert after.metadata.pop("made_by") == "endotwin run"
        assert after.metadata.pop("run") == FACTS
        assert_equal(after, before)
        found = messages(target)
        estimates = found["/estimate/ram"]
        assert [record.log_time for record, _ in estimates] == [round(s.time_s * 1e9) for s in stream]
        assert [decoded.estimate_deg for _, decoded in estimates] == [s.reading.bend_deg for s in stream]
        assert [decoded.low_deg for _, decoded in estimates] == [s.reading.low_deg for s in stream]
        assert len(found["/health"]) == len(stream)
    errors = [
        sample.reading.bend_deg - truth
        for log, stream in zip(logs, streams, strict=True)
        for sample, truth in zip(stream[1:], log.truth_deg[1:], strict=True)
    ]
    assert scores.rmse_deg == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-12)


def test_in_one_file_episodes_follow_one_another_and_the_bytes_repeat(files, ram_policy, tmp_path):
    class Times(RunCounts):
        times = ()

        def add(self, sample):
            super().add(sample)
            self.times += (sample.time_s,)

    sink, target = Times(), tmp_path / "run.mcap"
    logs, _, streams = ran(files, log_targets(target, list(files)), ram_policy, sink)
    episode = read_episode(target)
    parts = [read_episode(file) for file in files.values()]
    np.testing.assert_allclose(episode.bend, np.concatenate([part.bend for part in parts]), rtol=1e-12)
    assert episode.wire_tension.shape[1:] == parts[0].wire_tension.shape[1:]
    first, second = episode.metadata["records"]
    assert [first["name"], second["name"]] == list(files)
    assert second["begins_s"] == pytest.approx(episode.time[first["samples"]])
    assert episode.time[first["samples"]] - episode.time[first["samples"] - 1] == pytest.approx(1.0)
    estimates = [decoded.estimate_deg for _, decoded in messages(target)["/estimate/ram"]]
    assert estimates == [sample.reading.bend_deg for stream in streams for sample in stream]
    one, other = (log.time for log in logs)
    assert sink.times == pytest.approx([*one, *(other - other[0] + one[-1] + 1.0)])
    ran(files, [tmp_path / "again.mcap"], ram_policy)
    assert target.read_bytes() == (tmp_path / "again.mcap").read_bytes()


def test_nothing_is_left_of_a_run_that_breaks_off(files, ram_policy, tmp_path):
    class Broken(RunCounts):
        def add(self, sample):
            super().add(sample)
            if self.samples == 15:
                raise OSError("broken")

    with pytest.raises(OSError, match="broken"):
        ran(files, log_targets(tmp_path, list(files)), ram_policy, Broken())
    assert [path.name for path in tmp_path.iterdir()] == ["record_0.mcap"]  # it was complete
