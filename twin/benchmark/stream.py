"""Speed of `endotwin run` on a live stream: samples per second of one core, and the delay of the answers."""

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from twin.benchmark.result import Result

RATE = 1000  # samples a second that must be sustained on one core
SAMPLES = 20_000
PACED_SECONDS = 10
SAMPLE_TIME = 0.1  # of the stamps; how fast they come does not depend on it [s]


def sample_lines(samples: int) -> list[bytes]:
    """Return a stream of samples: a sinusoidal pull, and an angle that lags behind it, with noise."""
    phase = np.arange(samples) * SAMPLE_TIME * 2 * np.pi / 8
    pull = 3 + np.sin(phase)
    angle = 60 + 20 * np.sin(phase - 0.3) + np.random.default_rng(1).normal(0, 0.3, samples)
    return [
        json.dumps({"time_s": SAMPLE_TIME * k, "pull_mm": pull[k], "measurement_deg": angle[k]}).encode()
        + b"\n"
        for k in range(samples)
    ]


def stream(policy: Path) -> dict[str, Result]:
    """Measure `endotwin run` with a trained file, recording included."""
    with tempfile.TemporaryDirectory() as folder:
        whole, nothing = (processor_seconds(policy, sample_lines(n), Path(folder)) for n in (SAMPLES, 1))
        delays = answer_delays(policy, sample_lines(RATE * PACED_SECONDS), Path(folder))
    rate = (SAMPLES - 1) / (whole - nothing)
    late = 1e3 * float(np.percentile(delays, 99))
    return {
        "run_rate": Result(
            "`endotwin run`, live and recorded, samples per second of one core",
            rate,
            "samples/s",
            f">= {RATE}",
            rate >= RATE,
            "its time to start, in samples",
            nothing * rate,
        ),
        "run_delay": Result(
            f"delay of 99 % of its answers at {RATE} samples/s for {PACED_SECONDS} s",
            late,
            "ms",
            "",  # nothing is promised: it is of the machine and of what else runs there
            peer="the median",
            peer_value=1e3 * float(np.median(delays)),
        ),
    }


def processor_seconds(policy: Path, lines: list[bytes], folder: Path) -> float:
    """Return the processor time of a run on a stream, user and system, of all its threads [s]."""
    samples = folder / "samples"
    samples.write_bytes(b"".join(lines))
    with samples.open("rb") as given:
        process = subprocess.Popen(
            _command(policy, folder), stdin=given, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"endotwin run ended with exit status {process.returncode}")
    return used.ru_utime + used.ru_stime


def answer_delays(policy: Path, lines: list[bytes], folder: Path) -> list[float]:
    """Return the time from when each sample is due, `RATE` a second, to its answer [s]."""
    with subprocess.Popen(
        _command(policy, folder), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        source, answers = process.stdin, process.stdout
        source.write(b'{"time_s":-1}\n')  # answered when all is loaded
        source.flush()
        answers.readline()
        begun = time.perf_counter()

        def send() -> None:
            for k, line in enumerate(lines):
                time.sleep(max(begun + k / RATE - time.perf_counter(), 0.0))
                source.write(line)
                source.flush()
            source.close()

        sender = threading.Thread(target=send)
        sender.start()
        came = []
        for _ in answers:
            came.append(time.perf_counter())
        sender.join()
    return [time_of - begun - k / RATE for k, time_of in enumerate(came)]


def _command(policy: Path, folder: Path) -> list[str]:
    recording = folder / "run.mcap"
    return [sys.executable, "-P", "-m", "twin", "run", "--policy", str(policy), "--out", str(recording)]
