"""Methods of a comparison, ready to run, and the cases that they run on: records under drawn noise."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.episode import Record
from twin.errors import InputError
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import DEVIATIONS_OF_95
from twin.estimation.knowledge import Case, CaseEstimator, IntervalEstimator, Knowledge
from twin.estimation.registry import MethodSpec
from twin.evaluation.protocol import RECORDED, Condition, Protocol
from twin.files.shown import shown
from twin.signals.noise import KINDS, draw_errors, noise_bound, noise_mean, noise_variance

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def group_records(records: Sequence[Record]) -> list[list[tuple[int, Record]]]:
    """Return the records of each stroke and kind of twin, with their numbers in the test set."""
    groups: dict[tuple[Any, str], list[tuple[int, Record]]] = {}
    for number, record in enumerate(records):
        groups.setdefault((record.stroke_mm, record.source), []).append((number, record))
    return list(groups.values())


def make_case(
    records: Sequence[tuple[int, Record]], protocol: Protocol, conditions: Sequence[Condition] = ()
) -> Case:
    """Return all runs of a group: records, then noises, then seeds; shorter records are padded."""
    conditions = conditions or protocol.conditions
    samples = max(len(record.time) for _, record in records)
    pulls, measurements, truths = [], [], []
    for number, record in records:
        rest = samples - len(record.time)
        measured = np.concatenate(
            [_measurements(condition, number, record, protocol) for condition in conditions]
        )
        measurements.append(np.pad(measured, ((0, 0), (0, rest)), constant_values=np.nan))
        shape = measurements[-1].shape
        pulls.append(np.broadcast_to(np.pad(record.pull_mm, (0, rest), mode="edge"), shape))
        truths.append(np.broadcast_to(np.pad(record.filled_deg, (0, rest), mode="edge"), shape))
    truth = np.concatenate(truths)

    def zero_deviation(kind: str, level: float) -> float:
        """Return the stated deviation of the noise's mean: its magnitude, without its sign."""
        return protocol.sensor_zero_deviation_deg if kind == RECORDED else abs(noise_mean(kind, level))

    def of_each_run(value: Callable[[str, float], float]) -> Array:
        values = np.repeat([value(kind, level) for kind, level in conditions], protocol.seeds)
        return np.tile(values, len(records))

    return Case(
        pull_mm=np.concatenate(pulls),
        measurement_deg=np.concatenate(measurements),
        initial_bend_deg=truth[:, 0] + protocol.initial_error_deg,
        sensor=Sensor(of_each_run(_variance), of_each_run(zero_deviation), of_each_run(_bound)),
        noises=tuple(condition for condition in conditions for _ in range(protocol.seeds)) * len(records),
        truth_deg=truth,
    )


def _measurements(condition: Condition, number: int, record: Record, protocol: Protocol) -> Array:
    """(seeds, N) measured angle [deg]: the truth with drawn noise, or the recorded measurements."""
    noise, level = condition
    if noise == RECORDED:
        if np.isnan(record.measured_deg).all():
            raise InputError(f"{record.name}: the record holds no measurement")
        return record.measured_deg[None]
    kind, truth, T = KINDS.index(noise), record.filled_deg, protocol.sample_time_s
    streams = [  # each seed has its own, whatever their number
        np.random.default_rng([protocol.seed, seed, number, kind, round(level * 1000)])
        for seed in range(protocol.seeds)
    ]
    drawn = np.stack([draw_errors(noise, level, truth, T, rng) for rng in streams])
    return np.where(record.known, truth + drawn, np.nan)


def _variance(kind: str, level: float) -> float:
    return level if kind == RECORDED else noise_variance(kind, level)


def _bound(kind: str, level: float) -> float:
    return np.inf if kind == RECORDED else noise_bound(kind, level)


def runs_of(case: Case, chosen: Mask) -> Case:
    """Return the runs of a case in a mask (B,), without the truth."""
    runs = np.flatnonzero(chosen)
    sensor = case.sensor.of_runs(runs)
    return Case(
        case.pull_mm[runs],
        case.measurement_deg[runs],
        np.asarray(case.initial_bend_deg)[runs],
        sensor,
        tuple(case.noises[run] for run in runs),
    )


class Estimates(NamedTuple):
    """Estimates of the B runs of a case."""

    bend_deg: Array  # (B, N) [deg]
    half_width_deg: Array | None = None  # (B, N) half of the 95 % intervals [deg]; None where none are stated
    # mean squared innovation of each first draw of a noise on a record in units of its stated variance, NaN
    # where there is none; None where it is not known
    nis: Array | None = None


@dataclasses.dataclass(frozen=True)
class Method:
    """A function of a case under a name."""

    name: str  # in the tables
    estimate: CaseEstimator  # returns (B, N) estimated angles [deg]
    oracle: bool = False  # whether it is shown the truth: such a row is labelled, and no deployable result
    given: tuple[str, ...] = ()  # what it knows, words of `twin.estimation.registry.GIVEN`
    others: tuple[CaseEstimator, ...] = ()  # further training runs, or ensembles: a row has mean and spread

    def run(self, case: Case, seeds: int, samples: range) -> Iterator[Estimates]:
        """Yield the estimates of each training run, those of the first with its innovations."""
        for place, estimate in enumerate((self.estimate, *self.others)):
            if place == 0 and isinstance(estimate, Filtering):
                yield estimate.with_innovations(case, seeds, samples)
            elif isinstance(estimate, IntervalEstimator):
                yield Estimates(*estimate.with_interval(case))
            else:
                yield Estimates(estimate(case))


