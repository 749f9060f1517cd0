"""Faults that are planted into a good stream of samples, each of a kind that a deployed estimator meets."""

import math
from collections.abc import Callable, Iterator

import numpy as np

Sample = tuple[float, float, float]
"""Time [s], pull [mm] and measurement [deg]."""
Fault = Callable[[list[Sample], np.random.Generator], Iterator[tuple[Sample, bool]]]
"""Yields what comes in the place of good samples, and whether it is faulty."""


def no_measurement(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """NaN in the place of each measurement."""
    for time, pull, _ in good:
        yield (time, pull, math.nan), True


def no_pull(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """NaN in the place of each pull."""
    for time, _, measurement in good:
        yield (time, math.nan, measurement), True


def spikes(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """Measurements that are off by 15 to 90 deg, each for itself."""
    for time, pull, measurement in good:
        yield (time, pull, measurement + rng.choice([-1, 1]) * rng.uniform(15, 90)), True


def stuck(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """The first measurement again and again; the first is good."""
    for place, (time, pull, _) in enumerate(good):
        yield (time, pull, good[0][2]), place > 0


def infinite(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """Infinite or huge numbers in the place of measurements."""
    for time, pull, _ in good:
        yield (time, pull, float(rng.choice([math.inf, -math.inf, 1e300, -1e5]))), True


def repeated(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """Each packet twice."""
    for sample in good:
        yield sample, False
        yield sample, True


def out_of_order(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """Pairs of packets the wrong way round."""
    for first, second in zip(good[::2], good[1::2], strict=False):
        yield second, False
        yield first, True


def clock_jump(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """Stamps that go back by an hour, or no date at all."""
    wrong = float(rng.choice([-3600.0, 1e12, math.nan]))
    for time, pull, measurement in good[:3]:
        yield (time + wrong, pull, measurement), True


def silence(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    """Nothing until the last sample, which ends the gap."""
    if len(good) > 1:
        yield good[-1], True


FAULTS: tuple[Fault, ...] = (
    *(no_measurement, no_pull, spikes, stuck, infinite, repeated, out_of_order, clock_jump, silence),
)
