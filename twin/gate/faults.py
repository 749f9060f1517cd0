"""Faults of a live stream that the gate plants: what comes in the place of good samples."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

Sample = tuple[float, float, float]
"""Time [s], pull [mm] and measurement [deg]."""
Samples = Sequence[Sample]

SPIKE_DEG = 60.0
WRONG_PULL_MM = 5.0
CLOCK_S = 3600.0
SHIFT_DEG = 8.0


class Fault(NamedTuple):
    """One kind of fault.

    Attributes:
        name: of it.
        seconds: that it lasts.
        plant: yields what comes in the place of good samples, given those before them.
        must_flag: whether the runtime has to say that something is wrong; a sensor that is a few degrees off
            cannot be told from a good one.
    """

    name: str
    seconds: float
    plant: Callable[[Samples, Samples], Iterator[Sample]]
    must_flag: bool = True


def _no_measurement(good: Samples, before: Samples) -> Iterator[Sample]:
    return ((time, pull, math.nan) for time, pull, _ in good)


def _no_pull(good: Samples, before: Samples) -> Iterator[Sample]:
    return ((time, math.nan, measured) for time, _, measured in good)


def _spikes(good: Samples, before: Samples) -> Iterator[Sample]:
    for number, (time, pull, measured) in enumerate(good):
        spike = SPIKE_DEG * (1 if number % 8 else -1) if number % 4 == 0 else 0.0
        yield time, pull, measured + spike


def _stuck(good: Samples, before: Samples) -> Iterator[Sample]:
    last = before[-1][2]
    return ((time, pull, last) for time, pull, _ in good)


def _out_of_order(good: Samples, before: Samples) -> Iterator[Sample]:
    """Each pair of samples in the wrong order, and every third sample twice."""
    for number in range(0, len(good) - 1, 2):
        yield good[number + 1]
        yield good[number]
        if number % 3 == 0:
            yield good[number]


def _late(good: Samples, before: Samples) -> Iterator[Sample]:
    """The samples of a second ago once more."""
    behind = list(before)[-len(good) :]
    return ((time, pull, measured) for time, pull, measured in behind)


def _silence(good: Samples, before: Samples) -> Iterator[Sample]:
    return iter(())


def _another_clock(good: Samples, before: Samples) -> Iterator[Sample]:
    return ((time - CLOCK_S, pull, measured) for time, pull, measured in good)


def _wrong_pull(good: Samples, before: Samples) -> Iterator[Sample]:
    for number, (time, pull, measured) in enumerate(good):
        yield time, pull + (WRONG_PULL_MM if number % 2 else -WRONG_PULL_MM), measured


def _shifted(good: Samples, before: Samples) -> Iterator[Sample]:
    return ((time, pull, measured + SHIFT_DEG) for time, pull, measured in good)


FAULTS = (
    Fault("no measurement", 3.0, _no_measurement),
    Fault("spikes of the sensor", 3.0, _spikes),
    Fault("stuck sensor", 4.0, _stuck),
    Fault("samples late", 1.0, _late),
    Fault("samples twice and out of order", 3.0, _out_of_order),
    Fault("gap", 3.0, _silence),
    Fault("jump of the clock", 0.5, _another_clock),
    Fault("wrong pull", 0.4, _wrong_pull),
    Fault("no pull", 0.5, _no_pull),
    Fault("sensor off by 8 deg", 3.0, _shifted, must_flag=False),
)
"""Kinds of fault, each planted by itself."""
