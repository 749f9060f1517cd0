"""A method of the comparison: an estimator under its name in the tables, run on a case."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator
from twin.evaluation.case import Case

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Method:
    """An estimator under its name in the tables."""

    name: str
    estimate: Callable[[Case], Array]
    """Returns (B, N) estimated angles [deg]."""
    oracle: bool = False
    """Whether it is shown the truth: such a row is labelled, and no deployable result."""


@dataclasses.dataclass(frozen=True)
class Filtering:
    """An estimator, told of its sensor, on a case: what most methods do."""

    estimator: Estimator[Any]

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg]."""
        told = self.estimator.with_sensor(case.sensor)
        return told.estimate(case.pull_mm, case.measurement_deg, case.initial_bend_deg)


def as_method(name: str, estimator: Estimator[Any]) -> Method:
    """Return the method of an estimator that sees no truth."""
    return Method(name, Filtering(estimator))
