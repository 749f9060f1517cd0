"""Speed of the live path: one sample against a peer's filter, a stream of lines, a command in closed loop."""

import itertools
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from scripts.benchmarks.harness import Result, processor_seconds
from twin.estimation.deployment import KEY, Deployment
from twin.estimation.learned.trained_file import read_trained_file
from twin.preset.preset import Preset

SAMPLES = 20_000
AT_ONCE = 500  # samples of the one, then of the other: both see the same load of the machine
T = 0.1  # [s]
PERIOD_S = 8.0
FIRST_DEG = 60.0


def one_live_sample(policy: Path) -> dict[str, Result]:
    """Measure the runtime of a trained file against filterpy's predict and update alone, in turn.

    The endoscope is the file's own model, so that the policy is trusted, as in a deployment that goes well.
    """
    from twin.live import load_runtime

    stream = _own_stream(policy)
    runtime = load_runtime(policy, initial_bend_deg=FIRST_DEG)
    ours, theirs = _in_turn(lambda: runtime.push(*next(stream)), _filterpy_sample())
    trusted = 1 - runtime.fallback_samples / runtime.samples
    median, peer = float(np.median(ours)), float(np.median(theirs))
    late = float(np.percentile(ours, 99))
    of = f"one sample of {runtime.method} with fallback and monitor, {100 * trusted:.0f} % of them trusted"
    name, latest = "filterpy's EKF, predict and update", f"{of}, 99th percentile"
    return {
        "runtime_sample": Result(of, median, "us", "<= 1 times the peer", None, name, peer),
        "runtime_latest": Result(latest, late, "us", "< 5 times the median", None, "the median", median),
    }


def _own_stream(policy: Path) -> Iterator[tuple[float, float, float]]:
    """Return samples of the model in a trained file, on half of its trained stroke, with noise."""
    deployment = Deployment.from_dict(read_trained_file(policy).description[KEY])
    low, high = deployment.pull_mm
    time_s = np.arange(SAMPLES + 2 * AT_ONCE) * T
    pull = (low + high) / 2 + (high - low) / 4 * np.sin(2 * np.pi * time_s / PERIOD_S)
    bend = deployment.fallback.model.response(pull, FIRST_DEG)
    deviation = np.sqrt(deployment.fallback.measurement_variance)
    measurement = bend + np.random.default_rng(1).normal(0, deviation, len(bend))
    return zip(time_s.tolist(), pull.tolist(), measurement.tolist(), strict=True)


