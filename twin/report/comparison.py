"""A comparison as files of text: tables in Markdown, a page for each noise, and CSV for other tools."""

import csv
import dataclasses
import io
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from tabulate import tabulate

from twin.estimation.registry import method_spec, method_specs
from twin.evaluation.costs import Cost
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.paper import noise_label
from twin.evaluation.protocol import RECORDED, SUITES, Condition
from twin.evaluation.ranking import Ranking
from twin.evaluation.score import Group, Score, mean_coverage, rmse_by
from twin.files.atomic import MADE_BY
from twin.report.tables import (
    aligned_table,
    chosen_scores,
    clear_best,
    group_name,
    groups_of,
    has_limit,
    is_limit,
    paper_tables,
    rank_table,
    times_the_limit,
    training_table,
    twin_name,
)
from twin.signals.noise import noise_variance

Row = dict[str, Any]
"""A bound or an interval, as `evaluation.json` holds it."""


def comparison_tables(
    scores: Sequence[Score],
    bounds: Sequence[Row],
    intervals: Sequence[Row] = (),
    rankings: Sequence[Ranking] = (),
    costs: Mapping[str, Cost] = MappingProxyType({}),
) -> str:
    """Return a comparison in Markdown.

    Args:
        scores: of all sample times, strokes and twins.
        bounds: posterior Cramer-Rao bounds, as in `evaluation.json`.
        intervals: coverage of the set-membership filters, likewise.
        rankings: of every sample time and group.
        costs: of each method.
    """
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    longest, first = times[0], groups_of(scores)[0]
    trainings = training_table(scores, "markdown")
    over = f"95 % interval over noise seeds{' and trainings' if trainings else ''}"
    parts = {}
    for T in times:
        parts[f"RMSE [deg], geometric mean over noises and strokes, T = {T:g} s"] = overall_table(
            scores, T, costs
        )
    for T in times:
        title = f"RMSE [deg] ± half its {over}, {group_name(first)}, T = {T:g} s"
        parts[title] = _noise_table(chosen_scores(scores, T, first), "rmse_deg")
    title = f"RMSE [deg] after the first 5 s, {group_name(first)}, T = {longest:g} s"
    parts[title] = _noise_table(chosen_scores(scores, longest, first), "rmse_steady_deg")
    for ranking in rankings:
        place = f"{group_name((ranking.stroke_mm, ranking.twin))}, T = {ranking.sample_time_s:g} s"
        parts[f"Ranks by the geometric mean over noises, {place}"] = rank_table(ranking)
    for T in times if has_limit(scores) else ():
        parts[f"Times the limit: geometric mean over noises, T = {T:g} s"] = _limit_table(scores, T)
    for T in times:
        title = f"95 % intervals: share [%] that held the truth, {group_name(first)}, T = {T:g} s"
        parts[title] = interval_table(chosen_scores(scores, T, first))
    parts["Trainings that differ in their seed alone: geometric mean over noises [deg]"] = trainings
    title = "The limit over randomised twins, and the Cramér-Rao bound of normal twins [deg]"
    parts[title] = _bound_table(scores, bounds) if bounds else ""
    title = "Runs in which the interval held the truth throughout, and its mean width"
    parts[title] = _containment_table(intervals) if intervals else ""
    named = {spec.name for spec in method_specs() if spec.presentation.in_paper_tables}
    of_paper = [score for score in scores if score.group == first and score.method in named]
    parts["The paper's tables, on these records"] = paper_tables(of_paper, "markdown")
    return "\n\n".join(f"### {title}\n\n{part}" for title, part in parts.items() if part) + "\n"


def overall_table(scores: Sequence[Score], sample_time_s: float, costs: Mapping[str, Cost]) -> str:
    """Return the methods in Markdown, the least error on top.

    Errors are geometric means of the RMSE [deg] over noises and strokes, for each kind of twin and for all
    kinds; then their ratio to the limit, coverage of the 95 % interval, and costs.
    """
    chosen = [score for score in scores if score.sample_time_s == sample_time_s]
    twins = list(dict.fromkeys(score.twin for score in chosen))
    methods: dict[str, list[Score]] = {}
    for score in chosen:
        methods.setdefault(score.method, []).append(score)
    found = {method: rmse_by(own, lambda score: score.twin) for method, own in methods.items()}
    mean = {method: float(geometric_mean(np.array([*of.values()]))) for method, of in found.items()}
    limits = times_the_limit(chosen, [sample_time_s], groups_of(chosen))
    lines = []
    for method in sorted(methods, key=lambda name: mean[name]):
        coverage, cost = mean_coverage(methods[method]), costs.get(method, Cost())
        lines.append(
            [
                methods[method][0].label,
                *(_figure(found[method].get(twin), ".2f") for twin in twins),
                f"{mean[method]:.2f}",
                *([f"{limits[method]:.2f}"] if limits else []),
                _figure(None if coverage is None else 100 * coverage, ".0f"),
                str(methods[method][0].trainings),
                _figure(None if cost.training_s is None else cost.training_s / 60, ".1f"),
                _figure(cost.parameters, "d"),
                _figure(cost.sample_us, ".0f"),
            ]
        )
    headers = ["method", *map(twin_name, twins), "all", *(["times the limit"] if limits else [])]
    headers += ["coverage [%]", "trainings", "a training [min]", "parameters", "a sample [µs]"]
    return aligned_table(lines, headers)


