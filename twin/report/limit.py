"""Distance from the limit: how many times its error each method has, as numbers and as two figures."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from twin.estimation.registry import method_spec
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.paper import noise_label
from twin.evaluation.score import Group, Score
from twin.report.figures import INK, MUTED, clean_axes, own_style

MOST_COLUMNS = 6
"""Panels of noises side by side."""


def times_the_limit(scores: Sequence[Score], sample_time_s: float, group: Group) -> dict[str, float]:
    """Return how many times the limit's RMSE each method has: the geometric mean over noises.

    Args:
        scores: of an evaluation.
        sample_time_s: which sample time [s].
        group: stroke [mm] and kind of twin.
    """
    chosen = chosen_scores(scores, sample_time_s, group)
    limit = {score.condition: score.rmse_deg for score in chosen if is_limit(score.method)}
    ratios: dict[str, list[float]] = {}
    for score in chosen:
        if score.condition in limit:
            ratios.setdefault(score.method, []).append(score.rmse_deg / limit[score.condition])
    return {method: float(geometric_mean(np.array(r))) for method, r in ratios.items()}


def noise_figure(scores: Sequence[Score]) -> Figure:
    """Draw the RMSE of every method, a panel for each noise, the best on top, beside the limit."""
    noises = list(dict.fromkeys(score.condition for score in scores))
    ratios = times_the_limit(scores, scores[0].sample_time_s, scores[0].group)
    methods = sorted(ratios, key=lambda method: -ratios[method])
    methods = methods or list(dict.fromkeys(score.method for score in reversed(scores)))  # without a limit
    lines = -(-len(noises) // MOST_COLUMNS)
    columns = -(-len(noises) // lines)
    figure = Figure(figsize=(12, 0.22 * len(methods) * lines + 1.4), layout="constrained")
    grid = np.atleast_1d(figure.subplots(lines, columns, sharey=True, sharex=True, squeeze=False)).ravel()
    values = {(score.condition, score.method): score for score in scores}
    limits = {score.condition: score.rmse_deg for score in scores if is_limit(score.method)}
    for axes, noise in zip(grid, noises, strict=False):
        clean_axes(axes)
        if noise in limits:
            axes.axvline(limits[noise], color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
        for line, method in enumerate(methods):
            score = values[noise, method]
            low, high = score.rmse_ci95_deg
            own = own_style(method)
            colour = INK if is_limit(method) else MUTED if own is None else own.colour
            axes.plot([max(low, 1e-3), high], [line, line], color=colour, linewidth=1.4)
            face = "white" if score.oracle else colour
            axes.plot(score.rmse_deg, line, "o", markersize=4.2, color=colour, markerfacecolor=face)
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(FixedLocator([0.1, 0.3, 1, 3, 10]))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_title(noise_label(*noise), fontsize=7.5, color=INK, loc="left")
        axes.set_yticks(range(len(methods)), methods, fontsize=7.5)
        axes.tick_params(labelsize=7.5, labelbottom=True)
        axes.set_xlim(0.05, 30)
        axes.set_ylim(-0.6, len(methods) - 0.4)
    for axes in grid[len(noises) :]:
        axes.set_visible(False)
    figure.supxlabel(
        "RMSE [deg], 95 % interval over seeds; dashed: the limit; hollow: oracle",
        fontsize=8.5,
        color=INK,
    )
    return figure


def limit_figure(scores: Sequence[Score]) -> Figure:
    """Draw, for every kind of record and both sample times, how many times the limit each method has."""
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    groups = groups_of(scores)
    table = {(T, group): times_the_limit(scores, T, group) for T in times for group in groups}
    methods = by_ratio(scores, times, groups)
    figure = Figure(
        figsize=(3.2 + 0.62 * len(groups) * len(times), 0.27 * len(methods) + 1.9), layout="constrained"
    )
    panels = figure.subplots(1, len(times), sharey=True, squeeze=False)[0]
    for axes, T in zip(panels, times, strict=True):
        cells = np.array([[table[T, group].get(method, np.nan) for group in groups] for method in methods])
        axes.imshow(np.log(cells), cmap="Greys", vmin=0, vmax=np.log(40), aspect="auto")
        for (line, column), value in np.ndenumerate(cells):
            dark = np.log(value) > 0.55 * np.log(40)
            axes.text(
                column,
                line,
                f"{value:.1f}" if value < 9.95 else f"{value:.0f}",
                ha="center",
                va="center",
                fontsize=7,
                color="white" if dark else INK,
            )
        labels = [f"{twin} [{low:g}, {high:g}]" for (low, high), twin in groups]
        axes.set_xticks(range(len(groups)), labels, rotation=60, ha="right", fontsize=7.5)
        axes.set_yticks(range(len(methods)), methods, fontsize=7.5)
        axes.set_title(f"T = {T:g} s", fontsize=9, color=INK, loc="left")
        axes.tick_params(length=0, colors=INK)
        axes.spines[:].set_visible(False)
    figure.suptitle(
        "RMSE over the limit's, geometric mean over noises", fontsize=9.5, color=INK, x=0.01, ha="left"
    )
    return figure


def by_ratio(scores: Sequence[Score], times: Sequence[float], groups: Sequence[Group]) -> list[str]:
    """Return the methods, the nearest to the limit first, by their mean over groups and sample times."""
    ratios = times_over_groups(scores, times, groups)
    return sorted(ratios, key=lambda method: ratios[method])


def times_over_groups(
    scores: Sequence[Score], times: Sequence[float], groups: Sequence[Group]
) -> dict[str, float]:
    """Return how many times the limit's RMSE each method has: the geometric mean over groups too.

    Args:
        scores: of an evaluation.
        times: sample times [s].
        groups: strokes [mm] and kinds of twins.
    """
    ratios: dict[str, list[float]] = {}
    for T in times:
        for group in groups:
            for method, ratio in times_the_limit(scores, T, group).items():
                ratios.setdefault(method, []).append(ratio)
    return {method: float(geometric_mean(np.array(of))) for method, of in ratios.items()}


def chosen_scores(scores: Sequence[Score], sample_time_s: float, group: Group) -> list[Score]:
    """Return the scores of one sample time and one kind of records."""
    return [score for score in scores if score.sample_time_s == sample_time_s and score.group == group]


def groups_of(scores: Sequence[Score]) -> list[Group]:
    """Return the groups of records, in their order."""
    return list(dict.fromkeys(score.group for score in scores))


def is_limit(method: str) -> bool:
    """Return whether a method is the limit."""
    spec = method_spec(method)
    return spec is not None and spec.presentation.is_limit


def has_limit(scores: Sequence[Score]) -> bool:
    """Return whether the limit is among the scores."""
    return any(is_limit(score.method) for score in scores)