def _in_turn(*functions: Callable[[], object]) -> list[list[float]]:
    """Return the times of single calls of each [us], in blocks that take turns; the first block warms up."""
    took: list[list[float]] = [[] for _ in functions]
    for block in range(SAMPLES // AT_ONCE + 1):
        for times, function in zip(took, functions, strict=True):
            for _ in range(AT_ONCE):
                begun = time.perf_counter()
                function()
                times.append(1e6 * (time.perf_counter() - begun))
            if block == 0:
                times.clear()
    return took


def _filterpy_sample() -> Callable[[], None]:
    """Return one predict and update of filterpy's extended Kalman filter of two states."""
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(2, 1)
    ekf.x, ekf.F = np.zeros((2, 1)), np.array([[0.9, T], [0.0, 1.0]])
    row, measured = np.array([[1.0, 0.0]]), np.array([[1.0]])

    def sample() -> None:
        ekf.predict()
        ekf.update(measured, lambda _: row, lambda state: row @ state)

    return sample


RATE = 1000  # samples a second that must be sustained on one core
PACED_SECONDS = 10


def sample_lines(samples: int) -> list[bytes]:
    """Return a stream of samples: a sinusoidal pull, and an angle that lags behind it, with noise."""
    phase = np.arange(samples) * T * 2 * np.pi / 8
    pull = 3 + np.sin(phase)
    angle = 60 + 20 * np.sin(phase - 0.3) + np.random.default_rng(1).normal(0, 0.3, samples)
    return [
        json.dumps({"time_s": T * k, "pull_mm": pull[k], "measurement_deg": angle[k]}).encode() + b"\n"
        for k in range(samples)
    ]


def stream(policy: Path) -> dict[str, Result]:
    """Measure `endotwin run` with a trained file, recording included."""
    with tempfile.TemporaryDirectory() as folder:
        whole, nothing = (_run_seconds(policy, sample_lines(n), Path(folder)) for n in (SAMPLES, 1))
        delays = answer_delays(policy, sample_lines(RATE * PACED_SECONDS), Path(folder))
    rate = (SAMPLES - 1) / (whole - nothing)
    late = 1e3 * float(np.percentile(delays, 99))
    name, peer = "`endotwin run`, live and recorded, one core", "its time to start, in samples"
    delay, median = f"delay of 99 % of its answers at {RATE} samples/s", 1e3 * float(np.median(delays))
    return {
        "run_rate": Result(name, rate, "samples/s", f">= {RATE}", None, peer, nothing * rate),
        "run_delay": Result(delay, late, "ms", "", None, "the median", median),  # of the machine
    }


def _run_seconds(policy: Path, lines: list[bytes], folder: Path) -> float:
    samples = folder / "samples"
    samples.write_bytes(b"".join(lines))
    with samples.open("rb") as given:
        return processor_seconds(*_command(policy, folder), stdin=given)


def answer_delays(policy: Path, lines: list[bytes], folder: Path) -> list[float]:
    """Return the time from when each sample is due, `RATE` a second, to its answer [s]."""
    command = [sys.executable, "-P", *_command(policy, folder)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL) as process:
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
    return ["-m", "twin", "run", "--policy", str(policy), "--out", str(recording)]


SECONDS = 60.0
CONTROL_T = 0.02  # [s]
STROKE_MM = (-1.0, 1.0)
NOISE_VARIANCE = 1.0  # [deg^2]


def control_step(policy: Path, preset: Preset) -> dict[str, Result]:
    """Measure a controller on a trained file of RAM (twins), in a closed loop with a reduced twin."""
    from twin.control.conditions import PREVIEW_S, reference
    from twin.control.controller import MARGIN, CommandLimits, ControlKnowledge, Sensed
    from twin.control.controllers.inverses import MEMBERS_INVERSE
    from twin.control.trial import Plant
    from twin.estimation.deployment import deployment_of

    deployment = deployment_of(read_trained_file(policy))
    limits = CommandLimits(*STROKE_MM, speed_mm_s=5.0).wider(MARGIN)
    known = ControlKnowledge(
        preset, STROKE_MM, limits, CONTROL_T, NOISE_VARIANCE, deployment, PREVIEW_S, policy=policy
    )
    controller, plant = MEMBERS_INVERSE.make(known), Plant(preset, CONTROL_T, "reduced")
    rng = np.random.default_rng(1)
    wanted = reference("multi-sine", known.line.reached_deg, SECONDS, CONTROL_T, rng)
    first = limits.nearest(known.line.pull_mm(wanted[0]))
    bend = plant.start(first)
    controller.start(first, float(wanted[0]))
    took, trusted = [], 0
    for k, (now, following) in enumerate(itertools.pairwise(wanted)):
        coming = wanted[k + 1 : k + 1 + round(PREVIEW_S / CONTROL_T)]
        sensed = Sensed(
            k * CONTROL_T, bend + rng.normal(0, NOISE_VARIANCE**0.5), float(now), float(following), coming
        )
        begun = time.perf_counter()
        pull = controller.step(sensed)
        took.append(1e3 * (time.perf_counter() - begun))
        trusted += not controller.falls_back
        bend = plant.step(pull)
    of = f"one step of control by the inverse of members, {100 * trusted / len(took):.0f} % of them trusted"
    took = took[len(took) // 10 :]  # the first ones are slower: code and memory are cold
    median, late = float(np.median(took)), float(np.percentile(took, 99))
    return {
        "control_step": Result(of, median, "ms", "< 2 ms"),
        "control_step_latest": Result(f"{of}, 99th percentile", late, "ms", "< 5 ms"),
    }