def _figure(value: float | None, form: str) -> str:
    return "-" if value is None else f"{value:{form}}"


def _noise_table(scores: Sequence[Score], index: str) -> str:
    """Return an index of every method under every noise; RMSE with half its interval, the clear best bold."""
    noises = list(dict.fromkeys(score.condition for score in scores))
    cells = {(score.method, score.condition): score for score in scores}
    is_rmse = index == "rmse_deg"
    best = {
        noise: clear_best(of for of in scores if of.condition == noise) if is_rmse else None
        for noise in noises
    }
    lines = []
    for method in dict.fromkeys(score.method for score in scores):
        own = [cells[method, noise] for noise in noises]
        texts = [_rmse(of) if is_rmse else f"{getattr(of, index):.3f}" for of in own]
        bold = [
            f"**{text}**" if best[of.condition] == of.label else text
            for of, text in zip(own, texts, strict=True)
        ]
        lines.append([own[0].label, *bold])
    return aligned_table(lines, ["method", *(noise_label(*noise) for noise in noises)])


def _rmse(score: Score) -> str:
    low, high = score.rmse_ci95_deg
    return f"{score.rmse_deg:.3f} ± {(high - low) / 2:.3f}"


def _limit_table(scores: Sequence[Score], T: float) -> str:
    groups = groups_of(scores)
    columns = [times_the_limit(scores, [T], [group]) for group in groups]
    lines = [
        [method, *(_figure(column.get(method), ".2f") for column in columns)]
        for method in times_the_limit(scores, [T], groups)
    ]
    return aligned_table(lines, ["method", *map(group_name, groups)])


def interval_scores(scores: Sequence[Score]) -> dict[str, list[Score]]:
    """Return the scores of each method that states intervals, the least CRPS first."""
    stated: dict[str, list[Score]] = {}
    for score in scores:
        if score.coverage95 is not None and score.crps_deg is not None:
            stated.setdefault(score.label, []).append(score)
    return dict(sorted(stated.items(), key=lambda item: mean_of(item[1], "crps_deg")))


def mean_of(scores: Sequence[Score], index: str) -> float:
    """Return the geometric mean of an index over the scores that state it; NaN where none does."""
    values = [value for score in scores if (value := getattr(score, index))]
    return float(geometric_mean(np.array(values))) if values else np.nan


def interval_table(scores: Sequence[Score]) -> str:
    """Return coverage by noise, width, NEES, NIS and CRPS of each method in Markdown; empty without any."""
    stated = interval_scores(scores)
    noises = list(dict.fromkeys(score.condition for of in stated.values() for score in of))
    lines = []
    for method, of in stated.items():
        coverage = {score.condition: 100 * (score.coverage95 or 0.0) for score in of}
        nis = mean_of(of, "nis")
        lines.append(
            [
                method,
                *(_figure(coverage.get(noise), ".0f") for noise in noises),
                f"{np.mean([score.width95_deg or 0.0 for score in of]):.2f}",
                f"{mean_of(of, 'nees'):.2f}",
                "-" if np.isnan(nis) else f"{nis:.2f}",
                f"{mean_of(of, 'crps_deg'):.3f}",
            ]
        )
    headers = ["method", *(noise_label(*of) for of in noises), "width [deg]", "NEES", "NIS", "CRPS [deg]"]
    return aligned_table(lines, headers) if lines else ""


def _bound_table(scores: Sequence[Score], bounds: Sequence[Row]) -> str:
    """The bound is a mean over randomised twins, and is compared with the limit over such twins."""
    limits = {
        (score.stroke_mm, score.sample_time_s, score.condition): score.rmse_deg
        for score in scores
        if is_limit(score.method) and score.twin in ("randomized", "measured")
    }
    noises = list(dict.fromkeys(map(_noise, bounds)))
    lines: dict[Any, list[str]] = {}
    for bound in bounds:
        key = (tuple(bound["stroke_mm"]), bound["sample_time_s"])
        line = lines.setdefault(key, ["[{:g}, {:g}] mm".format(*key[0]), f"{key[1]:g} s"])
        line.append(f"{_figure(limits.get((*key, _noise(bound))), '.3f')} / {bound['rmse_deg']:.3f}")
    headers = ["stroke", "T", *(f"{noise_label(*noise)}: limit / bound" for noise in noises)]
    return str(tabulate(list(lines.values()), headers, tablefmt="pipe", disable_numparse=True))


