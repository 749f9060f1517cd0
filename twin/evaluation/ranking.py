"""Ranks of methods that share records and noise, with intervals by a paired, hierarchical bootstrap.

Records are drawn with replacement, draws of the noise within each, and training runs of each method (Davison
and Hinkley 1997, section 3.8). All methods run on the same draws, so that a difference is free of what
records and noise have in common; differences between training runs are in it. The figure of a method is the
geometric mean over noises of its mean RMSE, as everywhere in this project.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from twin.errors import InputError
from twin.estimation.registry import method_spec
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.score import LARGEST, LONGEST_TEXT
from twin.files.json_text import key_name, rule_of

Array = NDArray[np.float64]
RESAMPLES = 1000
INTERVAL = (2.5, 97.5)  # percentiles of a 95 % interval
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
Place = Annotated[int, Field(ge=1, le=10_000)]
Name = Annotated[str, Field(max_length=LONGEST_TEXT)]


@dataclasses.dataclass(frozen=True)
class MethodRank:
    """Place of a method among all on one group of records; intervals are of 95 %."""

    method: Name  # name in the tables
    rmse_deg: Positive  # geometric mean over noises of its RMSE [deg]
    rmse_ci95_deg: tuple[Positive, Positive] | None  # interval of that [deg]; None where there is but one run
    rank: Place | None  # 1 for the least error; None for oracles and ensembles, the references
    rank_ci95: tuple[Place, Place] | None  # interval of the rank
    # interval of its error in units of that of the first: above 1, the first is better
    to_best_ci95: tuple[Positive, Positive] | None
    # the same under each single noise, in units of the first under that noise
    noise_to_best_ci95: tuple[tuple[Positive, Positive] | None, ...] = ()


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
            del row["noise_to_best_ci95"]  # in the rows of the noises
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
    """Return whether a method competes: no oracle, and no ensemble, which others are measured against."""
    spec = method_spec(method)
    return not oracle and (spec is None or spec.presentation.family != "ensemble")


def rank_methods(
    squares: Mapping[str, Array], oracles: Sequence[str], rng: np.random.Generator
) -> list[MethodRank]:
    """Return the ranks of methods, in the order that they are given in; `oracles` are shown the truth.

    `squares` are, by method, (K, C, R, S) mean square errors under C noises on R records and S draws of each
    noise, of K training runs [deg^2].
    """
    shapes = {of.shape[1:] for of in squares.values()}
    if len(shapes) != 1:
        raise ValueError(f"runs of shapes {sorted(shapes)}: methods must be compared on the same ones")
    conditions, records, draws = shapes.pop()
    found = np.stack([_rmse(of) for of in squares.values()])  # (methods, noises)
    whole = geometric_mean(found, axis=1)
    racing = [place for place, name in enumerate(squares) if competes(name, name in oracles)]
    ranks = dict(zip(racing, _ranks(whole[racing]).tolist(), strict=True))
    ranked = [
        MethodRank(name, float(whole[place]), None, ranks.get(place), None, None, (None,) * conditions)
        for place, name in enumerate(squares)
    ]
    if records * draws == 1:  # there is nothing to resample
        return ranked
    resampled = np.stack([_resample(squares, rng) for _ in range(RESAMPLES)])  # (RESAMPLES, methods, C)
    wholes = geometric_mean(resampled, axis=2)
    ranked = [dataclasses.replace(of, rmse_ci95_deg=_interval(wholes[:, i])) for i, of in enumerate(ranked)]
    if not racing:
        return ranked
    rank_intervals = dict(zip(racing, map(_whole_interval, _ranks(wholes[:, racing]).T), strict=True))
    best = racing[int(np.argmin(whole[racing]))]
    best_of_noise = np.array(racing)[found[racing].argmin(axis=0)]
    first = resampled[:, best_of_noise, np.arange(conditions)]
    return [
        dataclasses.replace(
            of,
            rank_ci95=rank_intervals.get(place),
            to_best_ci95=_interval(wholes[:, place] / wholes[:, best]),
            noise_to_best_ci95=tuple(map(_interval, (resampled[:, place] / first).T)),
        )
        for place, of in enumerate(ranked)
    ]


def times_reference(
    groups: Sequence[Mapping[str, Array]], reference: str, rng: np.random.Generator
) -> dict[str, tuple[float, tuple[float, float] | None]]:
    """Return each method's error over all groups in units of that of one method, with its 95 % interval.

    It is the ratio of the geometric means over groups and noises; the interval is None where there is but one
    run.
    """
    names = list(groups[0])
    place = names.index(reference)

    def over_all(errors: list[Array]) -> Array:
        """Return (methods,) ratios of the geometric means of errors (methods, C) on each group."""
        whole = geometric_mean(np.concatenate(errors, axis=1), axis=1)
        return np.asarray(whole / whole[place])

    found = over_all([np.stack([_rmse(of) for of in group.values()]) for group in groups])
    if all(of.size == of.shape[1] for group in groups for of in group.values()):
        return {name: (float(ratio), None) for name, ratio in zip(names, found, strict=True)}
    drawn = []
    for _ in range(RESAMPLES):
        trainings = [rng.integers(len(of), size=len(of)) for of in groups[0].values()]
        drawn.append(over_all([_resample(group, rng, trainings) for group in groups]))
    intervals = map(_interval, np.array(drawn).T)
    return {name: (float(of), interval) for name, of, interval in zip(names, found, intervals, strict=True)}


def _resample(
    squares: Mapping[str, Array],
    rng: np.random.Generator,
    trainings: Sequence[NDArray[np.int64]] | None = None,
) -> Array:
    """Return (methods, C) the RMSE of methods on resampled records and draws, the same for all.

    `trainings` are indices of the resampled training runs of each method; drawn here, if not given.
    """
    _, conditions, records, draws = next(iter(squares.values())).shape
    everything = np.arange(conditions)[:, None, None]
    record = rng.integers(records, size=(records, 1))
    draw = rng.integers(draws, size=(records, draws))
    found = []
    for place, of in enumerate(squares.values()):
        chosen = rng.integers(len(of), size=len(of)) if trainings is None else trainings[place]
        found.append(_rmse(of[chosen[:, None, None, None], everything, record, draw]))
    return np.array(found)


def _rmse(squares: Array) -> Array:
    """Return (C,) the RMSE over records, averaged over trainings and draws, of (K, C, R, S) square errors."""
    rmse: Array = np.sqrt(np.maximum(squares.mean(axis=2), 1e-18)).mean(axis=(0, 2))
    return rmse


def _ranks(figures: Array) -> NDArray[np.int64]:
    """Return the ranks, from 1, along the last axis."""
    return np.asarray(figures.argsort(axis=-1, kind="stable").argsort(axis=-1, kind="stable") + 1)


def _interval(values: Array) -> tuple[float, float]:
    low, high = np.percentile(values, INTERVAL)
    return float(low), float(high)


def _whole_interval(ranks: NDArray[np.int64]) -> tuple[int, int]:
    low, high = np.percentile(ranks, INTERVAL, method="nearest")
    return int(low), int(high)
