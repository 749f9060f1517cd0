"""A method of the comparison, ready to run: an estimator under its name in the tables."""

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator
from twin.estimation.knowledge import Case, CaseEstimator, IntervalEstimator, Knowledge
from twin.estimation.registry import MethodSpec
from twin.evaluation.case import first_draws, runs_of
from twin.evaluation.innovations import with_innovations

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

    def run(self, case: Case, seeds: int, samples: range) -> Iterator["Ran"]:
        """Yield what each training makes of a case, the first with its innovations.

        Args:
            case: of runs; under each noise on each record `seeds` draws, one after the other.
            seeds: draws.
            samples: at which innovations are found, from 1 on.
        """
        for place, estimate in enumerate((self.estimate, *self.others)):
            if place == 0 and isinstance(estimate, Filtering):
                yield estimate.with_innovations(case, seeds, samples)
            elif isinstance(estimate, IntervalEstimator):
                yield Ran(*estimate.with_interval(case))
            else:
                yield Ran(estimate(case))


class Ran(NamedTuple):
    """Estimates of the B runs of a case.

    Attributes:
        bend_deg: (B, N) [deg].
        half_width_deg: (B, N) half of the 95 % intervals [deg]; None where none are stated.
        nis: mean squared innovation of each first draw of a noise on a record (`first_draws`), in units of
            what is stated, NaN where none is; None where it is not known.
    """

    bend_deg: Array
    half_width_deg: Array | None = None
    nis: Array | None = None


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

    def with_innovations(self, case: Case, seeds: int, samples: range) -> Ran:
        """Return the estimates of a case, with the innovations of the first draws.

        An innovation takes a further step of the estimator, so that the first draws alone have one.

        Args:
            case: as `Method.run` takes it.
            seeds: draws of each noise on each record.
            samples: at which innovations are found, from 1 on.
        """
        told = self.estimator.with_sensor(case.sensor)
        if not told.states_interval:
            return Ran(*self.with_interval(case))
        once = first_draws(case, seeds)
        drawn_first = runs_of(case, once)
        variance = np.broadcast_to(np.asarray(drawn_first.sensor.variance, dtype=float), once.sum())
        pull, measured = drawn_first.pull_mm.T, drawn_first.measurement_deg.T
        initial = np.asarray(drawn_first.initial_bend_deg)
        filter_ = self.estimator.with_sensor(drawn_first.sensor)
        found = with_innovations(filter_, pull, measured, initial, variance, samples)
        bend, half_width = np.empty_like(case.measurement_deg), np.empty_like(case.measurement_deg)
        bend[once], half_width[once] = found.bend_deg.T, found.half_width_deg.T
        if not once.all():
            bend[~once], half_width[~once] = self.with_interval(runs_of(case, ~once))
        seen = ~np.isnan(found.squares)
        nothing = np.full(len(variance), np.nan)
        total = np.nansum(found.squares, axis=0)
        nis = np.divide(total, seen.sum(axis=0), out=nothing, where=seen.any(axis=0))
        return Ran(bend, half_width, nis)


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