def _containment_table(intervals: Sequence[Row]) -> str:
    groups = list(dict.fromkeys(map(_place, intervals)))
    lines: dict[Any, dict[Group, str]] = {}
    for row in intervals:
        cells = lines.setdefault((row["method"], _noise(row), row["sample_time_s"]), {})
        cells[_place(row)] = f"{100 * row['runs_contained']:.1f} %, {row['width_deg']:.2f} deg"
    rows = [
        [method, noise_label(*noise), f"{T:g} s", *(cells.get(group, "-") for group in groups)]
        for (method, noise, T), cells in lines.items()
    ]
    headers = ["method", "noise", "T", *map(group_name, groups)]
    return str(tabulate(rows, headers, tablefmt="pipe", disable_numparse=True))


def _place(row: Row) -> Group:
    return tuple(map(float, row["stroke_mm"])), str(row["twin"])


def _noise(row: Row) -> Condition:
    return str(row["noise"]), float(row["level"])


def page_name(condition: Condition) -> str:
    """Return the name of the page of a noise."""
    kind, level = condition
    return f"condition_{kind}.md" if kind == RECORDED else f"condition_{kind}_{level:g}.md"


def page_names() -> list[str]:
    """Return the names of the pages of every suite."""
    conditions = [condition for suite in SUITES.values() for condition in suite]
    return list(dict.fromkeys(map(page_name, [*conditions, (RECORDED, 0.0)])))


def condition_pages(scores: Sequence[Score]) -> dict[str, str]:
    """Return a page in Markdown for each noise, by its name: every method on every group of episodes."""
    conditions = list(dict.fromkeys(score.condition for score in scores))
    return {page_name(condition): _page(scores, condition) for condition in conditions}


def _page(scores: Sequence[Score], condition: Condition) -> str:
    kind, level = condition
    variance = level if kind == RECORDED else noise_variance(kind, level)
    parts = [
        f"# {noise_label(*condition)}",
        f"Filters are given R = {variance:.3g} deg^2. A figure in bold is below that of every other method "
        "that competes, beyond its paired 95 % interval.",
    ]
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    for group in groups_of(scores):
        for T in times:
            of = [score for score in chosen_scores(scores, T, group) if score.condition == condition]
            if of:
                parts += [f"## {group_name(group)}, T = {T:g} s", _condition_table(of)]
    return "\n\n".join(parts) + f"\n\n<!-- {MADE_BY} -->\n"


def _condition_table(scores: Sequence[Score]) -> str:
    """Return the methods under one noise on one group of episodes, the least error on top."""
    best = clear_best(scores)
    lines = []
    for score in sorted(scores, key=lambda of: of.rmse_deg):
        spec, to_best = method_spec(score.method), score.to_best_ci95
        lines.append(
            [
                score.label,
                spec.noise_information if spec else "-",
                f"**{_rmse(score)}**" if score.label == best else _rmse(score),
                f"{to_best[0]:.2f} to {to_best[1]:.2f}" if to_best else "-",
                f"{score.rmse_steady_deg:.3f}",
                _figure(None if score.coverage95 is None else 100 * score.coverage95, ".0f"),
                _figure(score.width95_deg, ".2f"),
            ]
        )
    headers = ["method", "knows of the noise", "RMSE [deg]", "times the best", "after 5 s [deg]"]
    return aligned_table(lines, [*headers, "coverage [%]", "width [deg]"], left=2)


def scores_csv(scores: Sequence[Score]) -> str:
    """Return the scores as CSV, a line each; unknown values are empty."""
    return _csv(list(map(_score_row, scores)))


def _score_row(score: Score) -> Row:
    """`times_best` is the paired interval to the best method."""
    low_mm, high_mm = score.stroke_mm if len(score.stroke_mm) == 2 else (None, None)
    best_low, best_high = score.to_best_ci95 or (None, None)
    return {
        "method": score.method,
        "oracle": str(score.oracle).lower(),
        "noise": score.noise,
        "level": score.level,
        "sample_time_s": score.sample_time_s,
        "stroke_low_mm": low_mm,
        "stroke_high_mm": high_mm,
        "twin": score.twin,
        "rmse_deg": score.rmse_deg,
        "rmse_low_deg": score.rmse_ci95_deg[0],
        "rmse_high_deg": score.rmse_ci95_deg[1],
        "rmse_steady_deg": score.rmse_steady_deg,
        "times_best_low": best_low,
        "times_best_high": best_high,
        "coverage95": score.coverage95,
        "width95_deg": score.width95_deg,
        "crps_deg": score.crps_deg,
        "seeds": score.seeds,
        "trainings": score.trainings,
    }


def costs_csv(costs: Mapping[str, Cost]) -> str:
    """Return the costs as CSV, a line for each method; unknown values are empty."""
    return _csv([{"method": method} | dataclasses.asdict(cost) for method, cost in costs.items()])


def _csv(rows: Sequence[Row]) -> str:
    """Return rows under the names of their columns, numbers to four digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows[0])
    for row in rows:
        writer.writerow(f"{cell:.4g}" if isinstance(cell, float) else cell for cell in row.values())
    return text.getvalue()
