"""Stated intervals of a comparison: how often they hold the truth, how wide and of what worth they are."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from twin.evaluation.metrics import geometric_mean
from twin.evaluation.paper import noise_label
from twin.evaluation.score import Score
from twin.report.figures import INK, MUTED, clean_axes, own_style
from twin.report.tables import aligned_table

HONEST = (0.93, 0.97)
"""Coverage of a 95 % interval that is as sure as it says."""


def interval_scores(scores: Sequence[Score]) -> dict[str, list[Score]]:
    """Return the scores of each method that states intervals, the least CRPS first.

    Args:
        scores: of one sample time and one kind of records.
    """
    stated: dict[str, list[Score]] = {}
    for score in scores:
        if score.coverage95 is not None and score.crps_deg is not None:
            stated.setdefault(score.label, []).append(score)
    return dict(sorted(stated.items(), key=lambda item: _worth(item[1])))


def interval_table(scores: Sequence[Score]) -> str:
    """Return coverage by noise, width, NEES, NIS and CRPS of each method in Markdown; empty without any.

    Args:
        scores: of one sample time and one kind of records.
    """
    stated = interval_scores(scores)
    if not stated:
        return ""
    noises = list(dict.fromkeys(score.condition for of in stated.values() for score in of))
    lines = []
    for method, of in stated.items():
        coverage = {score.condition: 100 * _of(score.coverage95) for score in of}
        lines.append(
            [
                method,
                *(f"{coverage[noise]:.0f}" if noise in coverage else "-" for noise in noises),
                f"{np.mean([_of(score.width95_deg) for score in of]):.2f}",
                f"{geometric_mean(np.array([_of(score.nees) for score in of])):.2f}",
                _mean_nis(of),
                f"{_worth(of):.3f}",
            ]
        )
    noise_labels = [noise_label(*noise) for noise in noises]
    headers = ["method", *noise_labels, "width [deg]", "NEES", "NIS", "CRPS [deg]"]
    return aligned_table(lines, headers)


def interval_figure(scores: Sequence[Score]) -> Figure:
    """Draw the coverage of each method's 95 % interval, a dot for each noise, and beside it their CRPS."""
    stated = interval_scores(scores)
    methods = list(reversed(stated))
    figure = Figure(figsize=(8.5, 0.24 * len(methods) + 1.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    for axes in (left, right):
        clean_axes(axes)
        axes.tick_params(labelsize=7.5)
    left.axvspan(*HONEST, color=MUTED, alpha=0.25, linewidth=0)
    for line, method in enumerate(methods):
        of = stated[method]
        own = own_style(of[0].method)
        colour = MUTED if own is None else own.colour
        coverage = [_of(score.coverage95) for score in of]
        left.plot(coverage, [line] * len(of), "o", markersize=4, color=colour, alpha=0.7, markeredgewidth=0)
        crps = [_of(score.crps_deg) for score in of]
        right.plot(crps, [line] * len(of), "o", markersize=3, color=colour, alpha=0.4, markeredgewidth=0)
        right.plot(_worth(of), line, "|", markersize=9, markeredgewidth=1.6, color=INK)
    left.set_yticks(range(len(methods)), methods, fontsize=7.5)
    left.set_xlim(-0.02, 1.02)
    left.xaxis.set_major_formatter(PercentFormatter(1.0))
    left.set_xlabel("truth within the 95 % interval, each noise; grey: 93 to 97 %", fontsize=8.5, color=INK)
    right.set_xscale("log")
    right.xaxis.set_major_formatter("{x:g}")
    right.set_xlabel("CRPS [deg]; line: geometric mean", fontsize=8.5, color=INK)
    return figure


def _worth(scores: Sequence[Score]) -> float:
    return float(geometric_mean(np.array([_of(score.crps_deg) for score in scores])))


def _of(value: float | None) -> float:
    assert value is not None  # a method that states an interval has all of them
    return value


def _mean_nis(scores: Sequence[Score]) -> str:
    known = [score.nis for score in scores if score.nis]
    return f"{geometric_mean(np.array(known)):.2f}" if known else "-"
