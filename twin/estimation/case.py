"""A case of the comparison: measurements of B runs, and what a method is told of them."""

import dataclasses
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Sensor

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Case:
    """B runs over records, each with its own measurements.

    Attributes:
        pull_mm: (B, N) commanded pulling distance [mm].
        measurement_deg: (B, N) measured bending angle, NaN where there is none [deg].
        initial_bend_deg: (B,) initial estimate, wrong on purpose [deg].
        sensor: variance and largest magnitude of each run's noise, which the filters are told.
        noises: (B,) kind and level of each run's noise: for the limit alone, which knows all of it.
        truth_deg: (B, N) true angle, given to oracles alone [deg].
    """

    pull_mm: Array
    measurement_deg: Array
    initial_bend_deg: Array
    sensor: Sensor
    noises: tuple[tuple[str, float], ...] = ()
    truth_deg: Array | None = None


CaseEstimator = Callable[[Case], Array]
"""Returns (B, N) estimated angles [deg] of a case."""


@runtime_checkable
class IntervalEstimator(Protocol):
    """An estimator of a case that may also say how sure it is."""

    def with_interval(self, case: Case) -> tuple[Array, Array | None]:
        """Return (B, N) estimated angles and half of their 95 % intervals [deg], or None."""
