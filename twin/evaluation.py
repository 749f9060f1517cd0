"""The benchmark: every method on the same records under the same noise, scored against the clean truth."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator, Sensor
from twin.evaluation_record import EvaluationRecord
from twin.metrics import confidence_interval, error_indices
from twin.noise import NOISES, draw_noise, noise_bound, noise_variance
from twin.paper import paper_value
from twin.track import Track

Array = NDArray[np.float64]
Condition = tuple[str, float]
STEADY_SECONDS = 5.0
"""Left out of `rmse_steady_deg` [s]: the time in which the paper's AM loses the initial error."""

PAPER_CONDITIONS = (
    ("gaussian", 1.0),
    ("gaussian", 5.0),
    ("poisson", 0.1),
    ("poisson", 1.0),
    ("poisson", 2.0),
)
DITHERED_CONDITIONS = (("poisson-dithered", 0.1), ("poisson-dithered", 1.0), ("poisson-dithered", 2.0))
UNSEEN_CONDITIONS = (
    ("laplace", 1.0),
    ("student-t", 1.0),
    ("uniform", 1.0),
    ("salt-and-pepper", 0.05),
    ("gamma", 1.0),
)
SUITES = {
    "paper": PAPER_CONDITIONS + DITHERED_CONDITIONS,
    "paper-only": PAPER_CONDITIONS,
    "full": PAPER_CONDITIONS + UNSEEN_CONDITIONS,
}


@dataclasses.dataclass(frozen=True)
class Case:
    """What a method is given: B runs over records, each with its own draw of a noise."""

    pull_mm: Array
    """(B, N) commanded pulling distance [mm]."""
    measurement_deg: Array
    """(B, N) measured bending angle [deg]; NaN where there is none."""
    initial_bend_deg: Array
    """(B,) initial estimate, wrong on purpose [deg]."""
    sensor: Sensor
    """Variance and largest magnitude of each run's noise, which the filters are told."""
    noises: tuple[Condition, ...] = ()
    """Kind and level of each run's noise: for the limit alone, which knows all of it."""
    truth_deg: Array | None = None
    """(B, N) true angle [deg], given to oracles alone."""


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
        told = self.estimator.told(case.sensor)
        return told.estimate(case.pull_mm, case.measurement_deg, case.initial_bend_deg)


def filtering(name: str, estimator: Estimator[Any]) -> Method:
    """Return the method of an estimator that sees no truth."""
    return Method(name, Filtering(estimator))


