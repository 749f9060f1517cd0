"""The measurement of a live stream, at small size: it runs the real command and counts its answers."""

import json

import pytest

from rl import benchmark
from twin.benchmark import stream
from twin.benchmark.stream import answer_delays, processor_seconds, sample_lines


def test_its_samples_are_what_the_protocol_reads():
    from twin.live.lines import read_sample

    times = [read_sample(line).time_s for line in sample_lines(50)]
    assert times == pytest.approx([0.1 * k for k in range(50)])
    assert all(json.loads(line)["measurement_deg"] for line in sample_lines(50))


def test_rate_and_delay_are_of_the_real_command(ram_policy, tmp_path, monkeypatch):
    monkeypatch.setattr(stream, "RATE", 200)
    delays = answer_delays(ram_policy, sample_lines(40), tmp_path)
    assert len(delays) == 40
    assert min(delays) > 0
    assert processor_seconds(ram_policy, sample_lines(3), tmp_path) > 0
    with pytest.raises(RuntimeError, match="exit status 2"):
        processor_seconds(tmp_path / "none.onnx", [], tmp_path)


def test_the_rate_is_of_the_samples_without_the_start(monkeypatch, tmp_path):
    monkeypatch.setattr(stream, "processor_seconds", lambda _, lines, __: 1.0 + 0.004 * (len(lines) - 1))
    monkeypatch.setattr(stream, "answer_delays", lambda *_: [0.001, 0.002, 0.003])
    found = stream.stream(tmp_path)
    assert found["run_rate"].value == pytest.approx(250)
    assert not found["run_rate"].holds
    assert found["run_delay"].peer_value == pytest.approx(2.0)
    monkeypatch.setattr(benchmark, "train_policy", lambda *_: tmp_path)
    assert benchmark.with_policy(lambda policy: {"of": policy}) == {"of": tmp_path}
