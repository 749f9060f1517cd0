"""A method of the comparison, ready to run: an estimator under its name in the tables."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.case import Case, CaseEstimator
from twin.estimation.estimator import Estimator
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Method:
    """A function of a case under a name.

    Attributes:
        name: in the tables.
        estimate: returns (B, N) estimated angles [deg].
        oracle: whether it is shown the truth: such a row is labelled, and no deployable result.
    """

    name: str
    estimate: CaseEstimator
    oracle: bool = False

    def run(self, case: Case) -> tuple[Array, Array | None]:
        """Return (B, N) estimated angles and half of their 95 % intervals [deg], or None."""
        if isinstance(self.estimate, Filtering):
            return self.estimate.with_interval(case)
        return self.estimate(case), None


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


def as_method(name: str, estimator: Estimator[Any]) -> Method:
    """Return the method of an estimator that sees no truth."""
    return Method(name, Filtering(estimator))


def build_method(spec: MethodSpec, knowledge: Knowledge) -> Method:
    """Return a declared method, built from what is known before the test."""
    built = spec.build(knowledge)
    run: CaseEstimator = Filtering(built) if isinstance(built, Estimator) else built
    return Method(spec.name, run, spec.oracle)