@dataclasses.dataclass(frozen=True)
class Protocol:
    """How methods are compared; the defaults are the paper's, where it says."""

    suite: str = "paper"
    seeds: int = 20
    """Draws of the noise."""
    sample_time_s: float = 0.1
    initial_error_deg: float = 20.0
    """How far the initial estimate is off."""
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a protocol that cannot run.

        Raises:
            ValueError: the suite is unknown or a number is out of range.
        """
        if self.suite not in SUITES:
            raise ValueError(f"unknown suite {self.suite!r}; valid: {', '.join(SUITES)}")
        if self.seeds < 1:
            raise ValueError(f"seeds = {self.seeds}: must be at least 1")
        if not math.isfinite(self.initial_error_deg):
            raise ValueError(f"initial_error_deg = {self.initial_error_deg}: must be a finite number")
        if not 0 < self.sample_time_s < math.inf:
            raise ValueError(f"sample time {self.sample_time_s} s: must be positive and finite")


def evaluate(
    records: Sequence[EvaluationRecord],
    methods: Sequence[Method],
    protocol: Protocol,
    on_progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> tuple[list[dict[str, Any]], list[Track]]:
    """Run every method under every noise of the suite.

    Records of one stroke and one kind of twin are a group: their errors are pooled for each noise seed, and a
    row holds means over seeds. The sample at k = 0, the wrong initial estimate itself, is not scored, nor is
    one whose truth is not known.

    Args:
        records: the test set, at the protocol's sample time.
        methods: estimators, in the order of the table; picklable, where there is an executor.
        protocol: noises, seeds and initial error.
        on_progress: told how many of how many groups are done.
        executor: where groups are worked on side by side; without it, here, one after the other.

    Returns:
        Rows of `evaluation.json`, and for each noise the tracks of all methods on the first record and seed.
    """
    groups = list(group_records(records))
    results: list[Any] = [None] * len(groups)
    if on_progress:
        on_progress(0, len(groups))
    if executor is None:
        for place, group in enumerate(groups):
            results[place] = _evaluate_group(group, methods, protocol)
            if on_progress:
                on_progress(place + 1, len(groups))
    else:
        # The largest first: a long one that begins last would leave the other workers idle.
        order = sorted(range(len(groups)), key=lambda place: -len(groups[place]))
        futures = {executor.submit(_evaluate_group, groups[i], methods, protocol): i for i in order}
        for done, future in enumerate(as_completed(futures), start=1):
            results[futures[future]] = future.result()
            if on_progress:
                on_progress(done, len(groups))
    return [row for rows, _ in results for row in rows], results[0][1]


def make_case(
    records: Sequence[tuple[int, EvaluationRecord]], protocol: Protocol, conditions: Sequence[Condition] = ()
) -> Case:
    """Return all runs of a group: records, then noises, then seeds; shorter records are padded.

    Args:
        records: each with its number in the test set, which its noise is drawn by.
        protocol: noises, seeds and initial error.
        conditions: noises, if not all of the protocol's suite.
    """
    conditions = conditions or SUITES[protocol.suite]
    samples = max(len(record.pull_mm) for _, record in records)
    pulls, measurements, truths = [], [], []
    for number, record in records:
        rest = samples - len(record.pull_mm)
        noise = np.stack(
            [_draws(kind, level, number, len(record.pull_mm), protocol) for kind, level in conditions]
        )
        measured = np.where(record.seen, record.bend_deg + noise, np.nan).reshape(-1, len(record.pull_mm))
        measurements.append(np.pad(measured, ((0, 0), (0, rest)), constant_values=np.nan))
        pulls.append(np.broadcast_to(np.pad(record.pull_mm, (0, rest), mode="edge"), measurements[-1].shape))
        truths.append(
            np.broadcast_to(np.pad(record.bend_deg, (0, rest), mode="edge"), measurements[-1].shape)
        )
    truth = np.concatenate(truths)

    def of_each_run(value: Callable[[str, float], float]) -> Array:
        values = np.repeat([value(kind, level) for kind, level in conditions], protocol.seeds)
        return np.tile(values, len(records))

    return Case(
        pull_mm=np.concatenate(pulls),
        measurement_deg=np.concatenate(measurements),
        initial_bend_deg=truth[:, 0] + protocol.initial_error_deg,
        sensor=Sensor(of_each_run(noise_variance), of_each_run(noise_bound)),
        noises=tuple(condition for condition in conditions for _ in range(protocol.seeds)) * len(records),
        truth_deg=truth,
    )


def group_records(records: Sequence[EvaluationRecord]) -> list[list[tuple[int, EvaluationRecord]]]:
    """Return the records of each stroke and kind of twin, with their numbers in the test set."""
    groups: dict[tuple[Any, str], list[tuple[int, EvaluationRecord]]] = {}
    for number, record in enumerate(records):
        groups.setdefault((record.stroke_mm, record.twin), []).append((number, record))
    return list(groups.values())


def _evaluate_group(
    records: list[tuple[int, EvaluationRecord]], methods: Sequence[Method], protocol: Protocol
) -> tuple[list[dict[str, Any]], list[Track]]:
    conditions = SUITES[protocol.suite]
    shown = make_case(records, protocol)
    case = dataclasses.replace(shown, truth_deg=None)
    truth = shown.truth_deg
    assert truth is not None
    tracked = np.arange(len(conditions)) * protocol.seeds  # first record, first seed of each noise
    rows: dict[tuple[str, float], list[dict[str, Any]]] = {condition: [] for condition in conditions}
    tracks: dict[str, Array] = {}
    for method in methods:
        estimate = method.estimate(shown if method.oracle else case)
        tracks[method.name] = estimate[tracked]
        errors = (estimate - truth).reshape(len(records), len(conditions), protocol.seeds, -1)
        for place, condition in enumerate(conditions):
            row = _row(condition, method, [errors[r, place] for r in range(len(records))], records, protocol)
            rows[condition].append(row)
    first = records[0][1]
    time = np.arange(len(first.pull_mm), dtype=float) * protocol.sample_time_s
    return list(itertools.chain.from_iterable(rows.values())), [
        Track(
            *condition,
            time,
            first.bend_deg,
            case.measurement_deg[run, : len(time)],
            {name: estimate[place, : len(time)] for name, estimate in tracks.items()},
        )
        for place, (condition, run) in enumerate(zip(conditions, tracked, strict=True))
    ]


def _draws(noise: str, level: float, record: int, samples: int, protocol: Protocol) -> Array:
    """(seeds, N) noise [deg]; each seed has its own stream, whatever their number."""
    kind = list(NOISES).index(noise)
    streams = [
        np.random.default_rng([protocol.seed, seed, record, kind, round(level * 1000)])
        for seed in range(protocol.seeds)
    ]
    return np.stack([draw_noise(noise, level, (samples,), rng) for rng in streams])


def _row(
    condition: Condition,
    method: Method,
    errors: list[Array],
    records: Sequence[tuple[int, EvaluationRecord]],
    protocol: Protocol,
) -> dict[str, Any]:
    """Pool (seeds, N) errors of each record over time, and average the indices over seeds."""
    noise, level = condition

    def pooled(first: int) -> dict[str, Array]:
        scored = []
        for error, (_, record) in zip(errors, records, strict=True):
            begin = min(first, int(np.flatnonzero(record.seen)[-1]))  # a short record: its last sample
            scored.append(error[:, begin : len(record.seen)][:, record.seen[begin:]])
        return error_indices(np.concatenate(scored, axis=1))

    indices, late = pooled(1), pooled(round(STEADY_SECONDS / protocol.sample_time_s))
    if not np.isfinite(indices["rmse_deg"]).all():
        raise FloatingPointError(f"{method.name} under {noise} noise of {level:g}: not a finite estimate")
    low, high = confidence_interval(indices["rmse_deg"])
    first = records[0][1]
    return {
        "noise": noise,
        "level": level,
        "sample_time_s": protocol.sample_time_s,
        "stroke_mm": list(first.stroke_mm),
        "twin": first.twin,
        "method": method.name,
        "oracle": method.oracle,
        **{name: float(values.mean()) for name, values in indices.items()},
        "rmse_steady_deg": float(late["rmse_deg"].mean()),
        "rmse_ci95_deg": [low, high],
        "seeds": protocol.seeds,
        "paper_rmse_deg": None if method.oracle else paper_value(noise, level, method.name, "rmse_deg"),
    }
