"""A good stream of an endoscope without end, and all that can go wrong with it."""

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from models import COLEMAN_HODGDON
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator
from twin.estimation.gaussian import Belief
from twin.estimation.health import Health
from twin.estimation.koopman import KoopmanFilter
from twin.estimation.online import OnlineEstimator
from twin.estimation.set_membership import Ellipsoid

Array = NDArray[np.float64]
Sample = tuple[Any, Any, Any]
"""Time [s], pull [mm] and measurement [deg] as they are pushed."""
HOSTILE = (
    *(1e300, -1e300, 1.7e308, 1e20, 1e12, -1e12, 1e9, 1e5, 720.1, -720.1, 719.0, -719.0, 200.1, 150.0),
    *(-150.0, 40.0, -3.0, 0.0, -0.0, 5e-324, -5e-324, 1e-12, math.inf, -math.inf, math.nan, 2**63, 10**400),
)
NOISE_DEG = math.sqrt(0.1)


@dataclasses.dataclass(frozen=True)
class GoodStream:
    """Samples that repeat without end, and what an estimator that nothing disturbs makes of them.

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
    """Return a stream that repeats after 100 s, and what an undisturbed estimator makes of it."""
    count = round(100 / sample_time)
    time = np.arange(2 * count) * sample_time
    pull = 3 + np.sin(2 * np.pi * time / 10)
    truth = COLEMAN_HODGDON.response(pull, 60.0) + 2 * np.sin(2 * np.pi * time / 20)
    measurement = truth + NOISE_DEG * np.random.default_rng(seed).standard_normal(2 * count)
    estimate = Estimator.estimate(estimator, pull, measurement, truth[0] + 5)[0]
    turn = slice(count, None)
    error = max(float(np.sqrt(np.mean((estimate - truth)[turn] ** 2))), 0.05)
    return GoodStream(sample_time, pull[turn], truth[turn], measurement[turn], estimate[turn], error)


Fault = Callable[[GoodStream, int, int, np.random.Generator], Iterator[Sample]]
"""Yields what comes in the place of `count` samples from sample `k` on."""


def _hostile(rng: np.random.Generator) -> Any:
    return HOSTILE[rng.integers(len(HOSTILE))]


def anything(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Any field of any sample may hold any number."""
    share = rng.uniform(0.05, 1)
    for i in range(count):
        good = stream.at(k + i)
        yield tuple(_hostile(rng) if rng.random() < share else value for value in good)


