"""`endotwin run` as other programs start it: a stream through pipes, a log, and every way to end."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import jsonschema
import numpy as np
import pytest
from recorded import make_episode, messages
from repository import ENVIRONMENT, REPOSITORY, command
from small_dataset import measured_log
from typed import done, typed

from twin.errors import EXTRAS
from twin.live import load_runtime
from twin.live.reading import StreamSample
from twin.recording import read_episode, write_episode

SCHEMA = jsonschema.Draft202012Validator(
    json.loads((REPOSITORY / "assets/run_protocol.schema.json").read_text())
)


def sample(k: int, **changes) -> bytes:
    values = {"time_s": 0.1 * k, "pull_mm": 3.0 + 0.01 * k, "measurement_deg": 60.0 + 0.1 * k} | changes
    return json.dumps(values).encode() + b"\n"


@pytest.fixture(scope="module")
def place(tmp_path_factory, ram_policy):
    """A folder with a trained file, a measured log and a simulated record at 0.02 s."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "policy.onnx").write_bytes(ram_policy.read_bytes())
    for name in ("data/measured", "data/two"):
        (folder / name).mkdir(parents=True)
    write_episode(folder / "data/measured/log.mcap", measured_log(folder))
    for number in range(2):
        write_episode(folder / f"data/two/{number}.mcap", make_episode(samples=60, seed=number))
    return folder


