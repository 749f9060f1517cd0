"""Time of one sample of a deployed estimator, with policy, fallback and monitor, beside a peer's filter."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from twin.benchmark.result import Result
from twin.estimation.deployment import KEY, Deployment
from twin.estimation.learned.trained_file import read_trained_file

SAMPLES = 20_000
AT_ONCE = 500  # samples of the one, then of the other: both meet the same noise of the machine
T = 0.1  # [s]
PERIOD_S = 8.0
FIRST_DEG = 60.0


def one_sample(policy: Path) -> dict[str, Result]:
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
    name = "filterpy's EKF, predict and update"
    return {
        "runtime_sample": Result(of, median, "us", f"at most {name}", median <= peer, name, peer),
        "runtime_latest": Result(
            f"{of}, 99th percentile", late, "us", "below 5 medians", late < 5 * median, "the median", median
        ),
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
