"""The benchmark: every method on the same records under the same noise, scored against the clean truth."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError
from twin.evaluation.case import group_records, make_case
from twin.evaluation.method import Method
from twin.evaluation.metrics import confidence_interval, error_indices, interval_indices
from twin.evaluation.paper import INSTRUMENT, paper_value
from twin.evaluation.protocol import STEADY_SECONDS, Condition, Protocol
from twin.evaluation.ranking import Ranking, rank_methods
from twin.evaluation.record import EvaluationRecord
from twin.evaluation.score import Score
from twin.evaluation.track import Track
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]

INNOVATION_SECONDS = 0.1
"""Time from one sample whose innovation is found to the next, as each takes a further step [s]."""


class ScoredRuns(NamedTuple):
    """Result of a comparison.

    Attributes:
        scores: of every method under every noise, group by group.
        tracks: for each noise those of all methods on the first record and seed.
        rankings: of every group.
        squares: mean square errors that each score rests on: (K, R, S) of K trainings on R records under S
            draws of the noise; a record counts as much as it has samples [deg^2].
    """

    scores: list[Score]
    tracks: list[Track]
    rankings: list[Ranking]
    squares: list[Array]


def evaluate(
    records: Sequence[EvaluationRecord],
    methods: Sequence[Method],
    protocol: Protocol,
    on_progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> ScoredRuns:
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
    return ScoredRuns(
        [row for result in results for row in result.scores],
        results[0].tracks,
        [ranking for result in results for ranking in result.rankings],
        [squares for result in results for squares in result.squares],
    )


def _evaluate_group(
    records: list[tuple[int, EvaluationRecord]], methods: Sequence[Method], protocol: Protocol
) -> ScoredRuns:
    conditions = protocol.conditions
    shown = make_case(records, protocol)
    case = dataclasses.replace(shown, truth_deg=None)
    truth = shown.truth_deg
    assert truth is not None
    tracked = np.arange(len(conditions)) * protocol.seeds  # first record, first seed of each noise
    scores: dict[tuple[Condition, str], Score] = {}
    squares: dict[str, Array] = {}
    tracks: dict[str, Array] = {}
    late, every = (max(round(of / protocol.sample_time_s), 1) for of in (STEADY_SECONDS, INNOVATION_SECONDS))
    samples = range(late, case.pull_mm.shape[1], every)
    for method in methods:
        given = shown if method.oracle else case
        estimates, half_widths, (nis, *_) = zip(*method.run(given, protocol.seeds, samples), strict=True)
        tracks[method.name] = estimates[0][tracked]
        shape = (len(estimates), len(records), len(conditions), protocol.seeds, -1)
        errors = (np.array(estimates) - truth).reshape(shape)
        stated = None if half_widths[0] is None else np.array(half_widths).reshape(shape)
        for place, condition in enumerate(conditions):
            of_condition = [errors[:, r, place] for r in range(len(records))]
            intervals = None if stated is None else [stated[:, r, place] for r in range(len(records))]
            row = _row(condition, method, of_condition, intervals, records, protocol)
            if nis is not None:
                of_runs = nis[place :: len(conditions)]
                known = of_runs[~np.isnan(of_runs)]
                row = dataclasses.replace(row, nis=float(known.mean()) if known.size else None)
            scores[condition, method.name] = row
        squares[method.name] = _squares(errors, [record.seen for _, record in records])
    oracles = [method.name for method in methods if method.oracle]
    rng = random_stream(protocol.seed, SeedUse.RANKS, records[0][0])
    ranked = rank_methods(squares, oracles, rng)
    first = records[0][1]
    time = np.arange(len(first.pull_mm), dtype=float) * protocol.sample_time_s
    order = list(itertools.product(range(len(conditions)), ranked))
    told = [
        dataclasses.replace(scores[conditions[place], of.method], to_best_ci95=of.noise_to_best_ci95[place])
        for place, of in order
    ]
    shown_tracks = [
        Track(
            *condition,
            time,
            first.bend_deg,
            case.measurement_deg[run, : len(time)],
            {name: estimate[place, : len(time)] for name, estimate in tracks.items()},
        )
        for place, (condition, run) in enumerate(zip(conditions, tracked, strict=True))
    ]
    ranking = Ranking(protocol.sample_time_s, first.stroke_mm, first.twin, tuple(ranked))
    return ScoredRuns(told, shown_tracks, [ranking], [squares[of.method][:, place] for place, of in order])


def _squares(errors: Array, seen: Sequence[NDArray[np.bool_]]) -> Array:
    """Return (K, C, R, S) mean square errors of (K, R, C, S, N) errors, but for the initial estimate."""
    found, counts = [], []
    for place, mask in enumerate(seen):
        scored = _scored(errors[:, place], mask, 1)
        found.append((scored**2).mean(axis=-1))
        counts.append(scored.shape[-1])
    weights = np.array(counts) * len(counts) / sum(counts)
    squares: Array = np.stack(found, axis=2) * weights[:, None]
    return squares


def _scored(values: Array, seen: NDArray[np.bool_], first: int) -> Array:
    """Return (..., n) the values (..., N) of a record from a sample on at which its truth is known."""
    begin = min(first, int(np.flatnonzero(seen)[-1]))  # a short record: its last sample
    scored: Array = values[..., begin : len(seen)][..., seen[begin:]]
    return scored


def _row(
    condition: Condition,
    method: Method,
    errors: list[Array],
    half_widths: list[Array] | None,
    records: Sequence[tuple[int, EvaluationRecord]],
    protocol: Protocol,
) -> Score:
    """Pool (trainings, seeds, N) errors of each record over time, and average the indices over the others."""
    noise, level = condition

    def pooled(values: list[Array], first: int) -> Array:
        of_records = zip(values, records, strict=True)
        return np.concatenate([_scored(of, record.seen, first) for of, (_, record) in of_records], axis=-1)

    indices = error_indices(pooled(errors, 1))
    late = error_indices(pooled(errors, round(STEADY_SECONDS / protocol.sample_time_s)))
    honesty: dict[str, Any] = (
        {} if half_widths is None else interval_indices(pooled(errors, 1), pooled(half_widths, 1))
    )
    if not np.isfinite(indices["rmse_deg"]).all():
        raise DivergedError(f"{method.name} under {noise} noise of {level:g}: not a finite estimate")
    means: dict[str, Any] = {name: float(values.mean()) for name, values in indices.items()}
    low, high = confidence_interval(indices["rmse_deg"])
    first = records[0][1]
    published = None
    if not method.oracle and all(record.preset == INSTRUMENT for _, record in records):
        published = paper_value(noise, level, method.name, "rmse_deg")
    return Score(
        noise=noise,
        level=level,
        sample_time_s=protocol.sample_time_s,
        stroke_mm=first.stroke_mm,
        twin=first.twin,
        method=method.name,
        oracle=method.oracle,
        **means,
        rmse_steady_deg=float(late["rmse_deg"].mean()),
        rmse_ci95_deg=(low, high),
        seeds=protocol.seeds,
        training_rmse_deg=tuple(indices["rmse_deg"].mean(axis=1).tolist()) if method.others else (),
        paper_rmse_deg=published,
        **honesty,
    )