@contextmanager
def live(place, *words, **options):
    """A live run in a process of its own, which has begun."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    line = command("run", "--policy", "policy.onnx", *words)
    with subprocess.Popen(line, cwd=place, env=ENVIRONMENT, **pipes) as process:
        try:
            yield process
        finally:
            process.kill()


def ask(process, line: bytes) -> dict:
    process.stdin.write(line)
    process.stdin.flush()
    return json.loads(process.stdout.readline())


def test_each_sample_is_answered_at_once_and_the_summary_goes_to_stderr(place):
    runtime = load_runtime(place / "policy.onnx", noise_variance=0.5, initial_bend_deg=58.0, sample_time=0.1)
    with live(
        place, "--noise-variance", "0.5", "--initial-bend-deg", "58", "--sample-time", "0.1", "--json"
    ) as process:
        for k in range(30):
            answer = ask(process, sample(k))
            SCHEMA.validate(answer)
            reading = runtime.push(0.1 * k, 3.0 + 0.01 * k, 60.0 + 0.1 * k)
            assert answer["bend_deg"] == reading.bend_deg
            assert answer["interval_deg"] == [reading.low_deg, reading.high_deg]
            assert answer["source"] == reading.source.value
        answer = ask(process, b"no sample\n")
        SCHEMA.validate(answer)
        assert answer["line"] == 31
        assert ask(process, sample(30, measurement_deg=None))["health"]["sample"] == ["NO_MEASUREMENT"]
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (0, b"")
    summary = json.loads(err)
    assert (summary["samples"], summary["not_samples"], summary["faults"]) == (31, 1, {"NO_MEASUREMENT": 1})
    assert summary["method"] == runtime.method


def test_a_sensor_that_is_given_is_corrected_for(place):
    lines = b"".join(sample(k, measurement_deg=62.0 + 0.1 * k) for k in range(20))
    plain = typed("run --policy policy.onnx", place, b"".join(map(sample, range(20)))).out.splitlines()
    found = typed("run --policy policy.onnx --sensor-zero-deg 2", place, lines).out.splitlines()
    bends, expected = ([json.loads(line)["bend_deg"] for line in some] for some in (found, plain))
    np.testing.assert_allclose(bends, expected, atol=1e-9)
    late = typed("run --policy policy.onnx --sensor-lag-s 0.2 --json", place, lines)
    assert json.loads(late.err)["sensor"]["lag_s"] == 0.2


def test_the_noise_of_a_log_is_estimated(place):
    summary = json.loads(done("run --policy policy.onnx data/two --json", place))
    assert summary["noise_variance_deg2"] > 0
    given = json.loads(done("run --policy policy.onnx data/two --noise-variance 0.7 --json", place))
    assert given["noise_variance_deg2"] == 0.7


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_well_and_the_recording_has_all_that_was_answered(place, tmp_path, number):
    out = tmp_path / "run.mcap"
    with live(place, "--out", str(out)) as process:
        bends = [ask(process, sample(k))["bend_deg"] for k in range(25)]
        process.send_signal(number)
        rest, err = process.communicate(timeout=60)
    assert (process.returncode, rest) == (128 + number, b"")
    assert "stopped: 25 samples" in err.decode()
    assert len(err.splitlines()) == 1
    found = messages(out)
    assert [decoded.estimate_deg for _, decoded in found["/estimate/RAM"]] == bends
    assert [decoded.pull_mm for _, decoded in found["/command"]] == [3.0 + 0.01 * k for k in range(25)]
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


def test_a_reader_that_has_gone_is_a_quiet_end(place, tmp_path):
    out = tmp_path / "run.mcap"
    with live(place, "--out", str(out)) as process:
        ask(process, sample(0))
        process.stdout.close()
        for k in range(1, 3):
            try:
                process.stdin.write(sample(k))
                process.stdin.flush()
            except BrokenPipeError:
                break
        err = process.stderr.read().decode()
        assert process.wait(60) == 0
    assert "the reader of the answers has gone" in err
    assert len(err.splitlines()) == 1
    assert len(messages(out)["/estimate/RAM"]) == 2


@pytest.mark.slow
def test_a_slow_reader_holds_up_the_sender_and_a_signal_still_ends_it(place):
    """Nothing grows: what is not read waits in the two pipes, and the sender with it."""
    with live(place) as process:
        ask(process, sample(0))
        os.set_blocking(process.stdin.fileno(), False)
        taken, since = 0, time.monotonic()
        while time.monotonic() - since < 1.0:
            try:
                taken += os.write(process.stdin.fileno(), sample(taken) * 50)
                since = time.monotonic()
            except BlockingIOError:
                time.sleep(0.02)
            assert taken < 2_000_000, "it takes in without end"
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 143


def test_a_full_disk_behind_stdout_is_one_line(place):
    with open("/dev/full", "w") as full, live(place, stdout=full) as process:
        _, err = process.communicate(sample(0), timeout=60)
    assert process.returncode == 2
    assert "No space left" in err.decode()
    assert len(err.splitlines()) == 1


def test_stdin_that_is_closed_is_one_line(place):
    with live(place, stdin=None, preexec_fn=lambda: os.close(0)) as process:
        _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert b"stdin is closed" in err


def test_a_recording_that_fails_is_reported_and_the_stream_goes_on(place, tmp_path, monkeypatch):
    from twin.recording.live import LiveRecording

    def full(*_):
        raise OSError(28, "No space left on device", "run.mcap")

    monkeypatch.setattr(LiveRecording, "add", full)
    code, out, err = typed(
        f"run --policy policy.onnx --out {tmp_path}/run.mcap", place, b"".join(map(sample, range(5)))
    )
    assert code == 1
    assert len(out.splitlines()) == 5
    assert err.count("No space left on device; the stream goes on without it") == 1


def test_a_viewer_gets_every_sample_and_an_address(place, monkeypatch):
    from scripts import live

    seen = []
    add, close = live.LiveViewer.add, live.LiveViewer.close
    monkeypatch.setattr(live.LiveViewer, "add", lambda *words: seen.append(words[1]) or add(*words))
    monkeypatch.setattr(live.LiveViewer, "close", lambda viewer: seen.append("closed") or close(viewer))
    code, out, err = typed(
        "run --policy policy.onnx --live --live-port 0", place, b"".join(map(sample, range(3)))
    )
    assert code == 0
    assert len(out.splitlines()) == 3
    assert "open ws://127.0.0.1:" in err
    assert [one.time_s for one in seen[:-1]] == [0.0, 0.1, 0.2]
    assert seen[-1] == "closed"


def test_a_log_that_is_shown_takes_as_long_as_it_took(place, monkeypatch):
    from scripts import run as verb

    clock = [100.0]
    monkeypatch.setattr(verb.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(verb.time, "sleep", lambda seconds: clock.__setitem__(0, clock[0] + seconds))
    pace, waited = verb.Pace(), []
    for time_s in (5.0, 5.1, 5.3, 7.0):
        pace.add(StreamSample(time_s, 0.0, 0.0, load_runtime(place / "policy.onnx").reading))
        waited.append(clock[0] - 100.0)
    assert waited == pytest.approx([0.0, 0.1, 0.3, 2.0])


def test_a_log_is_run_recorded_and_scored_and_has_the_bits_of_the_live_stream(place, tmp_path):
    line = f"run --policy policy.onnx data/measured --noise-variance 0.1 --out {tmp_path}/run.mcap"
    summary = json.loads(done(f"{line} --json", place))
    estimates = [decoded.estimate_deg for _, decoded in messages(tmp_path / "run.mcap")["/estimate/RAM"]]
    log = read_episode(place / "data/measured/log.mcap").record().resampled(0.1, "nearest")
    measured = [None if np.isnan(angle) else angle for angle in log.measured_deg.tolist()]
    stream = zip(log.time.tolist(), log.pull_mm.tolist(), measured, strict=True)
    lines = b"".join(
        json.dumps(dict(zip(("time_s", "pull_mm", "measurement_deg"), row, strict=True))).encode() + b"\n"
        for row in stream
    )
    answered = typed("run --policy policy.onnx", place, lines)
    assert [json.loads(row)["bend_deg"] for row in answered.out.splitlines()] == estimates
    assert summary["samples"] == len(estimates) == len(log.time)
    error = np.array(estimates)[1:] - log.measured_deg[1:]
    assert summary["against"] == "measurement"
    assert summary["rmse_deg"] == pytest.approx(np.sqrt(np.nanmean(error**2)))
    answer = done(line, place)  # what such a run has left is replaced
    assert "1 records" in answer
    assert f"RMSE {summary['rmse_deg']:.3f} deg against the measurement" in answer


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("run --policy none.onnx", "no trained file none.onnx"),
        ("run --policy policy.onnx none", "no file or folder none"),
        ("run --policy policy.onnx data", "no *.mcap file in data"),
        ("run --policy policy.onnx data/two data/two", "is given twice"),
        ("run --policy policy.onnx --sample-time 0", "--sample-time 0: must be from"),
        ("run --policy policy.onnx --noise-variance 0", "--noise-variance 0: must be from"),
        ("run --policy policy.onnx --initial-bend-deg nan", "--initial-bend-deg nan"),
        ("run --policy policy.onnx --live-port 70000", "--live-port 70000"),
        ("run --policy policy.onnx --out policy.onnx", "must end in .mcap"),
        (
            "run --policy policy.onnx data/two --out run.csv",
            "--out run.csv: must end in .mcap, or name a folder",
        ),
        ("run --policy policy.onnx data/two/0.mcap --out data/two/0.mcap", "is what is read"),
        ("run --policy policy.onnx data/two --out data/measured/log.mcap", "no such command made it"),
        ("run --policy policy.onnx data/two --out data/two", "no such command made it"),
        ("run --policy policy.onnx data/two --out none.mcap/run.mcap --sample-time -1", "--sample-time -1"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(place, line, fault):
    before = {path: path.stat().st_mtime_ns for path in place.rglob("*")}
    code, out, err = typed(line, place, sample(0))
    assert (code, out) == (2, "")
    assert fault in err
    assert len(err.splitlines()) == 1
    assert {path: path.stat().st_mtime_ns for path in place.rglob("*")} == before


def test_a_log_is_no_ground_to_replace_a_live_recording(place, tmp_path):
    typed(f"run --policy policy.onnx --out {tmp_path}/live.mcap", place, sample(0))
    whole = (tmp_path / "live.mcap").read_bytes()
    code, _, err = typed(f"run --policy policy.onnx data/two --out {tmp_path}/live.mcap", place)
    assert code == 2
    assert "no such command made it" in err
    assert (tmp_path / "live.mcap").read_bytes() == whole


def test_a_log_runs_with_the_core_of_the_package_alone(place, tmp_path):
    code = (
        "import sys\n"
        "class Refused:\n"
        "    def find_spec(self, name, *_):\n"
        f"        if name.partition('.')[0] in {sum(EXTRAS.values(), ())}: raise ImportError(name)\n"
        "sys.meta_path.insert(0, Refused())\n"
        "from pathlib import Path\n"
        "from scripts.run import Run, run\n"
        f"print(run(Run((Path('data/measured'),), policy=Path('policy.onnx'), out=Path({str(tmp_path)!r}) / "
        "'run.mcap')).values['samples'])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=place, env=ENVIRONMENT
    )
    assert done.stdout.strip() == "120", done.stderr[-500:]
    assert (tmp_path / "run.mcap").is_file()
