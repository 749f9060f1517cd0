"""A method of the comparison, ready to run: an estimator under its name in the tables."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.case import Case, CaseEstimator, IntervalEstimator
from twin.estimation.estimator import Estimator
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec
from twin.evaluation.innovations import squared_innovations

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Method:
    """A function of a case under a name.

    Attributes:
        name: in the tables.
        estimate: returns (B, N) estimated angles [deg].
        oracle: whether it is shown the truth: such a row is labelled, and no deployable result.
        others: further trainings of the same method, or ensembles: its row has their mean and spread.
    """

    name: str
    estimate: CaseEstimator
    oracle: bool = False
    others: tuple[CaseEstimator, ...] = ()

    def run(self, case: Case) -> Iterator[tuple[Array, Array | None]]:
        """Yield (B, N) estimated angles and half of their 95 % intervals [deg], or None, of each training."""
        for estimate in (self.estimate, *self.others):
            if isinstance(estimate, IntervalEstimator):
                yield estimate.with_interval(case)
            else:
                yield estimate(case), None


@dataclasses.dataclass(frozen=True)
class Filtering:
    """An estimator that is told of its sensor and run on a case.

    Attributes:
        estimator: before it is told.
    """

    estimator: Estimator[Any]

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg]."""
        return self.with_interval(case)[0]

    def with_interval(self, case: Case) -> tuple[Array, Array | None]:
        """Return (B, N) estimated angles and half of their 95 % intervals [deg], or None."""
        filter_ = self.estimator.with_sensor(case.sensor)
        of_case = case.pull_mm, case.measurement_deg, case.initial_bend_deg
        if filter_.states_interval:
            return filter_.estimate_with_interval(*of_case)
        return filter_.estimate(*of_case), None

    def nis(self, case: Case, first: int) -> Array | None:
        """Return the (B,) mean squared innovations of runs from a sample on; None where none are stated."""
        filter_ = self.estimator.with_sensor(case.sensor)
        if not filter_.states_interval:
            return None
        variance = np.broadcast_to(np.asarray(case.sensor.variance, dtype=float), len(case.pull_mm))
        measured = case.measurement_deg.T
        initial = np.asarray(case.initial_bend_deg)
        squares = squared_innovations(filter_, case.pull_mm.T, measured, initial, variance, first)
        seen = ~np.isnan(squares)
        nothing = np.full(len(case.pull_mm), np.nan)
        mean: Array = np.divide(
            np.nansum(squares, axis=0), seen.sum(axis=0), out=nothing, where=seen.any(axis=0)
        )
        return mean


def as_method(name: str, estimator: Estimator[Any]) -> Method:
    """Return the method of an estimator that sees no truth."""
    return Method(name, Filtering(estimator))


def build_method(spec: MethodSpec, knowledge: Knowledge) -> Method:
    """Return a declared method, built from what is known before the test, once for each of its trainings.

    Each ensemble of twins counts as one: they differ by what is drawn, as trainings do.
    """
    count = len(knowledge.trained[spec.agent]) if spec.agent else 1
    if spec.ensembles:
        count = len(knowledge.ensembles)
    built = [spec.build(dataclasses.replace(knowledge, training=place)) for place in range(count)]
    first, *others = [Filtering(each) if isinstance(each, Estimator) else each for each in built]
    return Method(spec.name, first, spec.oracle, tuple(others))
