"""Harness of benchmarks: results with their peers, command signals, two jobs timed in turn."""

import dataclasses
import os
import platform
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclasses.dataclass(frozen=True)
class Result:
    """Measured figure of a benchmark.

    Attributes:
        name: name of the figure.
        value: measured value, in `unit`.
        unit: unit of both values.
        bar: required bound, in words; empty where nothing is promised.
        holds: True if the bound holds.
        peer: reference measured in the same run; None without one.
        peer_value: measured value of the reference, in `unit`.
    """

    name: str
    value: float
    unit: str
    bar: str
    holds: bool = True
    peer: str | None = None
    peer_value: float | None = None

    @property
    def ratio(self) -> float | None:
        """Value divided by that of the peer; None without one."""
        return None if not self.peer_value else self.value / self.peer_value

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as `benchmark.json` holds it."""
        return {
            "value": self.value,
            "unit": self.unit,
            "peer": self.peer,
            "peer_value": self.peer_value,
            "ratio": self.ratio,
            "bar": self.bar,
            "holds": self.holds,
            "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        }


Array = NDArray[np.float64]

SAMPLE_TIME = 0.02
"""Time between two samples [s]."""


def sinusoid(amplitude: float, period: float, cycles: float) -> Array:
    """Return a sinusoid from the middle of the stroke, (N,) [m], sampled at `SAMPLE_TIME`."""
    time = np.arange(round(cycles * period / SAMPLE_TIME) + 1) * SAMPLE_TIME
    wave: Array = amplitude * np.sin(2 * np.pi * time / period)
    return wave


def random_cycles(count: int, amplitude: float, period: float, rng: np.random.Generator) -> Array:
    """Return closed cycles of four random harmonics, between 1/8 and all of the amplitude, (count, N) [m].

    The first and the last sample of a cycle are the same.
    """
    phase = np.linspace(0, 2 * np.pi, round(period / SAMPLE_TIME) + 1)
    harmonics = np.arange(1, 5)[:, None, None]
    strengths = rng.normal(size=(4, count, 1)) / harmonics
    phases = rng.uniform(0, 2 * np.pi, (4, count, 1))
    waves = (strengths * np.sin(harmonics * phase + phases)).sum(axis=0)
    sizes = rng.uniform(amplitude / 8, amplitude, (count, 1))
    scaled: Array = waves * sizes / np.abs(waves).max(axis=1, keepdims=True)
    return scaled


def in_turn(
    first: Callable[[], object],
    second: Callable[[], object],
    repeats: int = 5,
    warm_up: bool = True,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[float, float]:
    """Return the median times [s] of two jobs that take turns, so that noise disturbs both alike."""
    times: tuple[list[float], list[float]] = ([], [])
    for repeat in range(repeats + warm_up):
        for job, taken in zip((first, second), times, strict=True):
            start = clock()
            job()
            if repeat >= warm_up:
                taken.append(clock() - start)
    return statistics.median(times[0]), statistics.median(times[1])
