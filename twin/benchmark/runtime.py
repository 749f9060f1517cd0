"""Time of one sample of a deployed estimator, with policy, fallback and monitor, beside a peer's filter."""

import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from twin.benchmark.result import Result

SAMPLES = 20_000
AT_ONCE = 500  # samples of the one, then of the other: both meet the same noise of the machine
T = 0.1  # [s]


def one_sample(policy: Path) -> dict[str, Result]:
    """Measure the runtime of a trained file against filterpy's predict and update alone, in turn."""
    from twin.runtime import load_runtime

    runtime, place = load_runtime(policy), 0
    filterpy = _filterpy_sample()

    def deployed() -> None:
        nonlocal place
        place += 1
        phase = place * T * 2 * math.pi / 8
        runtime.push(
            place * T, 3 + math.sin(phase), noise[place % len(noise)] + 60 + 20 * math.sin(phase - 0.3)
        )

    noise = np.random.default_rng(1).normal(0, 0.3, 997).tolist()
    ours, theirs = _in_turn(deployed, filterpy)
    median, peer = float(np.median(ours)), float(np.median(theirs))
    late = float(np.percentile(ours, 99))
    of = f"one sample of {runtime.method} with fallback and monitor"
    name = "filterpy's EKF, predict and update"
    return {
        "runtime_sample": Result(of, median, "us", f"at most {name}", median <= peer, name, peer),
        "runtime_latest": Result(
            f"{of}, 99th percentile", late, "us", "below 5 medians", late < 5 * median, "the median", median
        ),
    }


def _in_turn(*functions: Callable[[], None]) -> list[list[float]]:
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
