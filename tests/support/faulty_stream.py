"""A good stream of an endoscope without end, and all that can go wrong with it."""

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from models import COLEMAN_HODGDON
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator
from twin.live.online import OnlineEstimator
from twin.live.reading import Health

Array = NDArray[np.float64]
Sample = tuple[Any, Any, Any]
"""Time [s], pull [mm] and measurement [deg] as they are pushed."""
HOSTILE = (
    *(1e300, -1e300, 1.7e308, 1e20, 1e12, -1e12, 1e9, 1e5, 720.1, -720.1, 719.0, -719.0, 200.1, 150.0),
    *(-150.0, 40.0, -3.0, 0.0, -0.0, 5e-324, -5e-324, 1e-12, math.inf, -math.inf, math.nan, 2**63, 10**400),
)
NOISE_DEG = math.sqrt(0.1)
TURN_S = 40.0  # after which the stream repeats
RECOVERY_S = 5.0
LASTING = (1, 2, 5, 10, 30, 100)
"""Samples that a fault lasts."""


@dataclasses.dataclass(frozen=True)
class GoodStream:
    """Samples that repeat without end, and what an undisturbed estimator makes of them.

    Attributes:
        sample_time: T [s].
        pull_mm: (N,) of one turn.
        bend_deg: (N,) truth.
        measurement_deg: (N,) with noise of the sensor.
        estimate_deg: (N,) undisturbed.
        error_deg: root mean square error of that.
    """

    sample_time: float
    pull_mm: Array
    bend_deg: Array
    measurement_deg: Array
    estimate_deg: Array
    error_deg: float

    def at(self, k: int) -> Sample:
        """Return sample k of the stream."""
        place = k % len(self.pull_mm)
        return k * self.sample_time, float(self.pull_mm[place]), float(self.measurement_deg[place])

    def off(self, k: int, bend_deg: float) -> float:
        """Return how far an estimate at sample k is from the undisturbed one, in standard deviations."""
        return abs(bend_deg - float(self.estimate_deg[k % len(self.pull_mm)])) / self.error_deg


def good_stream(estimator: Estimator[Any], sample_time: float, seed: int = 0) -> GoodStream:
    """Return a stream that repeats, and what an undisturbed estimator makes of it."""
    count = round(TURN_S / sample_time)
    time = np.arange(2 * count) * sample_time
    pull = 3 + np.sin(2 * np.pi * time / 10)
    truth = COLEMAN_HODGDON.response(pull, 60.0) + 2 * np.sin(2 * np.pi * time / 20)
    measurement = truth + NOISE_DEG * np.random.default_rng(seed).standard_normal(2 * count)
    estimate = Estimator.estimate(estimator, pull, measurement, truth[0] + 5)[0]
    turn = slice(count, None)
    error = max(float(np.sqrt(np.mean((estimate - truth)[turn] ** 2))), 0.05)
    return GoodStream(sample_time, pull[turn], truth[turn], measurement[turn], estimate[turn], error)


Fault = Callable[[list[Sample], list[Sample], np.random.Generator], Iterator[Sample]]
"""Yields what comes in the place of good samples, given these and the ten before them."""


def anything(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """Any field of any sample may have any number."""
    share = rng.uniform(0.05, 1)
    for sample in good:
        yield tuple(
            HOSTILE[rng.integers(len(HOSTILE))] if rng.random() < share else value for value in sample
        )


def wild_measurements(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """Measurements all over the plausible range and beyond it."""
    return ((time, pull, rng.uniform(-800, 800)) for time, pull, _ in good)


def constant_measurement(
    good: list[Sample], before: list[Sample], rng: np.random.Generator
) -> Iterator[Sample]:
    """One measurement again and again: a plausible one, or the last good one."""
    wrong = rng.choice([rng.uniform(-719, 719), before[-1][2]])
    return ((time, pull, float(wrong)) for time, pull, _ in good)


def shifted_sensor(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """Measurements that are off by a constant."""
    shift = rng.choice([-1, 1]) * rng.uniform(5, 90)
    return ((time, pull, measured + shift) for time, pull, measured in good)


def wild_pulls(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """Pulls all over the plausible range and beyond it."""
    return ((time, rng.uniform(-250, 250), measured) for time, _, measured in good)


def constant_pull(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """One plausible pull, again and again."""
    wrong = float(rng.choice([-150.0, 150.0, rng.uniform(-200, 200), rng.uniform(0, 6)]))
    return ((time, wrong, measured) for time, _, measured in good)


def flipped_pull(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """Pulls of the wrong sign."""
    return ((time, -pull, measured) for time, pull, measured in good)


def drop_out(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """No measurement, or no pull, or neither."""
    what = rng.integers(3)
    for time, pull, measured in good:
        yield time, pull if what != 1 else math.nan, measured if what == 1 else math.nan


def silence(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """Nothing at all."""
    return iter(())


def late_packets(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """Packets twice, and in any order."""
    sent = before + good
    return (sent[len(before) + int(rng.integers(i - 9, i + 1))] for i in range(len(good)))


def another_clock(good: list[Sample], before: list[Sample], rng: np.random.Generator) -> Iterator[Sample]:
    """Good samples on a clock that is off by anything, or that stands."""
    jump = rng.choice([1e12, -1e12, 1e9, -1e9, 1e5, -1e5, 3600.0, -3600.0, 1.0, -1.0, 1e-9, math.nan])
    scale, first = rng.choice([1.0, 1.0, 0.0, 1e-12, 1e6]), good[0][0]
    return (((time - first) * scale + first + jump, pull, measured) for time, pull, measured in good)


FAULTS: tuple[Fault, ...] = (
    *(anything, wild_measurements, constant_measurement, shifted_sensor, wild_pulls, constant_pull),
    *(flipped_pull, drop_out, silence, late_packets, another_clock),
)


def run_faulty(
    estimator: Estimator[Any], sample_time: float, samples: int, seed: int
) -> tuple[OnlineEstimator[Any], dict[str, float]]:
    """Push at least so many samples, good ones and faults of all kinds in turn, and check the stream.

    Returns:
        The stream, and by fault the largest distance from the undisturbed estimate after 5 s of good samples,
        in its standard deviations.
    """
    stream, rng = good_stream(estimator, sample_time), np.random.default_rng(seed)
    live = OnlineEstimator(estimator, sample_time, float(stream.bend_deg[0]) + 5)
    recovery = round(RECOVERY_S / sample_time)
    off = {fault.__name__: 0.0 for fault in FAULTS}
    k = 2 * len(stream.pull_mm)
    for good in range(k):
        live.push(*stream.at(good))
    assert live.steps == k - 1
    episode = 0
    while live.pushed < samples or episode < len(FAULTS):
        fault = FAULTS[episode % len(FAULTS)]
        count = int(rng.choice(LASTING))
        replaced = [stream.at(k + i) for i in range(count)]
        for sample in fault(replaced, [stream.at(k - i) for i in range(10, 0, -1)], rng):
            assert math.isfinite(live.push(*sample))
            assert live.form.is_sound(live.state)
        k += count
        for good in range(k, k + recovery):
            live.push(*stream.at(good))
        k += recovery
        off[fault.__name__] = max(off[fault.__name__], stream.off(k - 1, live.bend_deg))
        for good in range(k, k + 2 * recovery):
            live.push(*stream.at(good))
        assert live.health == Health.GOOD
        assert live.pushed == live.ignored + live.steps + 1
        k += 2 * recovery
        episode += 1
    return live, off
