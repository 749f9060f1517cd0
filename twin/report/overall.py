"""Table of a whole comparison: a line for each method, over all noises, strokes and kinds of twins."""

from collections.abc import Mapping, Sequence

import numpy as np

from twin.evaluation.costs import Cost
from twin.evaluation.means import mean_coverage, rmse_by
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.score import Score
from twin.report.limit import groups_of, has_limit, times_over_groups
from twin.report.tables import aligned_table, twin_name


def overall_table(scores: Sequence[Score], sample_time_s: float, costs: Mapping[str, Cost]) -> str:
    """Return the methods in Markdown, the least error on top.

    Errors are geometric means of the RMSE [deg] over noises and strokes, for each kind of twin and for all
    kinds together; beside them how many times the limit's that is, the share of samples whose interval held
    the truth, the number of trainings, and the time of a sample.

    Args:
        scores: of a comparison.
        sample_time_s: which sample time [s].
        costs: of each method.
    """
    chosen = [score for score in scores if score.sample_time_s == sample_time_s]
    twins = list(dict.fromkeys(score.twin for score in chosen))
    methods: dict[str, list[Score]] = {}
    for score in chosen:
        methods.setdefault(score.method, []).append(score)
    found = {method: rmse_by(mine, lambda score: score.twin) for method, mine in methods.items()}
    over = {method: float(geometric_mean(np.array([*of.values()]))) for method, of in found.items()}
    limits = times_over_groups(chosen, [sample_time_s], groups_of(chosen)) if has_limit(chosen) else {}
    lines = []
    for method in sorted(methods, key=lambda name: over[name]):
        mine = methods[method]
        coverage, cost = mean_coverage(mine), costs.get(method, Cost())
        lines.append(
            [
                mine[0].label,
                *(f"{found[method][twin]:.2f}" if twin in found[method] else "-" for twin in twins),
                f"{over[method]:.2f}",
                *([f"{limits[method]:.2f}"] if limits else []),
                "-" if coverage is None else f"{100 * coverage:.0f}",
                str(mine[0].trainings),
                "-" if cost.training_s is None else f"{cost.training_s / 60:.1f}",
                "-" if cost.parameters is None else f"{cost.parameters}",
                "-" if cost.sample_us is None else f"{cost.sample_us:.0f}",
            ]
        )
    headers = [
        "method",
        *map(twin_name, twins),
        "all",
        *(["times the limit"] if limits else []),
        "coverage [%]",
        "trainings",
        "a training [min]",
        "parameters",
        "a sample [µs]",
    ]
    return aligned_table(lines, headers)