@dataclasses.dataclass(frozen=True)
class Filtering:
    """An estimator as a function of a case, whose sensor it knows."""

    estimator: Estimator[Any]

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg]."""
        return self.with_interval(case)[0]

    def with_interval(self, case: Case) -> tuple[Array, Array | None]:
        """Return (B, N) estimated angles and half of their 95 % intervals [deg], or None."""
        filter_ = self.estimator.with_sensor(case.sensor)
        if not case.from_rest:
            filter_ = filter_.begun(from_rest=False)
        of_case = case.pull_mm, case.measurement_deg, case.initial_bend_deg
        if filter_.states_interval:
            return filter_.estimate_with_interval(*of_case)
        return filter_.estimate(*of_case), None

    def with_innovations(self, case: Case, seeds: int, samples: range) -> Estimates:
        """Return the estimates of a case, with the innovations of the first draws; see `Method.run`.

        An innovation takes a further step of the estimator, so that the first draws alone have one.
        """
        if not self.estimator.with_sensor(case.sensor).states_interval:
            return Estimates(*self.with_interval(case))
        once = np.arange(len(case.pull_mm)) % seeds == 0  # the first draw of each noise on each record
        drawn_first = runs_of(case, once)
        variance = np.broadcast_to(np.asarray(drawn_first.sensor.variance, dtype=float), once.sum())
        first_bend, first_half_width, squares = with_innovations(
            self.estimator.with_sensor(drawn_first.sensor),
            drawn_first.pull_mm.T,
            drawn_first.measurement_deg.T,
            np.asarray(drawn_first.initial_bend_deg),
            variance,
            samples,
        )
        bend, half_width = np.empty_like(case.measurement_deg), np.empty_like(case.measurement_deg)
        bend[once], half_width[once] = first_bend.T, first_half_width.T
        if not once.all():
            bend[~once], half_width[~once] = self.with_interval(runs_of(case, ~once))
        seen = ~np.isnan(squares)
        unknown = np.full(len(variance), np.nan)
        total = np.nansum(squares, axis=0)
        nis = np.divide(total, seen.sum(axis=0), out=unknown, where=seen.any(axis=0))
        return Estimates(bend, half_width, nis)


def as_method(name: str, estimator: Estimator[Any]) -> Method:
    """Return the method of an estimator that sees no truth."""
    return Method(name, Filtering(estimator))


def build_method(spec: MethodSpec, knowledge: Knowledge) -> Method:
    """Return a declared method, built from what is known before the test, once for each of its training runs.

    Each ensemble of twins counts as one: they differ by what is drawn, as training runs do.
    """
    count = len(knowledge.trained[spec.agent]) if spec.agent else 1
    if spec.ensembles:
        count = len(knowledge.ensembles)
    built = [spec.build(dataclasses.replace(knowledge, training=place)) for place in range(count)]
    for each in built:
        if not callable(each) and not isinstance(each, Estimator):
            rule = "must be an object of a class that derives from Estimator"
            raise InputError(f"method {spec.name!r}: its `build` returned {shown(each)}: {rule}")
    first, *others = [Filtering(each) if isinstance(each, Estimator) else each for each in built]
    return Method(spec.name, first, spec.oracle, spec.given, tuple(others))


def with_innovations(
    estimator: Estimator[Any],  # that states intervals, and knows its sensor already
    pull_mm: Array,  # (N, B) pulling distance [mm]
    measurement_deg: Array,  # (N, B) measured angle [deg]
    initial_bend_deg: Array,  # (B,) initial estimate [deg]
    variance: Array,  # (B,) R of the sensor [deg^2]
    samples: range | None = None,  # S, of which innovations are found, each by a further step
) -> tuple[Array, Array, Array]:
    """Filter records, and square innovations over their stated variance (Bar-Shalom et al. 2001).

    Their mean is 1 where prediction and sensor are as stated (NIS). The prediction is the estimate of a step
    without a measurement, with an interval of its own. Returns (N, B) angles and half of their 95 % intervals
    [deg], and (S, B) squares, NaN without measurement.
    """
    samples = range(1, len(pull_mm)) if samples is None else samples
    state = estimator.start(pull_mm[0], initial_bend_deg)
    bend, half_width = np.empty_like(measurement_deg), np.empty_like(measurement_deg)
    bend[0], half_width[0] = initial_bend_deg, estimator.half_width_deg(state)
    squares = np.empty((len(samples), pull_mm.shape[1]))
    missing = np.full(pull_mm.shape[1], np.nan)
    for k in range(1, len(pull_mm)):
        if k in samples:
            unseen = estimator.step(state, pull_mm[k], pull_mm[k - 1], missing)
            stated = (estimator.half_width_deg(unseen) / DEVIATIONS_OF_95) ** 2 + variance
            squares[samples.index(k)] = (measurement_deg[k] - estimator.bend_deg(unseen)) ** 2 / stated
        state = estimator.step(state, pull_mm[k], pull_mm[k - 1], measurement_deg[k])
        bend[k], half_width[k] = estimator.bend_deg(state), estimator.half_width_deg(state)
    return bend, half_width, squares
