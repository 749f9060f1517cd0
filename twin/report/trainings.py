"""Table of the spread between trainings of one method that differ in their seed alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.evaluation.metrics import geometric_mean
from twin.evaluation.score import Score
from twin.report.tables import aligned_table, group_name, ordered

Array = NDArray[np.float64]


def training_table(scores: Sequence[Score], fmt: str = "plain") -> str:
    """Return a line for each method of several trainings, records and sample time.

    Its figures are geometric means over noises of the RMSE: over trainings, their standard deviation, and the
    best and the worst of them.

    Args:
        scores: of an evaluation.
        fmt: one of `twin.report.tables.FORMATS`.

    Returns:
        The table; empty where no method has several trainings.
    """
    rows = [score for score in scores if score.training_rmse_deg]
    lines = []
    for name in ordered(row.label for row in rows):
        ours = [row for row in rows if row.label == name]
        for group, sample_time in dict.fromkeys((row.group, row.sample_time_s) for row in ours):
            chosen = [row for row in ours if (row.group, row.sample_time_s) == (group, sample_time)]
            lines.append([name, group_name(group), f"{sample_time:g} s", *_figures(chosen)])
    if not lines:
        return ""
    headers = ["method", "records", "T", "trainings", "mean", "deviation", "best", "worst", "worst over mean"]
    return aligned_table(lines, headers, left=2, fmt=fmt)


def _figures(rows: Sequence[Score]) -> list[str]:
    """Number of trainings, and mean, deviation, best and worst of their geometric means over noises."""
    rmse: Array = np.array([row.training_rmse_deg for row in rows])
    means = geometric_mean(rmse, axis=0)
    figures = means.mean(), means.std(ddof=1), means.min(), means.max()
    over = f"{100 * (means.max() / means.mean() - 1):.1f} %"
    return [str(len(means)), *(f"{figure:.3f}" for figure in figures), over]
