"""The full benchmark as tables and figures: every method, every noise, and how far all are from the limit."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tabulate import tabulate

from twin.estimation.registry import method_specs
from twin.evaluation.costs import Cost
from twin.evaluation.paper import noise_label
from twin.evaluation.ranking import Ranking
from twin.evaluation.score import Group, Score
from twin.evaluation.track import Track
from twin.report.best import clear_best
from twin.report.figures import to_png_bytes
from twin.report.intervals import interval_figure, interval_scores, interval_table
from twin.report.limit import (
    by_ratio,
    chosen_scores,
    groups_of,
    has_limit,
    is_limit,
    limit_figure,
    noise_figure,
    times_the_limit,
)
from twin.report.overall import overall_table
from twin.report.paper_figures import paper_figures
from twin.report.ranks import rank_figure, rank_table, rankings_to_draw
from twin.report.tables import aligned_table, group_name, paper_tables
from twin.report.trainings import training_table

Array = NDArray[np.float64]
Row = dict[str, Any]
"""A bound or an interval, as `evaluation.json` holds it."""


def benchmark_tables(
    scores: Sequence[Score],
    bounds: Sequence[Row],
    intervals: Sequence[Row] = (),
    rankings: Sequence[Ranking] = (),
    costs: Mapping[str, Cost] = MappingProxyType({}),
) -> str:
    """Return the benchmark in Markdown.

    Args:
        scores: of all sample times, strokes and twins.
        bounds: posterior Cramer-Rao bounds, as in `evaluation.json`.
        intervals: how often the set-membership filters held the truth.
        rankings: of every sample time and group.
        costs: of each method.
    """
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    first = groups_of(scores)[0]
    trainings = training_table(scores, "markdown")
    over = f"95 % interval over noise seeds{' and trainings' if trainings else ''}"
    parts = []
    for T in times:
        parts.append(f"### RMSE [deg], geometric mean over noises and strokes, T = {T:g} s")
        parts.append(overall_table(scores, T, costs))
    for T in times:
        parts.append(f"### RMSE [deg] ± half its {over}, {group_name(first)}, T = {T:g} s")
        parts.append(_noise_table(scores, T, first, "rmse_deg"))
    parts.append(f"### RMSE [deg] after the first 5 s, {group_name(first)}, T = {times[0]:g} s")
    parts.append(_noise_table(scores, times[0], first, "rmse_steady_deg"))
    for ranking in rankings:
        place = group_name((ranking.stroke_mm, ranking.twin))
        parts.append(f"### Ranks by the geometric mean over noises, {place}, T = {ranking.sample_time_s:g} s")
        parts.append(rank_table(ranking))
    for T in times if has_limit(scores) else ():
        parts.append(f"### Times the limit: geometric mean over noises, T = {T:g} s")
        parts.append(_ratio_table(scores, T))
    for T in times:
        if stated := interval_table(chosen_scores(scores, T, first)):
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
    named = {spec.name for spec in method_specs() if spec.presentation.in_paper_tables}
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
    longest, first = max(score.sample_time_s for score in scores), groups_of(scores)[0]
    shown = chosen_scores(scores, longest, first)
    ranked = rankings_to_draw(rankings)
    figures = {
        "rmse_by_noise.png": noise_figure(shown),
        **({"times_the_limit.png": limit_figure(scores)} if has_limit(scores) else {}),
        **({"ranks.png": rank_figure(ranked)} if ranked else {}),
        **({"intervals.png": interval_figure(shown)} if interval_scores(shown) else {}),
        **{f"figure_{number:02d}.png": drawn for number, (drawn, _) in paper_figures(tracks, shown).items()},
    }
    return {name: to_png_bytes(figure) for name, figure in figures.items()}


def _noise_table(scores: Sequence[Score], T: float, group: Group, index: str) -> str:
    chosen = chosen_scores(scores, T, group)
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
    return aligned_table(lines, headers)


def _ratio_table(scores: Sequence[Score], T: float) -> str:
    groups = groups_of(scores)
    table = {group: times_the_limit(scores, T, group) for group in groups}
    lines = [
        [method, *(f"{table[group][method]:.2f}" if method in table[group] else "-" for group in groups)]
        for method in by_ratio(scores, [T], groups)
    ]
    headers = ["method", *(group_name(group) for group in groups)]
    return aligned_table(lines, headers)


def _bound_table(scores: Sequence[Score], bounds: Sequence[Row]) -> str:
    """The bound is a mean over twins as they are drawn: it stands beside twins that are."""
    drawn = {
        (score.stroke_mm, score.sample_time_s, score.condition): score.rmse_deg
        for score in scores
        if is_limit(score.method) and score.twin in ("randomized", "measured")
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


def _place(row: Row) -> Group:
    return tuple(map(float, row["stroke_mm"])), str(row["twin"])


def _noise(row: Row) -> tuple[str, float]:
    return str(row["noise"]), float(row["level"])
