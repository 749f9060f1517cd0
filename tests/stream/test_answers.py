"""Answers on a live stream: one for each line, the same bits as on a log, and nothing lost by bad lines."""

import io
import json
import math

import numpy as np
import pytest

from twin.runtime import load_runtime
from twin.stream.answers import answers
from twin.stream.counts import RunCounts
from twin.stream.replay import StreamLog, log_errors, log_of, replay, rmse_deg

FAULTY = b'\nnonsense\n{"time_s":NaN}\n   \n{"time_s":true}\n' + b"x" * 70_000 + b"\n[]\n"


@pytest.fixture(scope="module")
def log() -> StreamLog:
    """A log with a hole in time, missing measurements and one that is far off."""
    rng = np.random.default_rng(3)
    time = np.delete(np.arange(80) * 0.1, slice(30, 36))
    pull = 3 + np.sin(time)
    measurement = 60 + 20 * np.sin(time - 0.3) + rng.normal(size=len(time))
    measurement[[5, 6, 50]] = np.nan
    measurement[60] = 500.0
    return StreamLog("log", time, pull, measurement, np.full(len(time), np.nan))


def text_of(log: StreamLog) -> list[bytes]:
    lines = []
    columns = (log.time_s.tolist(), log.pull_mm.tolist(), log.measurement_deg.tolist())
    for time_s, pull_mm, measured in zip(*columns, strict=True):
        sample = {"time_s": time_s, "pull_mm": pull_mm, "measurement_deg": measured}
        if math.isnan(measured):
            del sample["measurement_deg"]
        lines.append(json.dumps(sample).encode() + b"\n")
    return lines


@pytest.fixture(scope="module")
def runtime(ram_policy):
    return lambda: load_runtime(ram_policy, initial_bend_deg=55.0, noise_variance=1.0)


def test_a_live_stream_has_the_bits_of_the_log_however_many_bad_lines_are_between(runtime, log):
    expected = [sample.reading for sample in replay(runtime(), log)]
    lines = text_of(log)
    for stream in (b"".join(lines), FAULTY.join([b"", *lines, b""]), b"".join(lines)[:-1]):
        given = [*answers(runtime(), io.BytesIO(stream))]
        assert [answer.sample.reading for answer in given if answer.sample] == expected
        told = [json.loads(answer.text) for answer in given if answer.sample]
        assert [line["bend_deg"] for line in told] == [reading.bend_deg for reading in expected]
        assert [line["time_s"] for line in told] == log.time_s.tolist()
    assert len({reading.bend_deg for reading in expected}) > 60


def test_each_line_that_is_not_empty_is_answered_once_and_in_turn(runtime):
    stream = b'{"time_s":0,"pull_mm":3}\n' + FAULTY + b'{"time_s":0.1}'
    told = [json.loads(answer.text) for answer in answers(runtime(), io.BytesIO(stream))]
    assert [line.get("line") for line in told] == [None, 3, 4, 6, 7, 8, None]


def test_an_answer_is_there_before_the_next_line_is_read(runtime):
    class Asking(io.BytesIO):
        asked = 0

        def readline(self, size=-1):
            self.asked += 1
            return super().readline(size)

    stream = Asking(b'{"time_s":0,"pull_mm":3}\n' * 3)
    for number, _ in enumerate(answers(runtime(), stream), 1):
        assert stream.asked == number


def test_counts_are_those_of_the_readings(runtime, log):
    counts, samples = RunCounts(), [*replay(runtime(), log)]
    for sample in samples:
        counts.add(sample)
    told = counts.to_dict()
    assert told["samples"] == len(log.time_s)
    assert told["faults"]["NO_MEASUREMENT"] == 3
    assert told["faults"]["GAP"] == 1
    assert told["faulty"] == sum(bool(sample.reading.health) for sample in samples)
    assert f"{len(log.time_s)} samples" in str(counts)
    assert "NO_MEASUREMENT 3" in str(counts)
    assert RunCounts().to_dict()["fallback_share"] == 0


def test_errors_are_against_the_truth_or_the_measurements_from_the_second_sample_on():
    time = np.arange(100) * 0.1
    truth = np.sin(time)
    measured = truth + 0.5
    measured[7] = np.nan
    simulated = StreamLog("s", time, time, measured, truth)
    hardware = StreamLog("m", time, time, measured, np.full(100, np.nan))
    bend = truth + 1.0
    bend[0] = 1e6  # where the estimate was given
    every, steady = log_errors(simulated, bend)
    assert (len(every), len(steady)) == (99, 50)
    assert every == pytest.approx(np.ones(99))
    every, _ = log_errors(hardware, bend)
    assert every == pytest.approx(np.full(98, 0.5))
    assert rmse_deg([np.array([3.0]), np.array([4.0])]) == pytest.approx(math.sqrt(12.5))
    assert rmse_deg([]) is None


@pytest.mark.parametrize(("sample_time", "every"), [(0.02, 1), (0.1, 5), (0.05, 2), (0.001, 1), (0.089, 4)])
def test_a_log_is_thinned_and_nothing_is_interpolated(sample_time, every):
    from recorded import make_episode

    episode = make_episode(samples=40)
    log = log_of(episode, 0, sample_time)
    np.testing.assert_array_equal(log.time_s, episode.time[::every])
    np.testing.assert_array_equal(log.pull_mm, episode.pull_mm[::every])
    np.testing.assert_array_equal(log.measurement_deg, episode.measured_deg[::every])
    np.testing.assert_array_equal(log.truth_deg, episode.truth_deg[::every])
    assert not log.is_measured
