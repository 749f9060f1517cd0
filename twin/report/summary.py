"""The full benchmark as tables and figures: every method, every noise, and how far all are from the limit."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray
from tabulate import tabulate

from twin.estimation.registry import method_spec, method_specs
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.paper import noise_label
from twin.evaluation.ranking import Ranking
from twin.evaluation.score import Group, Score
from twin.evaluation.track import Track
from twin.report.best import clear_best
from twin.report.figures import INK, MUTED, clean_axes, own_style, to_png_bytes
from twin.report.intervals import interval_figure, interval_scores, interval_table
from twin.report.paper_figures import paper_figures
from twin.report.ranks import rank_figure, rank_table
from twin.report.tables import group_name, paper_tables
from twin.report.trainings import training_table

Array = NDArray[np.float64]
Row = dict[str, Any]
"""A bound or an interval, as `evaluation.json` holds it."""


def benchmark_tables(
    scores: Sequence[Score],
    bounds: Sequence[Row],
    intervals: Sequence[Row] = (),
    rankings: Sequence[Ranking] = (),
) -> str:
    """Return the benchmark in Markdown.

    Args:
        scores: of all sample times, strokes and twins.
        bounds: posterior Cramer-Rao bounds, as in `evaluation.json`.
        intervals: how often the set-membership filters held the truth.
        rankings: of every sample time and group.
    """
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    first = _groups(scores)[0]
    trainings = training_table(scores, "markdown")
    over = f"95 % interval over noise seeds{' and trainings' if trainings else ''}"
    parts = []
    for T in times:
        parts.append(f"### RMSE [deg] ± half its {over}, {group_name(first)}, T = {T:g} s")
        parts.append(_noise_table(scores, T, first, "rmse_deg"))
    parts.append(f"### RMSE [deg] after the first 5 s, {group_name(first)}, T = {times[0]:g} s")
    parts.append(_noise_table(scores, times[0], first, "rmse_steady_deg"))
    for ranking in rankings:
        place = group_name((ranking.stroke_mm, ranking.twin))
        parts.append(f"### Ranks by the geometric mean over noises, {place}, T = {ranking.sample_time_s:g} s")
        parts.append(rank_table(ranking))
    for T in times if _has_limit(scores) else ():
        parts.append(f"### Times the limit: geometric mean over noises, T = {T:g} s")
        parts.append(_ratio_table(scores, T))
    for T in times:
        if stated := interval_table(_chosen(scores, T, first)):
            parts.append(
                f"### 95 % intervals: share [%] that held the truth, {group_name(first)}, T = {T:g} s"
            )
            parts.append(stated)
    if trainings:
        parts.append("### Trainings that differ in their seed alone: geometric mean over noises [deg]")
        parts.append(trainings)
    if bounds:
        parts.append("### The limit over randomised twins, and the Cramér-Rao bound of normal twins [deg]")
        parts.append(_bound_table(scores, bounds))
    if intervals:
        parts.append("### Runs in which the interval held the truth throughout, and its mean width")
        parts.append(_interval_table(intervals))
    named = {spec.name for spec in method_specs() if spec.beside_paper}
    beside = [score for score in scores if score.group == first and score.method in named]
    paper = paper_tables(beside, "markdown")
    if paper:
        parts.append("### The paper's tables, on these records")
        parts.append(paper)
    return "\n\n".join(parts) + "\n"


def benchmark_figures(
    scores: Sequence[Score], tracks: Sequence[Track], rankings: Sequence[Ranking] = ()
) -> dict[str, bytes]:
    """Return PNG files by name: RMSE by noise, distance to the limit by records, and the paper's figures.

    Args:
        scores: of an evaluation.
        tracks: of the first group of records at the longest sample time.
        rankings: of every sample time and group.
    """
    longest, first = max(score.sample_time_s for score in scores), _groups(scores)[0]
    shown = _chosen(scores, longest, first)
    ranked = [ranking for ranking in rankings if ranking.sample_time_s == longest]
    figures = {
        "rmse_by_noise.png": noise_figure(shown),
        **({"times_the_limit.png": limit_figure(scores)} if _has_limit(scores) else {}),
        **({"ranks.png": rank_figure(ranked)} if ranked and len(ranked[0].ranked) > 1 else {}),
        **({"intervals.png": interval_figure(shown)} if interval_scores(shown) else {}),
        **{f"figure_{number:02d}.png": drawn for number, (drawn, _) in paper_figures(tracks, shown).items()},
    }
    return {name: to_png_bytes(figure) for name, figure in figures.items()}


def times_the_limit(scores: Sequence[Score], sample_time_s: float, group: Group) -> dict[str, float]:
    """Return how many times the limit's RMSE each method has: the geometric mean over noises.

    Args:
        scores: of an evaluation.
        sample_time_s: which sample time [s].
        group: stroke [mm] and kind of twin.
    """
    chosen = _chosen(scores, sample_time_s, group)
    limit = {score.condition: score.rmse_deg for score in chosen if _is_limit(score.method)}
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
    columns = 5
    lines = -(-len(noises) // columns)
    figure = Figure(figsize=(11, 0.22 * len(methods) * lines + 1.4), layout="constrained")
    grid = np.atleast_1d(figure.subplots(lines, columns, sharey=True, sharex=True, squeeze=False)).ravel()
    values = {(score.condition, score.method): score for score in scores}
    limits = {score.condition: score.rmse_deg for score in scores if _is_limit(score.method)}
    for axes, noise in zip(grid, noises, strict=False):
        clean_axes(axes)
        if noise in limits:
            axes.axvline(limits[noise], color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
        for line, method in enumerate(methods):
            score = values[noise, method]
            low, high = score.rmse_ci95_deg
            own = own_style(method)
            colour = INK if _is_limit(method) else MUTED if own is None else own.colour
            axes.plot([max(low, 1e-3), high], [line, line], color=colour, linewidth=1.4)
            face = "white" if score.oracle else colour
            axes.plot(score.rmse_deg, line, "o", markersize=4.2, color=colour, markerfacecolor=face)
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(FixedLocator([0.1, 0.3, 1, 3, 10]))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_title(noise_label(*noise), fontsize=8.5, color=INK, loc="left")
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
    groups = _groups(scores)
    table = {(T, group): times_the_limit(scores, T, group) for T in times for group in groups}
    methods = _by_ratio(scores, times, groups)
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


def _noise_table(scores: Sequence[Score], T: float, group: Group, index: str) -> str:
    chosen = _chosen(scores, T, group)
    noises = list(dict.fromkeys(score.condition for score in chosen))
    values = {(score.method, score.condition): score for score in chosen}
    methods = list(dict.fromkeys(score.method for score in chosen))
    of_rmse = index == "rmse_deg"
    best = {
        noise: clear_best(score for score in chosen if score.condition == noise) if of_rmse else None
        for noise in noises
    }
    lines = []
    for method in methods:
        cells = []
        for noise in noises:
            score = values[method, noise]
            text = f"{getattr(score, index):.3f}"
            if of_rmse:
                low, high = score.rmse_ci95_deg
                text += f" ± {(high - low) / 2:.3f}"
            cells.append(f"**{text}**" if best[noise] == score.label else text)
        lines.append([score.label, *cells])
    headers = ["method", *(noise_label(*noise) for noise in noises)]
    align = ("left", *["right"] * len(noises))
    return str(tabulate(lines, headers, tablefmt="pipe", disable_numparse=True, colalign=align))


def _ratio_table(scores: Sequence[Score], T: float) -> str:
    groups = _groups(scores)
    table = {group: times_the_limit(scores, T, group) for group in groups}
    lines = [
        [method, *(f"{table[group][method]:.2f}" if method in table[group] else "-" for group in groups)]
        for method in _by_ratio(scores, [T], groups)
    ]
    headers = ["method", *(group_name(group) for group in groups)]
    align = ("left", *["right"] * len(groups))
    return str(tabulate(lines, headers, tablefmt="pipe", disable_numparse=True, colalign=align))


def _bound_table(scores: Sequence[Score], bounds: Sequence[Row]) -> str:
    """The bound is a mean over twins as they are drawn: it stands beside twins that are."""
    drawn = {
        (score.stroke_mm, score.sample_time_s, score.condition): score.rmse_deg
        for score in scores
        if _is_limit(score.method) and score.twin in ("randomized", "measured")
    }
    noises = list(dict.fromkeys(map(_noise, bounds)))
    lines: dict[Any, list[str]] = {}
    for bound in bounds:
        key = (tuple(bound["stroke_mm"]), bound["sample_time_s"])
        low, high = bound["stroke_mm"]
        line = lines.setdefault(key, [f"[{low:g}, {high:g}] mm", f"{bound['sample_time_s']:g} s"])
        found = drawn.get((*key, _noise(bound)))
        line.append(f"{'-' if found is None else f'{found:.3f}'} / {bound['rmse_deg']:.3f}")
    headers = ["stroke", "T", *(f"{noise_label(*noise)}: limit / bound" for noise in noises)]
    return str(tabulate(list(lines.values()), headers, tablefmt="pipe", disable_numparse=True))


def _interval_table(intervals: Sequence[Row]) -> str:
    groups = list(dict.fromkeys(map(_place, intervals)))
    lines = []
    for row in intervals:
        if _place(row) == groups[0]:
            same = [
                other
                for other in intervals
                if all(other[name] == row[name] for name in ("method", "noise", "level", "sample_time_s"))
            ]
            cells = {_place(other): other for other in same}
            lines.append(
                [
                    row["method"],
                    noise_label(*_noise(row)),
                    f"{row['sample_time_s']:g} s",
                    *(
                        f"{100 * cells[group]['runs_contained']:.1f} %, {cells[group]['width_deg']:.2f} deg"
                        for group in groups
                    ),
                ]
            )
    headers = ["method", "noise", "T", *(group_name(group) for group in groups)]
    return str(tabulate(lines, headers, tablefmt="pipe", disable_numparse=True))


def _by_ratio(scores: Sequence[Score], times: Sequence[float], groups: Sequence[Group]) -> list[str]:
    """Methods, the nearest to the limit first, by their mean over groups and sample times."""
    ratios: dict[str, list[float]] = {}
    for T in times:
        for group in groups:
            for method, ratio in times_the_limit(scores, T, group).items():
                ratios.setdefault(method, []).append(np.log(ratio))
    return sorted(ratios, key=lambda method: float(np.mean(ratios[method])))


def _chosen(scores: Sequence[Score], sample_time_s: float, group: Group) -> list[Score]:
    """Return the scores of one sample time and one kind of records."""
    return [score for score in scores if score.sample_time_s == sample_time_s and score.group == group]


def _groups(scores: Sequence[Score]) -> list[Group]:
    return list(dict.fromkeys(score.group for score in scores))


def _place(row: Row) -> Group:
    return tuple(map(float, row["stroke_mm"])), str(row["twin"])


def _noise(row: Row) -> tuple[str, float]:
    return str(row["noise"]), float(row["level"])


def _is_limit(method: str) -> bool:
    spec = method_spec(method)
    return spec is not None and spec.is_limit


def _has_limit(scores: Sequence[Score]) -> bool:
    return any(_is_limit(score.method) for score in scores)
