"""A run on a log as it is recorded: the record anew, its estimates beside it, whole or not at all."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from recorded import assert_equal, make_episode, messages

from twin.recording import read_episode, write_episode
from twin.runtime import load_runtime
from twin.stream.counts import RunCounts
from twin.stream.log_recording import joined
from twin.stream.log_run import LogRun, log_targets, read_logs, run_log
from twin.stream.replay import replay

FACTS = {"method": "ram", "noise_variance_deg2": 0.1}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Two records at 0.02 s, one of which lacks measurements."""
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
    new_runtime = partial(load_runtime, policy)
    run = LogRun(files, read_logs(files, 0.1), targets)
    shown = []
    scores = run_log(run, "ram", new_runtime, sink or RunCounts(), FACTS, lambda *told: shown.append(told))
    assert shown[-1] == (run.samples, run.samples)
    return run, scores, [[*replay(new_runtime(), log)] for log in run.logs]


def test_a_file_for_each_record_holds_it_and_the_bits_of_its_estimates(files, ram_policy, tmp_path):
    targets = log_targets(tmp_path, list(files))
    run, scores, streams = ran(files, targets, ram_policy)
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
    errors = np.concatenate(
        [
            [s.reading.bend_deg - truth for s, truth in zip(stream, log.truth_deg, strict=True)][1:]
            for log, stream in zip(run.logs, streams, strict=True)
        ]
    )
    assert scores.rmse_deg == pytest.approx(np.sqrt((errors**2).mean()), rel=1e-12)


def test_in_one_file_records_follow_one_another_and_each_begins_anew(files, ram_policy, tmp_path):
    target = tmp_path / "run.mcap"
    _, _, streams = ran(files, log_targets(target, list(files)), ram_policy)
    episode = read_episode(target)
    parts = [read_episode(file) for file in files.values()]
    assert len(episode.time) == sum(len(part.time) for part in parts)
    np.testing.assert_allclose(episode.bend, np.concatenate([part.bend for part in parts]), rtol=1e-12)
    assert episode.wire_tension.shape[1:] == parts[0].wire_tension.shape[1:]
    told = episode.metadata["records"]
    assert [one["name"] for one in told] == list(files)
    assert told[1]["begins_s"] == pytest.approx(episode.time[told[0]["samples"]])
    assert episode.time[told[0]["samples"]] - episode.time[told[0]["samples"] - 1] == pytest.approx(1.0)
    estimates = [decoded.estimate_deg for _, decoded in messages(target)["/estimate/ram"]]
    assert estimates == [sample.reading.bend_deg for stream in streams for sample in stream]


def test_a_viewer_sees_records_follow_one_another(files, ram_policy):
    class Times(RunCounts):
        times = ()

        def add(self, sample):
            super().add(sample)
            self.times += (sample.time_s,)

    sink = Times()
    run, _, _ = ran(files, [], ram_policy, sink)
    first, second = (log.time_s for log in run.logs)
    assert sink.times == pytest.approx([*first, *(second - second[0] + first[-1] + 1.0)])


def test_the_same_run_gives_the_same_bytes(files, ram_policy, tmp_path):
    for name in ("a.mcap", "b.mcap"):
        ran(files, [tmp_path / name], ram_policy)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_nothing_is_left_of_a_run_that_breaks_off(files, ram_policy, tmp_path):
    class Broken(RunCounts):
        def add(self, sample):
            super().add(sample)
            if self.samples == 15:
                raise OSError("broken")

    with pytest.raises(OSError, match="broken"):
        ran(files, log_targets(tmp_path, list(files)), ram_policy, Broken())
    assert [path.name for path in tmp_path.iterdir()] == ["record_0.mcap"]  # it was complete


def test_records_that_differ_in_what_they_hold_are_joined_by_what_all_have(tmp_path):
    whole = make_episode(samples=20, drive=True, drawn=True)
    plane = make_episode(samples=10, planes=2, elements=3, vertebrae=4, seed=1)
    measured = dataclasses.replace(
        make_episode(samples=5, vertebrae=0, elements=None), metadata={"seed": 0, "source": "measured"}
    )
    one, offsets = joined([whole, plane, measured], ["a", "b", "c"])
    assert len(one.time) == 35
    assert one.joint_angle.shape == (35, 0)
    assert one.wire_tension.shape == (35, 2, 0)
    assert len(one.pulley) == len(one.lateral_pull) == 0
    assert "source" not in one.metadata
    assert offsets == pytest.approx([0.0, 0.38 + 1.0, 0.38 + 1.0 + 0.18 + 1.0])
    np.testing.assert_array_equal(one.bend[20:30], plane.bend)
    assert_equal(read_episode(write_episode(tmp_path / "one.mcap", one)), one)
    alone, nothing = joined([plane], ["b"])
    assert alone is plane
    assert nothing == [0.0]


@pytest.mark.parametrize(
    ("out", "count"), [(None, 0), ("run.mcap", 1), ("RUN.MCAP", 1), ("runs", 2), ("v1.2", 2)]
)
def test_the_name_says_whether_it_is_one_file_or_a_folder(tmp_path, out, count):
    targets = log_targets(out and tmp_path / out, ["a", "b"])
    assert len(targets) == count
    assert len({*targets}) == count
