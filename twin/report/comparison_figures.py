"""Figures of a comparison: errors by noise, distance to the limit, ranks, and stated intervals."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from twin.episode import Record
from twin.evaluation.paper import noise_label
from twin.evaluation.protocol import Condition
from twin.evaluation.ranking import MethodRank, Ranking
from twin.evaluation.score import Score
from twin.report.comparison import interval_scores, mean_of
from twin.report.figures import INK, MUTED, clean_axes, log_ticks, own_style, paper_figures, to_png_bytes
from twin.report.tables import (
    by_error,
    chosen_scores,
    group_name,
    groups_of,
    has_limit,
    is_limit,
    times_the_limit,
)

MOST_COLUMNS = 6
"""Noises side by side."""
_PANELS = 3
"""Groups side by side, as there are strokes; one more fits where there is one line of them."""
_HONEST = (0.93, 0.97)
"""Coverage of a 95 % interval that is as sure as it states."""


def comparison_figures(
    scores: Sequence[Score], tracks: Mapping[Condition, Record], rankings: Sequence[Ranking] = ()
) -> dict[str, bytes]:
    """Return PNG files by name.

    Args:
        scores: of all sample times, strokes and twins.
        tracks: of the first group of episodes at the longest sample time.
        rankings: of every sample time and group.
    """
    longest, first = max(score.sample_time_s for score in scores), groups_of(scores)[0]
    shown, ranked = chosen_scores(scores, longest, first), rankings_to_draw(rankings)
    figures = {"rmse_by_noise.png": noise_figure(shown)}
    if has_limit(scores):
        figures["times_the_limit.png"] = limit_figure(scores)
    if ranked:
        figures["ranks.png"] = rank_figure(ranked)
    if interval_scores(shown):
        figures["intervals.png"] = interval_figure(shown)
    for number, (figure, _) in paper_figures(tracks, shown).items():
        figures[f"figure_{number:02d}.png"] = figure
    return {name: to_png_bytes(figure) for name, figure in figures.items()}


def _colour(method: str) -> str:
    own = own_style(method)
    return INK if is_limit(method) else MUTED if own is None else own.colour


def _list_methods(axes: Axes, methods: Sequence[str]) -> None:
    """Name a method at each line of axes."""
    axes.set_yticks(range(len(methods)), methods, fontsize=7.5)
    axes.tick_params(labelsize=7.5, labelbottom=True)
    axes.set_ylim(-0.6, len(methods) - 0.4)


def noise_figure(scores: Sequence[Score]) -> Figure:
    """Draw the RMSE of every method, a panel for each noise, the best on top, with the limit as a line.

    Args:
        scores: of one sample time and one group of episodes.
    """
    noises = list(dict.fromkeys(score.condition for score in scores))
    ratios = times_the_limit(scores, [scores[0].sample_time_s], [scores[0].group])
    methods = list(reversed(ratios or dict.fromkeys(score.method for score in scores)))
    lines = -(-len(noises) // MOST_COLUMNS)
    columns = -(-len(noises) // lines)
    figure = Figure(figsize=(12, 0.22 * len(methods) * lines + 1.4), layout="constrained")
    grid = figure.subplots(lines, columns, sharey=True, sharex=True, squeeze=False).ravel()
    values = {(score.condition, score.method): score for score in scores}
    limits = {score.condition: score.rmse_deg for score in scores if is_limit(score.method)}
    for axes, noise in zip(grid, noises, strict=False):
        clean_axes(axes)
        if noise in limits:
            axes.axvline(limits[noise], color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
        for line, method in enumerate(methods):
            score, colour = values[noise, method], _colour(method)
            low, high = score.rmse_ci95_deg
            axes.plot([max(low, 1e-3), high], [line, line], color=colour, linewidth=1.4)
            face = "white" if score.oracle else colour
            axes.plot(score.rmse_deg, line, "o", markersize=4.2, color=colour, markerfacecolor=face)
        axes.set_xscale("log")
        log_ticks(axes.xaxis, (0.1, 0.3, 1, 3, 10))
        axes.set_title(noise_label(*noise), fontsize=7.5, color=INK, loc="left")
        _list_methods(axes, methods)
        axes.set_xlim(0.05, 30)
    for axes in grid[len(noises) :]:
        axes.set_visible(False)
    label = "RMSE [deg], 95 % interval over seeds; dashed: the limit; hollow: oracle"
    figure.supxlabel(label, fontsize=8.5, color=INK)
    return figure


def limit_figure(scores: Sequence[Score]) -> Figure:
    """Draw the ratio of each method's RMSE to the limit, for every group of episodes and sample time."""
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    groups = groups_of(scores)
    methods = list(times_the_limit(scores, times, groups))
    size = 3.2 + 0.62 * len(groups) * len(times), 0.27 * len(methods) + 1.9
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(1, len(times), sharey=True, squeeze=False)[0]
    for axes, T in zip(panels, times, strict=True):
        columns = [times_the_limit(scores, [T], [group]) for group in groups]
        cells = np.array([[column.get(method, np.nan) for column in columns] for method in methods])
        axes.imshow(np.log(cells), cmap="Greys", vmin=0, vmax=np.log(40), aspect="auto")
        for (line, column), value in np.ndenumerate(cells):
            ink = "white" if np.log(value) > 0.55 * np.log(40) else INK
            text = f"{value:.1f}" if value < 9.95 else f"{value:.0f}"
            axes.text(column, line, text, ha="center", va="center", fontsize=7, color=ink)
        labels = [f"{twin} [{low:g}, {high:g}]" for (low, high), twin in groups]
        axes.set_xticks(range(len(groups)), labels, rotation=60, ha="right", fontsize=7.5)
        axes.set_yticks(range(len(methods)), methods, fontsize=7.5)
        axes.set_title(f"T = {T:g} s", fontsize=9, color=INK, loc="left")
        axes.tick_params(length=0, colors=INK)
        axes.spines[:].set_visible(False)
    title = "RMSE over the limit's, geometric mean over noises"
    figure.suptitle(title, fontsize=9.5, color=INK, x=0.01, ha="left")
    return figure


