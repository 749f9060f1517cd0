"""Ranks of methods that share records and noise, with intervals by a paired jackknife.

One record at a time is left out with all its draws of the noise, and one training run of a method (Efron and
Tibshirani 1993, section 11.2). The variances add up. Student's t has the degrees of freedom of Satterthwaite
(1946), because a bootstrap of five records is too narrow. All methods see the same draws, so a difference is
free of what records and noise have in common. The figure of a method is the geometric mean over noises of its
mean RMSE, as everywhere in this project.
"""

import dataclasses
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from twin.errors import InputError
from twin.estimation.registry import method_spec
from twin.evaluation.metrics import jackknife, student_interval
from twin.evaluation.score import LARGEST, LONGEST_TEXT
from twin.files.json_text import key_name, rule_of

Array = NDArray[np.float64]
ERROR_RATE = 0.05  # of one interval, and of all statements of one kind about a group of records
_TRAININGS, _RECORDS, _DRAWS = 0, 2, 3  # axes of square errors
_LEAST_RMSE = 1e-9  # [deg]
_LARGEST_LOG = math.log(LARGEST)
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
Place = Annotated[int, Field(ge=1, le=10_000)]
Name = Annotated[str, Field(max_length=LONGEST_TEXT)]


@dataclasses.dataclass(frozen=True)
class MethodRank:
    """Place of a method among all on one group of records; intervals are of 95 %."""

    method: Name  # name in the tables
    rmse_deg: Positive  # geometric mean over noises of its RMSE [deg]
    rmse_ci95_deg: tuple[Positive, Positive] | None  # interval of that [deg]; None where there is but one run
    rank: Place | None  # 1 for the least error; None for the references, see `competes`
    rank_ci95: tuple[Place, Place] | None  # interval of the rank, for all methods at once
    # interval of its error in units of that of the first: above 1, the first is better
    to_best_ci95: tuple[Positive, Positive] | None
    # the same under each single noise, in units of the first under that noise
    noise_to_best_ci95: tuple[tuple[Positive, Positive] | None, ...] = ()
    noise_is_best: tuple[bool, ...] = ()  # whether it is the best under each noise, beyond doubt


@dataclasses.dataclass(frozen=True)
class Ranking:
    """Ranks of all methods on one group of records."""

    sample_time_s: Positive  # T [s]
    # lowest and highest pulling distance [mm]
    stroke_mm: Annotated[tuple[Annotated[float, Field(ge=-LARGEST, le=LARGEST)], ...], Field(max_length=2)]
    twin: Name  # kind of twin, `measured`, or the name of a preset
    # methods, in the order of the comparison
    ranked: Annotated[tuple[MethodRank, ...], Field(min_length=1, max_length=1000)]

    def to_dict(self) -> dict[str, Any]:
        """Return the ranking as `evaluation.json` holds it, the first method first."""
        first = sorted(self.ranked, key=lambda of: of.rmse_deg)
        rows = [dataclasses.asdict(of) for of in first]
        for row in rows:
            del row["noise_to_best_ci95"], row["noise_is_best"]  # in the rows of the noises
        place = {"sample_time_s": self.sample_time_s, "stroke_mm": list(self.stroke_mm), "twin": self.twin}
        return place | {"ranked": rows}


_RANKINGS = TypeAdapter(Annotated[list[Ranking], Field(max_length=1000)])


def rankings_of(contents: Mapping[str, Any]) -> list[Ranking]:
    """Return the rankings in the contents of an `evaluation.json`; older ones hold none."""
    try:
        return _RANKINGS.validate_python(contents.get("ranks", []))
    except ValidationError as error:
        fault = error.errors(include_url=False, include_context=False)[0]
        raise InputError(f"{key_name(('ranks', *fault['loc']))}: {rule_of(fault['msg'])}") from None


def competes(method: str, oracle: bool = False) -> bool:
    """Return whether a method competes; an oracle and a method that knows the noise's density are references.

    An ensemble that knows no more than R, the size of the zero and the ranges could be deployed: it competes.
    """
    spec = method_spec(method)
    return not oracle and (spec is None or not spec.needs_density)


