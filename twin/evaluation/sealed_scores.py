"""Scores of methods on sealed conditions: each condition is one unit, whatever its size of error."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Record
from twin.errors import DivergedError
from twin.estimation.knowledge import IntervalEstimator
from twin.estimation.registry import source_of
from twin.evaluation.method import Method
from twin.evaluation.metrics import error_indices, geometric_mean, interval_indices
from twin.evaluation.protocol import SEALED, STEADY_SECONDS
from twin.evaluation.ranking import Ranking, competes, rank_conditions, ratio_over_conditions
from twin.evaluation.score import Score
from twin.evaluation.sealed import KINDS, SealedCondition, sealed_case

Array = NDArray[np.float64]
AT_ONCE = 10  # conditions that a worker takes
FEWEST = 5  # conditions of a group that has rows of its own
HONEST = (0.9, 0.98)  # coverage of an interval of 95 % that is called honest


@dataclasses.dataclass(frozen=True)
class SealedResult:
    """Figures of one method: of each of C conditions, K training runs and S draws.

    Attributes:
        errors: indices of `error_indices`, (K, C, S) each.
        steady: RMSE without the first 5 s, (K, C, S) [deg].
        intervals: indices of `interval_indices`, (C,) each; empty where it states none.
        estimates: (C, N) estimates of the first run of each condition [deg].
    """

    errors: dict[str, Array]
    steady: Array
    intervals: dict[str, Array]
    estimates: Array

    @property
    def rmse_deg(self) -> Array:
        """RMSE of each condition, a mean over training runs and draws, (C,) [deg]."""
        rmse: Array = self.errors["rmse_deg"].mean(axis=(0, 2))
        return rmse


def compare_sealed(
    conditions: Sequence[SealedCondition],
    records: Sequence[Record],
    methods: Sequence[Method],
    draws: int,
    seed: int,
    on_progress: Callable[[int, int], None] = lambda *_: None,
    executor: Executor | None = None,
) -> dict[str, SealedResult]:
    """Run every method on every condition, and return its figures by its name."""
    on_progress(0, len(conditions))
    alike = [
        [number for number, of in enumerate(conditions) if of.from_rest is from_rest]
        for from_rest in (True, False)
    ]
    parts = [of[begin : begin + AT_ONCE] for of in alike for begin in range(0, len(of), AT_ONCE)]
    run = functools.partial(_run, methods=methods, draws=draws, seed=seed)
    tasks = [[(number, conditions[number], records[number]) for number in part] for part in parts]
    found, done = [], 0
    for part, results in zip(parts, (executor.map if executor else map)(run, tasks), strict=True):
        found.append(results)
        done += len(part)
        on_progress(done, len(conditions))
    order = np.argsort([number for part in parts for number in part])
    return {method.name: _joined([of[method.name] for of in found], order) for method in methods}


def _run(
    part: Sequence[tuple[int, SealedCondition, Record]], methods: Sequence[Method], draws: int, seed: int
) -> dict[str, SealedResult]:
    conditions = [(number, condition) for number, condition, _ in part]
    with_truth = sealed_case(conditions, [record for *_, record in part], draws, seed)
    case = dataclasses.replace(with_truth, truth_deg=None)
    truth, T = np.asarray(with_truth.truth_deg), part[0][2].sample_time
    shape = (len(part), draws, -1)
    found = {}
    for method in methods:
        errors: list[Array] = []
        widths: list[Array] = []
        first = np.empty(0)
        for estimator in (method.estimate, *method.others):
            given = with_truth if method.oracle else case
            estimate, half_width = (
                estimator.with_interval(given)
                if isinstance(estimator, IntervalEstimator)
                else (estimator(given), None)
            )
            if not np.isfinite(estimate).all():
                raise DivergedError(f"{method.name} in the conditions from {part[0][0]} on: not finite")
            first = first if first.size else estimate[::draws]
            errors.append((estimate - truth).reshape(shape)[..., 1:])
            widths += [] if half_width is None else [half_width.reshape(shape)[..., 1:]]
        every = np.array(errors)
        late = max(round(STEADY_SECONDS / T) - 1, 0)
        late = min(late, every.shape[-1] - 1)  # of a short record, its last sample
        stated = [
            interval_indices(every[:, place], np.array([of[place] for of in widths]))
            for place in range(len(part) if widths else 0)
        ]
        found[method.name] = SealedResult(
            error_indices(every),
            np.asarray(error_indices(every[..., late:])["rmse_deg"]),
            {name: np.array([of[name] for of in stated]) for name in (stated[0] if stated else ())},
            first,
        )
    return found


def _joined(parts: Sequence[SealedResult], order: NDArray[np.intp]) -> SealedResult:
    """Return the figures of all conditions, in their order."""
    return SealedResult(
        {
            name: np.concatenate([of.errors[name] for of in parts], axis=1)[:, order]
            for name in parts[0].errors
        },
        np.concatenate([of.steady for of in parts], axis=1)[:, order],
        {name: np.concatenate([of.intervals[name] for of in parts])[order] for name in parts[0].intervals},
        np.concatenate([of.estimates for of in parts])[order],
    )


def sealed_scores(
    conditions: Sequence[SealedCondition],
    methods: Sequence[Method],
    results: Mapping[str, SealedResult],
    sample_time: float,
) -> tuple[list[Score], list[Ranking]]:
    """Return a row of each method over all conditions, then over those of each kind, and the rankings.

    An RMSE is the geometric mean over conditions, other figures are arithmetic means.
    """
    scores, rankings = [], []
    for kind in KINDS:
        chosen = np.array([kind in condition.kinds for condition in conditions])
        if chosen.sum() < FEWEST:
            continue
        logs = {
            name: np.log(np.maximum(of.errors["rmse_deg"][:, chosen].mean(axis=2), 1e-9))
            for name, of in results.items()
        }
        ranked = rank_conditions(logs, [method.name for method in methods if method.oracle])
        rankings.append(Ranking(sample_time, (), kind, tuple(ranked)))
        for method, rank in zip(methods, ranked, strict=True):
            figures = results[method.name]
            indices: dict[str, Any] = {
                name: float(of[:, chosen].mean()) for name, of in figures.errors.items()
            }
            indices |= {name: float(of[chosen].mean()) for name, of in figures.intervals.items()}
            of_trainings = geometric_mean(figures.errors["rmse_deg"][:, chosen].mean(axis=2), axis=1)
            scores.append(
                Score(
                    noise=SEALED,
                    level=float(chosen.sum()),
                    sample_time_s=sample_time,
                    twin=kind,
                    method=method.name,
                    oracle=method.oracle,
                    given=method.given,
                    **indices | {"rmse_deg": rank.rmse_deg},
                    rmse_steady_deg=float(geometric_mean(figures.steady[:, chosen].mean(axis=(0, 2)))),
                    rmse_ci95_deg=rank.rmse_ci95_deg or (rank.rmse_deg, rank.rmse_deg),
                    seeds=figures.steady.shape[2],
                    training_rmse_deg=tuple(of_trainings.tolist()) if method.others else (),
                    to_best_ci95=rank.to_best_ci95,
                    is_best=rank.noise_is_best[0],
                )
            )
    return scores, rankings


@dataclasses.dataclass(frozen=True)
class Sealed:
    """Summary of one method that competes.

    Attributes:
        rival: the best other method that competes.
        ratio: geometric mean of its RMSE over that of the rival, with its 95 % interval over conditions.
        worse: share of conditions in which its RMSE is larger than the rival's.
        honest: share of conditions in which its 95 % interval covers 90 to 98 % of the samples; None without.
    """

    rival: str
    ratio: float
    ratio_ci95: tuple[float, float]
    worse: float
    honest: float | None


def summary_of(name: str, results: Mapping[str, SealedResult]) -> Sealed | None:
    """Return the summary of a method; None where no other one competes. Parts of it are no rivals."""
    others = {
        of: result for of, result in results.items() if competes(of) and source_of(of) != source_of(name)
    }
    if not others:
        return None
    rival = min(others, key=lambda of: float(np.log(others[of].rmse_deg).mean()))
    one, other = (np.log(results[of].errors["rmse_deg"].mean(axis=2)) for of in (name, rival))
    ratio, interval = ratio_over_conditions(one, other)
    coverage = results[name].intervals.get("coverage95")
    return Sealed(
        rival,
        ratio,
        interval,
        float((results[name].rmse_deg > others[rival].rmse_deg).mean()),
        None if coverage is None else float(((coverage >= HONEST[0]) & (coverage <= HONEST[1])).mean()),
    )