def rankings_to_draw(rankings: Sequence[Ranking]) -> list[Ranking]:
    """Return the rankings of the longest sample time that are of more than one method."""
    longest = max((of.sample_time_s for of in rankings), default=0.0)
    return [of for of in rankings if of.sample_time_s == longest and len(of.ranked) > 1]


def rank_figure(rankings: Sequence[Ranking]) -> Figure:
    """Draw every method's error in units of that of the first, with its paired 95 % interval.

    A panel for each group; filled marks are of methods that are level with the first.
    """
    columns = len(rankings) if len(rankings) <= _PANELS + 1 else _PANELS
    rows = -(-len(rankings) // columns)
    methods = [of.method for of in by_error(rankings[0])][::-1]
    size = 2.4 + 2.1 * columns, rows * (0.2 * len(methods) + 0.7) + 0.4
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, ranking in zip(grid, rankings, strict=False):
        clean_axes(axes)
        axes.axvline(1.0, color=MUTED, linewidth=0.8)
        by_name = {of.method: of for of in ranking.ranked}
        first = min((of.rmse_deg for of in ranking.ranked if of.rank == 1), default=None)
        for line, method in enumerate(methods):
            of = by_name.get(method)
            if of is None or first is None:
                continue
            colour = MUTED if own_style(method) is None else _colour(method)
            if of.to_best_ci95 is not None:
                axes.plot(of.to_best_ci95, [line, line], color=colour, linewidth=1.3)
            shape = "o" if of.rank is not None else "D"
            face = colour if is_level(of) else "white"
            axes.plot(of.rmse_deg / first, line, shape, markersize=4.2, color=colour, markerfacecolor=face)
        axes.set_xscale("log")
        log_ticks(axes.xaxis, (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100))
        axes.set_title(group_name((ranking.stroke_mm, ranking.twin)), fontsize=8.5, color=INK, loc="left")
        _list_methods(axes, methods)
    for axes in grid[len(rankings) :]:
        axes.set_visible(False)
    label = (
        "RMSE in units of the first's, geometric mean over noises, paired 95 % interval; "
        "filled: level with the first; diamonds do not compete"
    )
    figure.supxlabel(label, fontsize=8, color=INK)
    return figure


def is_level(of: MethodRank) -> bool:
    """Return whether a method competes, and is the first or level with it."""
    return of.rank is not None and (of.rank == 1 or of.to_best_ci95 is None or of.to_best_ci95[0] <= 1)


def interval_figure(scores: Sequence[Score]) -> Figure:
    """Draw the coverage of each method's 95 % interval, a dot for each noise, and next to it the CRPS."""
    stated = interval_scores(scores)
    methods = list(reversed(stated))
    figure = Figure(figsize=(8.5, 0.24 * len(methods) + 1.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    for axes in (left, right):
        clean_axes(axes)
        axes.tick_params(labelsize=7.5)
    left.axvspan(*_HONEST, color=MUTED, alpha=0.25, linewidth=0)
    for line, method in enumerate(methods):
        of = stated[method]
        own = own_style(of[0].method)
        style = {"color": MUTED if own is None else own.colour, "markeredgewidth": 0}
        left.plot([score.coverage95 for score in of], [line] * len(of), "o", markersize=4, alpha=0.7, **style)
        right.plot([score.crps_deg for score in of], [line] * len(of), "o", markersize=3, alpha=0.4, **style)
        right.plot(mean_of(of, "crps_deg"), line, "|", markersize=9, markeredgewidth=1.6, color=INK)
    left.set_yticks(range(len(methods)), methods, fontsize=7.5)
    left.set_xlim(-0.02, 1.02)
    left.xaxis.set_major_formatter(PercentFormatter(1.0))
    left.set_xlabel("truth within the 95 % interval, each noise; grey: 93 to 97 %", fontsize=8.5, color=INK)
    right.set_xscale("log")
    right.xaxis.set_major_formatter("{x:g}")
    right.set_xlabel("CRPS [deg]; line: geometric mean", fontsize=8.5, color=INK)
    return figure
