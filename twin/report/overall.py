"""Table of a whole comparison: a line for each method, over all noises, strokes and kinds of twins."""

from collections.abc import Mapping, Sequence

import numpy as np
from tabulate import tabulate

from twin.evaluation.metrics import geometric_mean
from twin.evaluation.score import Score
from twin.report.limit import groups_of, has_limit, times_the_limit


def overall_table(scores: Sequence[Score], sample_time_s: float, costs: Mapping[str, float | None]) -> str:
    """Return the methods in Markdown, the least error on top.

    Errors are geometric means of the RMSE [deg] over noises and strokes, for each kind of twin and for all
    kinds together; beside them how many times the limit's that is, the share of samples whose interval held
    the truth, the number of trainings, and the time of a sample.

    Args:
        scores: of a comparison.
        sample_time_s: which sample time [s].
        costs: time of one sample of each method [us]; None for what needs a whole record.
    """
    chosen = [score for score in scores if score.sample_time_s == sample_time_s]
    twins = list(dict.fromkeys(score.twin for score in chosen))
    methods = list(dict.fromkeys(score.method for score in chosen))
    found = {method: _by_twin([score for score in chosen if score.method == method]) for method in methods}
    over = {method: _mean(list(errors.values())) for method, errors in found.items()}
    limits = _over_groups(chosen, sample_time_s) if has_limit(chosen) else {}
    lines = []
    for method in sorted(methods, key=lambda name: over[name]):
        mine = [score for score in chosen if score.method == method]
        held = [score.coverage95 for score in mine if score.coverage95 is not None]
        cost = costs.get(method)
        lines.append(
            [
                mine[0].label,
                *(f"{found[method][twin]:.2f}" if twin in found[method] else "-" for twin in twins),
                f"{over[method]:.2f}",
                *([f"{limits[method]:.2f}"] if limits else []),
                f"{100 * np.mean(held):.0f}" if held else "-",
                str(max(len(mine[0].training_rmse_deg), 1)),
                "-" if cost is None else f"{cost:.0f}",
            ]
        )
    headers = [
        "method",
        *("the preset" if twin == "nominal" else twin for twin in twins),
        "all",
        *(["times the limit"] if limits else []),
        "coverage [%]",
        "trainings",
        "a sample [µs]",
    ]
    align = ("left", *["right"] * (len(headers) - 1))
    return str(tabulate(lines, headers, tablefmt="pipe", disable_numparse=True, colalign=align))


def _by_twin(scores: Sequence[Score]) -> dict[str, float]:
    """Return the geometric mean of the RMSE on each kind of twin [deg]."""
    kinds: dict[str, list[float]] = {}
    for score in scores:
        kinds.setdefault(score.twin, []).append(score.rmse_deg)
    return {twin: _mean(errors) for twin, errors in kinds.items()}


def _over_groups(scores: Sequence[Score], sample_time_s: float) -> dict[str, float]:
    """Return how many times the limit's error each method has, over all groups of records."""
    ratios: dict[str, list[float]] = {}
    for group in groups_of(scores):
        for method, ratio in times_the_limit(scores, sample_time_s, group).items():
            ratios.setdefault(method, []).append(ratio)
    return {method: _mean(of) for method, of in ratios.items()}


def _mean(values: Sequence[float]) -> float:
    return float(geometric_mean(np.array(values)))
