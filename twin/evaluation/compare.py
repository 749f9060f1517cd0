"""The comparison: every method on the same records under the same noise, scored against the clean truth."""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.episode import Record
from twin.errors import DivergedError, InputError
from twin.estimation.estimator import Estimator
from twin.evaluation.method import Method, as_method, group_records, make_case
from twin.evaluation.metrics import confidence_interval, error_indices, interval_indices
from twin.evaluation.paper import INSTRUMENT, paper_value
from twin.evaluation.protocol import STEADY_SECONDS, Condition, Protocol
from twin.evaluation.ranking import Ranking, rank_methods
from twin.evaluation.reading import (
    chosen_measurements,
    common_variance,
    evaluation_record,
    evaluation_records,
)
from twin.evaluation.score import Score
from twin.recording import EpisodeWriter, read_episode
from twin.recording.messages import estimate_message, estimate_topic, to_nanoseconds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

INNOVATION_SECONDS = 0.1
"""Time between two samples whose innovation is found, as each takes a further step [s]."""


class Comparison(NamedTuple):
    """Result of a comparison."""

    scores: list[Score]  # of every method under every noise, group by group
    # by noise, the first record under the first seed, with the estimates of all methods
    tracks: dict[Condition, Record]
    rankings: list[Ranking]  # of every group
    # mean square errors of each score: (K, R, S) of K training runs on R records under S draws of the noise;
    # a record is weighted by its number of samples [deg^2]
    squares: list[Array]


def evaluate(
    data: str | Path | Sequence[str | Path],
    estimators: Mapping[str, Estimator[Any]],
    *,
    suite: str = "paper",
    seeds: int = 20,
    sample_time: float = 0.1,
    initial_error_deg: float = 20.0,
    seed: int = 0,
    measurements: Literal["auto", "drawn", "recorded"] = "auto",
    variance: float | None = None,
) -> list[Score]:
    """Run estimators on records under noise and score them against the true angle, as a notebook needs it.

    Args:
        data: folders of MCAP files, or files.
        estimators: by the names that the scores shall have.
        suite: `paper`, `paper-only` or `full`: the noises.
        seeds: draws of each noise.
        sample_time: T; records are thinned to it [s].
        initial_error_deg: error of the initial estimate [deg].
        seed: of the draws.
        measurements: `drawn`, the truth with drawn noise, or `recorded`, once, as the sensor measured it;
            `auto` is recorded where every record is a measured log, else drawn.
        variance: R of recorded measurements; if not given, as the records state it [deg^2].

    Returns:
        One score for each estimator, noise, stroke and kind of twin.
    """
    paths = [Path(path) for path in ([data] if isinstance(data, str | Path) else data)]
    if not estimators:
        raise InputError("no estimator given: name at least one, as in {'my filter': estimator}")
    if not paths:
        raise InputError("no data given: name folders of MCAP files, or files")
    recorded = chosen_measurements(measurements, paths)[0] == "recorded"
    if recorded and variance is None:
        variance = common_variance(paths)[0]
    protocol = Protocol(
        suite, 1 if recorded else seeds, sample_time, initial_error_deg, seed, variance if recorded else None
    )
    methods = [as_method(name, estimator) for name, estimator in estimators.items()]
    return compare(evaluation_records(paths, sample_time), methods, protocol).scores


def compare(
    records: Sequence[Record],
    methods: Sequence[Method],
    protocol: Protocol,
    on_progress: Callable[[int, int], None] = lambda *_: None,
    executor: Executor | None = None,
) -> Comparison:
    """Run every method under every noise of the suite.

    Records of one stroke and one kind of twin are a group: their errors are pooled for each noise seed, and a
    row holds means over seeds. The sample at k = 0, the wrong initial estimate itself, is not scored, nor is
    one whose truth is not known.
    """
    groups = group_records(records)
    on_progress(0, len(groups))
    # The largest first: a long one that begins last would leave the other workers idle.
    order = sorted(range(len(groups)), key=lambda place: -len(groups[place]))
    run = functools.partial(_compare_group, methods=methods, protocol=protocol)
    found: dict[int, Comparison] = {}
    for result in (executor.map if executor else map)(run, [groups[place] for place in order]):
        found[order[len(found)]] = result
        on_progress(len(found), len(groups))
    results = [found[place] for place in range(len(groups))]
    return Comparison(
        [row for result in results for row in result.scores],
        results[0].tracks,
        [ranking for result in results for ranking in result.rankings],
        [squares for result in results for squares in result.squares],
    )