def wild_measurements(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Measurements all over the plausible range and beyond it."""
    for i in range(count):
        time, pull, _ = stream.at(k + i)
        yield time, pull, rng.uniform(-800, 800)


def constant_measurement(
    stream: GoodStream, k: int, count: int, rng: np.random.Generator
) -> Iterator[Sample]:
    """One plausible measurement, again and again."""
    lie = rng.uniform(-719, 719)
    for i in range(count):
        time, pull, _ = stream.at(k + i)
        yield time, pull, lie


def stuck_sensor(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """The last good measurement, again and again."""
    for i in range(count):
        time, pull, _ = stream.at(k + i)
        yield time, pull, stream.at(k - 1)[2]


def shifted_sensor(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Measurements that are off by a constant."""
    shift = rng.choice([-1, 1]) * rng.uniform(5, 90)
    for i in range(count):
        time, pull, measurement = stream.at(k + i)
        yield time, pull, measurement + shift


def wild_pulls(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Pulls all over the plausible range and beyond it."""
    for i in range(count):
        time, _, measurement = stream.at(k + i)
        yield time, rng.uniform(-250, 250), measurement


def constant_pull(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """One plausible pull, again and again."""
    lie = rng.choice([-150.0, 150.0, rng.uniform(-200, 200), rng.uniform(0, 6)])
    for i in range(count):
        time, _, measurement = stream.at(k + i)
        yield time, float(lie), measurement


def flipped_pull(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Pulls of the wrong sign."""
    for i in range(count):
        time, pull, measurement = stream.at(k + i)
        yield time, -pull, measurement


def drop_out(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """No measurement, or no pull, or neither."""
    what = rng.integers(3)
    for i in range(count):
        time, pull, measurement = stream.at(k + i)
        yield time, pull if what != 1 else math.nan, measurement if what == 1 else math.nan


def silence(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Nothing at all."""
    return iter(())


def late_packets(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Packets twice, and in any order."""
    for i in range(count):
        yield stream.at(k + int(rng.integers(max(i - 9, -k), i + 1)))


def another_clock(stream: GoodStream, k: int, count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Good samples on a clock that is off by anything, or that stands."""
    jump = rng.choice([1e12, -1e12, 1e9, -1e9, 1e5, -1e5, 3600.0, -3600.0, 1.0, -1.0, 1e-9, math.nan])
    scale = rng.choice([1.0, 1.0, 0.0, 1e-12, 1e6])
    for i in range(count):
        time, pull, measurement = stream.at(k + i)
        yield (time - stream.at(k)[0]) * scale + stream.at(k)[0] + jump, pull, measurement


FAULTS: tuple[Fault, ...] = (
    *(anything, wild_measurements, constant_measurement, stuck_sensor, shifted_sensor, wild_pulls),
    *(constant_pull, flipped_pull, drop_out, silence, late_packets, another_clock),
)
LASTING = (1, 2, 5, 10, 30, 100)
"""Samples that a fault lasts."""
RECOVERY_S = 5.0


def numbers_of(state: Any) -> Iterator[Array]:
    """Yield all arrays and numbers of a state, however deep, apart from parameters of estimators."""
    if isinstance(state, np.ndarray | float | int | np.generic):
        yield np.asarray(state)
    elif isinstance(state, tuple):
        for part in state:
            yield from numbers_of(part)
    elif hasattr(state, "__dict__") and not isinstance(state, Estimator):
        for part in vars(state).values():
            yield from numbers_of(part)


def covariances_of(state: Any) -> Iterator[Array]:
    """Yield all (n, n) covariances and shapes of ellipsoids of a state of one filter."""
    if isinstance(state, Belief | Ellipsoid):
        yield (state.covariance if isinstance(state, Belief) else state.shape)[:, :, 0]
    elif isinstance(state, tuple):
        for part in state:
            yield from covariances_of(part)
    elif hasattr(state, "__dict__") and not isinstance(state, Estimator):
        for part in vars(state).values():
            yield from covariances_of(part)


def check(live: OnlineEstimator[Any], lifted: bool) -> None:
    """Assert that a stream is sound in every number, and that its counters add up."""
    assert math.isfinite(live.bend_deg)
    assert live.pushed == live.ignored + live.waiting + live.first + live.steps
    for values in numbers_of(live.state):
        assert np.isfinite(values).all()
    for covariance in covariances_of(live.state):
        values = np.linalg.eigvalsh(covariance)
        # A lifted state begins with all its angles equal: its first covariances have rank one.
        assert values.min() > (-1e-9 * values.max() if lifted else 0)


def run_faulty(
    estimator: Estimator[Any], sample_time: float, samples: int, seed: int
) -> tuple[OnlineEstimator[Any], dict[str, float]]:
    """Push samples, good ones and faults of all kinds in turn, and check the stream throughout.

    Returns:
        The stream, and by fault the largest distance from the undisturbed estimate after 5 s of good samples,
        in its standard deviations.
    """
    stream, rng = good_stream(estimator, sample_time), np.random.default_rng(seed)
    live = OnlineEstimator(estimator, sample_time, float(stream.bend_deg[0]) + 5)
    lifted = isinstance(estimator, KoopmanFilter)
    recovery = round(RECOVERY_S / sample_time)
    off = {fault.__name__: 0.0 for fault in FAULTS}
    k = len(stream.pull_mm)
    for good in range(k):
        live.push(*stream.at(good))
    assert live.first + live.steps == k
    episode = 0
    while live.pushed < samples or episode < len(FAULTS):
        fault = FAULTS[episode % len(FAULTS)]
        count = int(rng.choice(LASTING))
        for sample in fault(stream, k, count, rng):
            before = live.pushed
            live.push(*sample)
            assert live.pushed == before + 1
            assert math.isfinite(live.bend_deg)
            check(live, lifted)
        k += count
        for good in range(k, k + recovery):
            live.push(*stream.at(good))
        check(live, lifted)
        k += recovery
        off[fault.__name__] = max(off[fault.__name__], stream.off(k - 1, live.bend_deg))
        for good in range(k, k + 2 * recovery):
            live.push(*stream.at(good))
        assert live.health == Health.GOOD
        k += 2 * recovery
        episode += 1
    return live, off