def rank_methods(squares: Mapping[str, Array], oracles: Sequence[str] = ()) -> list[MethodRank]:
    """Return the ranks of methods, in the order that they are given in; `oracles` are shown the truth.

    `squares` are, by method, (K, C, R, S) mean square errors under C noises on R records and S draws of each
    noise, of K training runs [deg^2]. There are no intervals where there is but one run of each method.
    """
    shapes = {of.shape[1:] for of in squares.values()}
    if len(shapes) != 1:
        raise ValueError(f"runs of shapes {sorted(shapes)}: methods must be compared on the same ones")
    noises = _errors_by_noise([squares])
    return _ranked(list(squares), _mean(noises), noises, oracles)


def rank_conditions(logs: Mapping[str, Array], oracles: Sequence[str] = ()) -> list[MethodRank]:
    """Return the ranks of methods by the geometric mean of their RMSE over conditions, each of them a unit.

    `logs` are, by method, (K, C) logarithms of the RMSE of K training runs in the same C conditions [deg].
    """
    whole = _over_conditions(logs)
    return _ranked(list(logs), whole, [whole], oracles)


def ratio_over_conditions(one: Array, other: Array) -> tuple[float, tuple[float, float]]:
    """Return the ratio of the geometric means of two methods, with its 95 % interval.

    Arguments are as the values of `logs` in `rank_conditions`, of two conditions or more.
    """
    errors = _over_conditions({"one": one, "other": other})
    ratio = float(np.exp(errors.log[0] - errors.log[1]))
    return ratio, errors.interval(0, 1) or (ratio, ratio)


def _over_conditions(logs: Mapping[str, Array]) -> "_Errors":
    means = np.array([of.mean() for of in logs.values()])
    of_conditions = np.array([of.mean(axis=0) for of in logs.values()]).T  # (C, M)
    count = len(of_conditions)
    left_out = [(count * means - of_conditions) / (count - 1)] if count > 1 else []
    for place, of in enumerate(logs.values()):
        if (runs := len(of)) > 1:
            left_out.append(np.zeros((runs, len(logs))))
            left_out[-1][:, place] = (runs * means[place] - of.mean(axis=1)) / (runs - 1)
    return _Errors(means, left_out)


def _ranked(
    names: Sequence[str], whole: "_Errors", noises: Sequence["_Errors"], oracles: Sequence[str]
) -> list[MethodRank]:
    racing = [place for place, name in enumerate(names) if competes(name, name in oracles)]
    order = sorted(racing, key=lambda place: whole.log[place])
    rank_intervals = _rank_intervals(whole, order)
    best_of = [min(racing, key=lambda place: noise.log[place], default=None) for noise in noises]
    winners = _winners(noises, best_of, racing)
    return [
        MethodRank(
            name,
            float(np.exp(whole.log[place])),
            whole.interval(place),
            order.index(place) + 1 if place in racing else None,
            rank_intervals.get(place),
            whole.interval(place, order[0]) if racing else None,
            tuple(
                None if best is None else noise.interval(place, best)
                for noise, best in zip(noises, best_of, strict=True)
            ),
            tuple(place == winner for winner in winners),
        )
        for place, name in enumerate(names)
    ]


def times_reference(
    groups: Sequence[Mapping[str, Array]], reference: str
) -> dict[str, tuple[float, tuple[float, float] | None]]:
    """Return each method's error over all groups in units of that of one method, with its 95 % interval.

    Groups are like `squares` of `rank_methods`; the training runs of a method are the same in all. The ratio
    is of the geometric means over groups and noises; the interval is None where there is but one run.
    """
    names, errors = list(groups[0]), _mean(_errors_by_noise(groups))
    one = names.index(reference)
    return {
        name: (float(np.exp(errors.log[place] - errors.log[one])), errors.interval(place, one))
        for place, name in enumerate(names)
    }


@dataclasses.dataclass(frozen=True)
class _Errors:
    """Errors of M methods under one noise, or their means over several, and how they change.

    Attributes:
        log: (M,) log RMSE [deg].
        left_out: arrays (units, M) of its change, up to a constant, as one unit is left out: a record of a
            group (a draw, where there is one record), or a training run of one method. Empty where there is
            one run.
    """

    log: Array
    left_out: list[Array]

    def difference(self, one: int, other: int | None) -> tuple[float, float, float]:
        """Return the log ratio of two errors, or one log error, its deviation and degrees of freedom."""
        log = self.log[one] - (0 if other is None else self.log[other])
        units = [of[:, one] - (0 if other is None else of[:, other]) for of in self.left_out]
        return float(log), *jackknife(units)

    def interval(self, one: int, other: int | None = None) -> tuple[float, float] | None:
        """Return the 95 % interval of an error [deg], or of the ratio of two."""
        if not self.left_out:
            return None
        low, high = student_interval(*self.difference(one, other))
        return math.exp(max(low, -_LARGEST_LOG)), math.exp(min(high, _LARGEST_LOG))

    def doubt(self, one: int, other: int) -> float:
        """Return the probability of as large a difference between two methods that are equal."""
        from scipy.special import stdtr

        log, deviation, _ = self.difference(one, other)
        if not self.left_out or log == 0:
            return 1.0
        freedom = min(len(of) for of in self.left_out) - 1  # cautious: tails are heavier than Student's
        return 2 * float(stdtr(freedom, -abs(log) / deviation)) if deviation else 0.0