def _compare_group(
    records: list[tuple[int, Record]], methods: Sequence[Method], protocol: Protocol
) -> Comparison:
    conditions = protocol.conditions
    with_truth = make_case(records, protocol)
    case = dataclasses.replace(with_truth, truth_deg=None)
    tracked = np.arange(len(conditions)) * protocol.seeds  # first record, first seed of each noise
    scores: dict[tuple[Condition, str], Score] = {}
    squares: dict[str, Array] = {}
    tracks: dict[str, Array] = {}
    late, every = (max(round(of / protocol.sample_time_s), 1) for of in (STEADY_SECONDS, INNOVATION_SECONDS))
    samples = range(late, case.pull_mm.shape[1], every)
    for method in methods:
        runs = method.run(with_truth if method.oracle else case, protocol.seeds, samples)
        estimates, half_widths, (nis, *_) = zip(*runs, strict=True)
        tracks[method.name] = estimates[0][tracked]
        shape = (len(estimates), len(records), len(conditions), protocol.seeds, -1)
        errors = (np.array(estimates) - with_truth.truth_deg).reshape(shape)
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
        squares[method.name] = _squares(errors, [record.known for _, record in records])
    oracles = [method.name for method in methods if method.oracle]
    ranked = rank_methods(squares, oracles)
    first = records[0][1]
    order = list(itertools.product(range(len(conditions)), ranked))
    rows = [
        dataclasses.replace(
            scores[conditions[place], of.method],
            to_best_ci95=of.noise_to_best_ci95[place],
            is_best=of.noise_is_best[place],
        )
        for place, of in order
    ]
    count = len(first.time)
    followed = {
        condition: dataclasses.replace(
            first,
            time=np.arange(count, dtype=float) * protocol.sample_time_s,
            truth_deg=first.filled_deg,
            measured_deg=case.measurement_deg[run, :count],
            source="",  # so that the truth is the reference
            estimates={name: estimate[place, :count] for name, estimate in tracks.items()},
        )
        for place, (condition, run) in enumerate(zip(conditions, tracked, strict=True))
    }
    ranking = Ranking(protocol.sample_time_s, first.stroke_mm, first.source, tuple(ranked))
    return Comparison(rows, followed, [ranking], [squares[of.method][:, place] for place, of in order])


def _squares(errors: Array, known: Sequence[Mask]) -> Array:
    """Return (K, C, R, S) mean square errors of (K, R, C, S, N) errors, but for the initial estimate."""
    scored = [_scored(errors[:, place], mask, 1) for place, mask in enumerate(known)]
    counts = np.array([of.shape[-1] for of in scored])
    squares: Array = np.stack([(of**2).mean(axis=-1) for of in scored], axis=2)
    squares *= (counts / counts.mean())[:, None]
    return squares


def _scored(values: Array, known: Mask, first: int) -> Array:
    """Return (..., n) of the values (..., N) of a record: from a sample on, where its truth is known."""
    begin = min(first, int(np.flatnonzero(known)[-1]))  # a short record: its last sample
    scored: Array = values[..., begin : len(known)][..., known[begin:]]
    return scored


def _row(
    condition: Condition,
    method: Method,
    errors: list[Array],
    half_widths: list[Array] | None,
    records: Sequence[tuple[int, Record]],
    protocol: Protocol,
) -> Score:
    """Pool (trainings, seeds, N) errors of each record over time, and average the indices over the others."""
    noise, level = condition

    def pooled(values: list[Array], first: int) -> Array:
        of_records = zip(values, records, strict=True)
        return np.concatenate([_scored(of, record.known, first) for of, (_, record) in of_records], axis=-1)

    indices = error_indices(pooled(errors, 1))
    late = error_indices(pooled(errors, round(STEADY_SECONDS / protocol.sample_time_s)))
    stated: dict[str, Any] = (
        {} if half_widths is None else interval_indices(pooled(errors, 1), pooled(half_widths, 1))
    )
    if not np.isfinite(indices["rmse_deg"]).all():
        raise DivergedError(f"{method.name} under {noise} noise of {level:g}: not a finite estimate")
    means: dict[str, Any] = {name: float(values.mean()) for name, values in indices.items()}
    first = records[0][1]
    published = None
    if not method.oracle and all(record.preset == INSTRUMENT for _, record in records):
        published = paper_value(noise, level, method.name, "rmse_deg")
    return Score(
        noise=noise,
        level=level,
        sample_time_s=protocol.sample_time_s,
        stroke_mm=first.stroke_mm,
        twin=first.source,
        method=method.name,
        oracle=method.oracle,
        given=method.given,
        **means,
        rmse_steady_deg=float(late["rmse_deg"].mean()),
        rmse_ci95_deg=confidence_interval(indices["rmse_deg"]),
        seeds=protocol.seeds,
        training_rmse_deg=tuple(indices["rmse_deg"].mean(axis=1).tolist()) if method.others else (),
        paper_rmse_deg=published,
        **stated,
    )


def write_estimates(
    files: Mapping[str, Path], methods: Sequence[Method], protocol: Protocol, folder: Path
) -> None:
    """Copy each record with the estimates of methods from its recorded measurements, as `/estimate/METHOD`.

    `files` are MCAP files by the names of the new ones without their ending; oracles among the methods are
    left out. The record keeps its own samples; estimates are at the protocol's sample time, with its R.
    """
    sample_time = protocol.sample_time_s
    for name, file in files.items():
        episode = read_episode(file)
        even = episode.resampled(sample_time)
        record = evaluation_record(even, 0)
        case = make_case([(0, record)], protocol)
        begin = len(even.time) - len(record.time)
        time = episode.time[0] + sample_time * (begin + np.arange(len(record.time)))
        with EpisodeWriter(folder / f"{name}.mcap") as writer:
            writer.write(episode)
            for method in methods:
                if method.oracle:
                    continue
                topic, estimate = estimate_topic(method.name), method.estimate(case)[0]
                for nanoseconds, bend_deg in zip(to_nanoseconds(time), estimate.tolist(), strict=True):
                    writer.add_message(topic, estimate_message(bend_deg), nanoseconds)