def _errors_by_noise(groups: Sequence[Mapping[str, Array]]) -> list[_Errors]:
    """Return the errors under each noise of each group; units are in the same order in all of them."""
    names, found = list(groups[0]), []
    for group in groups:
        log = np.stack([_log_rmse(group[name]) for name in names])  # (M, C)
        left_out = []  # (units, M, C)
        for other in groups:
            axis = _RECORDS if other[names[0]].shape[_RECORDS] > 1 else _DRAWS
            if (units := other[names[0]].shape[axis]) > 1:
                left_out.append(np.zeros((units, *log.shape)))
                if other is group:
                    without = [_log_rmse_without(group[name], axis) for name in names]
                    left_out[-1][:] = np.stack(without, axis=1)
        for place, name in enumerate(names):
            if (runs := len(group[name])) > 1:
                left_out.append(np.zeros((runs, *log.shape)))
                left_out[-1][:, place] = _log_rmse_without(group[name], _TRAININGS)
        found += [_Errors(log[:, c], [of[..., c] for of in left_out]) for c in range(log.shape[1])]
    return found


def _mean(errors: Sequence[_Errors]) -> _Errors:
    """Return the errors of geometric means."""
    left_out = zip(*(of.left_out for of in errors), strict=True)
    return _Errors(np.mean([of.log for of in errors], axis=0), [np.mean(of, axis=0) for of in left_out])


def _rank_intervals(errors: _Errors, order: Sequence[int]) -> dict[int, tuple[int, int]]:
    """Return the interval of each rank: what is surely better comes before it, what is surely worse after."""
    if not errors.left_out:
        return {}
    pairs = list(combinations(order, 2))
    holds = holm([errors.doubt(*pair) for pair in pairs])
    sure = [pair for pair, is_sure in zip(pairs, holds, strict=True) if is_sure]
    better, worse = (Counter(pair[side] for pair in sure) for side in (1, 0))
    return {place: (1 + better[place], len(order) - worse[place]) for place in order}


def _winners(
    noises: Sequence[_Errors], best_of: Sequence[int | None], racing: Sequence[int]
) -> list[int | None]:
    """Return the method under each noise that is surely better than each other one, if there is one."""
    doubts = [
        max((errors.doubt(best, other) for other in racing if other != best), default=0.0)
        if best is not None
        else 1.0
        for errors, best in zip(noises, best_of, strict=True)
    ]
    return [best if is_sure else None for best, is_sure in zip(best_of, holm(doubts), strict=True)]


def holm(doubts: Sequence[float]) -> list[bool]:
    """Return which of several statements hold together, by their probabilities under chance (Holm 1979)."""
    order = np.argsort(doubts, kind="stable")
    bound = ERROR_RATE / np.arange(len(doubts), 0, -1)
    within = np.logical_and.accumulate(np.asarray(doubts)[order] <= bound)
    holds = np.zeros(len(doubts), dtype=bool)
    holds[order] = within
    return holds.tolist()


def _log_rmse(squares: Array) -> Array:
    """Return (C,) log RMSE over records, averaged over trainings and draws, of (K, C, R, S) square errors."""
    rmse = np.sqrt(squares.mean(axis=_RECORDS)).mean(axis=(0, -1))
    return np.asarray(np.log(np.maximum(rmse, _LEAST_RMSE)))


def _log_rmse_without(squares: Array, axis: int) -> Array:
    """Return `_log_rmse` (n, C) without each of the n training runs, records or draws."""
    count = range(squares.shape[axis])
    return np.array([_log_rmse(np.delete(squares, of, axis=axis)) for of in count])
