"""Tables of scores in plain text and Markdown, among them the paper's Tables II and III; choice of rows."""

import csv
import dataclasses
import io
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from tabulate import tabulate

from twin.errors import InputError
from twin.estimation.methods import METHODS
from twin.estimation.registry import method_spec, method_specs, source_of
from twin.evaluation.costs import Cost
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.paper import TABLES, PaperTable, noise_label, paper_value
from twin.evaluation.protocol import RECORDED, SUITES, Condition
from twin.evaluation.ranking import MethodRank, Ranking, competes
from twin.evaluation.score import Group, Score, mean_coverage, rmse_by
from twin.files.atomic import MADE_BY
from twin.signals.noise import noise_variance

FORMATS = {"plain": "simple", "markdown": "pipe"}
INDEX_LABELS = {
    "mae_deg": "MAE [deg]",
    "rmse_deg": "RMSE [deg]",
    "md_deg": "MD [deg]",
    "var_deg2": "Var [deg²]",
    "bias_deg": "bias [deg]",
}
BOLD = (
    "Bold: better than every other method that can be deployed, in paired tests at 5 % for all noises of "
    "these records together."
)
"""What a figure in bold means in every table: `Score.is_best`."""
MOST_FRONT = 9  # methods that a first look has room for
Row = dict[str, Any]  # a bound or an interval, as `evaluation.json` holds it


def ordered(methods: Iterable[str]) -> list[str]:
    """Return method names once each, in the order of the method table; others follow, as they came."""
    places = {spec.name: place for place, spec in enumerate(method_specs())}
    return sorted(dict.fromkeys(methods), key=lambda name: places.get(name, len(places)))


def groups_of(scores: Sequence[Score]) -> list[Group]:
    """Return the groups of episodes, in their order."""
    return list(dict.fromkeys(score.group for score in scores))


def chosen_scores(scores: Sequence[Score], sample_time_s: float, group: Group) -> list[Score]:
    """Return the scores of one sample time and one group of episodes."""
    return [score for score in scores if score.sample_time_s == sample_time_s and score.group == group]


def protocol_scores(scores: Sequence[Score], sample_time_s: float | None = None) -> list[Score]:
    """Return the scores of the paper's protocol: the first group, and one or the longest sample time."""
    first = [score for score in scores if score.group == scores[0].group]
    if not first:
        return []
    longest = max(score.sample_time_s for score in first)
    wanted = longest if sample_time_s is None else sample_time_s
    return [score for score in first if score.sample_time_s == wanted]


def front_scores(scores: Sequence[Score]) -> list[Score]:
    """Return the scores that a first look is for: of `front_noises`, the paper's methods and the two best.

    Of few methods, all are.
    """
    found = front_noises(scores)
    best = best_two(found)
    few = len({of.label for of in found}) <= MOST_FRONT
    return [of for of in found if few or of.label in best or _is_of_the_paper(of.method)]


def front_noises(scores: Sequence[Score]) -> list[Score]:
    """Return the scores of all methods under the paper's noises.

    Dithered Poisson noises stand for the paper's where those are missing; without any of its noises, the
    first five are taken.
    """
    first = protocol_scores(scores)
    noises = dict.fromkeys(score.condition for score in first)
    papers = [(table.noise, level) for table in TABLES for level in table.values]
    named = [of if of in noises else (f"{of[0]}-dithered", of[1]) for of in papers]
    chosen = [of for of in named if of in noises] or list(noises)[: len(papers)]
    found = (of for of in first if of.condition in chosen)
    return sorted(found, key=lambda of: chosen.index(of.condition))


def _is_of_the_paper(method: str) -> bool:
    spec = method_spec(method)
    return spec is None or spec.presentation.in_paper_tables or spec.name not in METHODS


def is_deployable(score: Score) -> bool:
    """Return whether a method can be deployed: it knows neither the truth nor the density of the noise."""
    return competes(score.method, score.oracle)


def mean_errors(scores: Sequence[Score]) -> dict[str, float]:
    """Return the geometric mean over noises of each method's RMSE [deg], by label, the least first.

    Methods that lack a noise which others have are last.
    """
    by_label: dict[str, list[float]] = {}
    for score in scores:
        by_label.setdefault(score.label, []).append(score.rmse_deg)
    means = {label: float(geometric_mean(np.array(of))) for label, of in by_label.items()}
    return dict(sorted(means.items(), key=lambda item: (-len(by_label[item[0]]), item[1])))


def best_two(scores: Sequence[Score]) -> list[str]:
    """Return the labels of the best deployable method and of the next that is no part of the same file."""
    sources = {score.label: source_of(score.method) for score in scores if is_deployable(score)}
    ranked = list(mean_errors([score for score in scores if score.label in sources]))
    return ranked[:1] + [label for label in ranked if sources[label] != sources[ranked[0]]][:1]


def best_deployable(scores: Sequence[Score]) -> str | None:
    """Return the label of the deployable method with the least mean error; None without any."""
    return next(iter(mean_errors([score for score in scores if is_deployable(score)])), None)


def is_limit(method: str) -> bool:
    """Return whether a method is the limit that others are measured against."""
    spec = method_spec(method)
    return spec is not None and spec.presentation.is_limit


def has_limit(scores: Sequence[Score]) -> bool:
    """Return whether the limit is among the scores."""
    return any(is_limit(score.method) for score in scores)


def times_the_limit(
    scores: Sequence[Score], times: Sequence[float], groups: Sequence[Group]
) -> dict[str, float]:
    """Return each method's RMSE over that of the limit, the nearest to it first."""
    ratios: dict[str, list[float]] = {}
    for T in times:
        for group in groups:
            chosen = chosen_scores(scores, T, group)
            limit = {score.condition: score.rmse_deg for score in chosen if is_limit(score.method)}
            own: dict[str, list[float]] = {}
            for score in chosen:
                if score.condition in limit:
                    own.setdefault(score.method, []).append(score.rmse_deg / limit[score.condition])
            for method, of in own.items():
                ratios.setdefault(method, []).append(float(geometric_mean(np.array(of))))
    means = {method: float(geometric_mean(np.array(of))) for method, of in ratios.items()}
    return dict(sorted(means.items(), key=lambda item: item[1]))


def group_name(group: Group) -> str:
    """Return the name of a group of episodes: the kind of twin and the stroke."""
    stroke, twin = group
    return f"{twin}, [{', '.join(f'{end:g}' for end in stroke)}] mm" if stroke else twin


def setting(group: Group, sample_time_s: float, seeds: int = 0) -> str:
    """Return what the scores of a table share: records, sample time and, if given, draws of noise."""
    draws = f"{seeds} draws of each noise" if seeds else ""
    return ", ".join(filter(None, (group_name(group), f"T = {sample_time_s:g} s", draws)))


def twin_name(twin: str) -> str:
    """Return the heading of a column of one kind of twin."""
    return "the preset" if twin == "nominal" else twin


def aligned_table(
    lines: Sequence[Sequence[str]], headers: Sequence[str], *, left: int = 1, fmt: str = "markdown"
) -> str:
    """Return a table whose first `left` columns are words, on the left, the others figures, on the right."""
    align = ("left",) * left + ("right",) * (len(headers) - left)
    return str(tabulate(lines, headers, tablefmt=FORMATS[fmt], colalign=align, disable_numparse=True))


def in_brackets(interval: tuple[float, float] | None, form: str) -> str:
    """Return an interval in a format, to follow its figure; empty where there is none."""
    return "" if interval is None else f" ({interval[0]:{form}} to {interval[1]:{form}})"


def paper_figure(published: float, decimals: int = 3) -> str:
    """Return a published figure, of which the paper prints four decimals; a last 5 is rounded up."""
    return f"{published + 1e-9:.{decimals}f}"


def published_value(score: Score, index: str) -> float | None:
    """Return the paper's figure for a score; None without one, or for another instrument."""
    return None if score.paper_rmse_deg is None else paper_value(*score.condition, score.label, index)


def table_title(table: PaperTable) -> str:
    """Return the heading of a table: its number in the paper, and the noise."""
    return f"Table {table.number}: {table.noise.capitalize()} noise that strict training never saw"


def paper_table(
    scores: Sequence[Score], noise: str, fmt: str = "plain", *, sample_time_s: float | None = None
) -> str:
    """Return Table II (`noise` = gaussian) or III (poisson): a line per level and index, a column per method.

    Cells are as `0.700 (paper 0.635)`; in Markdown, an RMSE that `is_best` is bold. The sample
    time is the longest, if not given. Empty where no score belongs to the table.
    """
    table = next((table for table in TABLES if table.noise == noise), None)
    if table is None:
        raise InputError(f"no table of {noise!r} noise; valid: {', '.join(table.noise for table in TABLES)}")
    chosen = [score for score in protocol_scores(scores, sample_time_s) if score.noise == noise]
    cells = {(score.level, score.label): score for score in chosen}
    methods = ordered(score.label for score in chosen)

    def cell(score: Score | None, index: str) -> str:
        if score is None:
            return "-"
        ours = f"{getattr(score, index):.3f}"
        ours = f"**{ours}**" if score.is_best and index == "rmse_deg" and fmt == "markdown" else ours
        published = published_value(score, index)
        return ours if published is None else f"{ours} (paper {paper_figure(published)})"

    lines = []
    for level in sorted({level for level, _ in cells} & set(table.values)):
        rows = [cells.get((level, method)) for method in methods]
        for place, (index, label) in enumerate(INDEX_LABELS.items()):
            name = "" if place else f"{table.symbol} = {level:g}"
            lines.append([name, label, *(cell(score, index) for score in rows)])
    return aligned_table(lines, ["noise", "index", *methods], left=2, fmt=fmt) if lines else ""


def paper_tables(scores: Sequence[Score], fmt: str = "plain", *, sample_time_s: float | None = None) -> str:
    """Return both tables under their titles; arguments as for `paper_table`."""
    parts = []
    for table in TABLES:
        if body := paper_table(scores, table.noise, fmt, sample_time_s=sample_time_s):
            title = table_title(table)
            parts.append(f"{f'**{title}**' if fmt == 'markdown' else title}\n\n{body}")
    return "\n\n".join(parts)


def score_table(scores: Sequence[Score], fmt: str = "plain") -> str:
    """Return every score as a line: group of episodes, noise, method and indices."""
    lines = []
    for score in scores:
        figures = (f"{getattr(score, index):.3f}" for index in INDEX_LABELS)
        lines.append([group_name(score.group), noise_label(*score.condition), score.label, *figures])
    return aligned_table(lines, ["records", "noise", "method", *INDEX_LABELS.values()], left=3, fmt=fmt)


def training_table(scores: Sequence[Score], fmt: str = "plain") -> str:
    """Return the spread between trainings that differ in their seed alone; empty where there are none.

    A line for each method, group and sample time: over trainings, mean, standard deviation, best and worst of
    the geometric mean over noises of the RMSE [deg].
    """
    rows = [score for score in scores if score.training_rmse_deg]
    lines = []
    for name in ordered(row.label for row in rows):
        ours = [row for row in rows if row.label == name]
        for group, T in dict.fromkeys((row.group, row.sample_time_s) for row in ours):
            rmse = np.array([row.training_rmse_deg for row in chosen_scores(ours, T, group)])
            means = geometric_mean(rmse, axis=0)
            figures = means.mean(), means.std(ddof=1), means.min(), means.max()
            over = f"{100 * (means.max() / means.mean() - 1):.1f} %"
            place = [name, group_name(group), f"{T:g} s", str(len(means))]
            lines.append([*place, *(f"{figure:.3f}" for figure in figures), over])
    headers = ["method", "records", "T", "trainings", "mean", "deviation", "best", "worst", "worst over mean"]
    return aligned_table(lines, headers, left=2, fmt=fmt) if lines else ""


def by_error(ranking: Ranking) -> list[MethodRank]:
    """Return the methods of a ranking, the least error first."""
    return sorted(ranking.ranked, key=lambda of: of.rmse_deg)


def rank_table(ranking: Ranking) -> str:
    """Return the methods of a group in Markdown, the least error first: error, rank, ratio to the first."""
    lines = []
    for of in by_error(ranking):
        error = f"{of.rmse_deg:.3f}" + in_brackets(of.rmse_ci95_deg, ".3f")
        rank = "-" if of.rank is None else f"{of.rank}" + in_brackets(of.rank_ci95, "d")
        lines.append([of.method, error, rank, _ends(of.to_best_ci95)])
    return aligned_table(lines, ["method", "RMSE [deg]", "rank", "times the first"])


def comparison_tables(
    scores: Sequence[Score],
    bounds: Sequence[Row],
    intervals: Sequence[Row] = (),
    rankings: Sequence[Ranking] = (),
    costs: Mapping[str, Cost] = MappingProxyType({}),
) -> str:
    """Return a comparison in Markdown, of all sample times, strokes and twins."""
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    longest, first = times[0], groups_of(scores)[0]
    trainings = training_table(scores, "markdown")
    over = f"95 % interval over noise seeds{' and trainings' if trainings else ''}"
    overall = "RMSE [deg], geometric mean over noises and strokes, T = {:g} s"
    parts = {overall.format(T): overall_table(scores, T, costs) for T in times}
    for T in times:
        title = f"RMSE [deg] ± half its {over}, {setting(first, T)}"
        parts[title] = _noise_table(chosen_scores(scores, T, first), "rmse_deg")
    title = f"RMSE [deg] after the first 5 s, {setting(first, longest)}"
    parts[title] = _noise_table(chosen_scores(scores, longest, first), "rmse_steady_deg")
    for ranking in rankings:
        place = setting((ranking.stroke_mm, ranking.twin), ranking.sample_time_s)
        parts[f"Ranks by the geometric mean over noises, {place}"] = rank_table(ranking)
    for T in times if has_limit(scores) else ():
        parts[f"Times the limit: geometric mean over noises, T = {T:g} s"] = _limit_table(scores, T)
    for T in times:
        title = f"95 % intervals: share [%] that held the truth, {setting(first, T)}"
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
        errors = [found[method].get(twin) for twin in twins] + [mean[method]]
        errors += [limits[method]] if limits else []
        minutes = None if cost.training_s is None else cost.training_s / 60
        figures = ((minutes, ".1f"), (cost.parameters, "d"), (cost.sample_us, ".0f"))
        line = [methods[method][0].label, *(_figure(error, ".2f") for error in errors), percent(coverage)]
        lines.append([*line, str(methods[method][0].trainings), *(_figure(*of) for of in figures)])
    headers = ["method", *map(twin_name, twins), "all", *(["times the limit"] if limits else [])]
    headers += ["coverage [%]", "trainings", "a training [min]", "parameters", "a sample [µs]"]
    return aligned_table(lines, headers)


def _figure(value: float | None, form: str) -> str:
    return "-" if value is None else f"{value:{form}}"


def percent(share: float | None) -> str:
    """Return a share in percent, without decimals; a dash for an unknown one."""
    return _figure(None if share is None else 100 * share, ".0f")


def _ends(interval: tuple[float, float] | None) -> str:
    return "-" if interval is None else f"{interval[0]:.2f} to {interval[1]:.2f}"


def _noise_table(scores: Sequence[Score], index: str) -> str:
    noises = list(dict.fromkeys(score.condition for score in scores))
    cells = {(score.method, score.condition): score for score in scores}

    def cell(of: Score) -> str:
        return _rmse(of) if index == "rmse_deg" else f"{getattr(of, index):.3f}"

    lines = []
    for method in dict.fromkeys(score.method for score in scores):
        own = [cells[method, noise] for noise in noises]
        lines.append([own[0].label, *map(cell, own)])
    return aligned_table(lines, ["method", *(noise_label(*noise) for noise in noises)])


def _rmse(score: Score) -> str:
    low, high = score.rmse_ci95_deg
    error = f"{score.rmse_deg:.3f} ± {(high - low) / 2:.3f}"
    return f"**{error}**" if score.is_best else error


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
        width = np.mean([score.width95_deg or 0.0 for score in of])
        figures = [f"{width:.2f}", f"{mean_of(of, 'nees'):.2f}", "-" if np.isnan(nis) else f"{nis:.2f}"]
        shares = [_figure(coverage.get(noise), ".0f") for noise in noises]
        lines.append([method, *shares, *figures, f"{mean_of(of, 'crps_deg'):.3f}"])
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
    return {page_name(of): _page(scores, of) for of in dict.fromkeys(score.condition for score in scores)}


def _page(scores: Sequence[Score], condition: Condition) -> str:
    kind, level = condition
    variance = level if kind == RECORDED else noise_variance(kind, level)
    parts = [f"# {noise_label(*condition)}", f"Filters are given R = {variance:.3g} deg^2. {BOLD}"]
    times = sorted({score.sample_time_s for score in scores}, reverse=True)
    for group in groups_of(scores):
        for T in times:
            of = [score for score in chosen_scores(scores, T, group) if score.condition == condition]
            if of:
                parts += [f"## {setting(group, T)}", _condition_table(of)]
    return "\n\n".join(parts) + f"\n\n<!-- {MADE_BY} -->\n"


def _condition_table(scores: Sequence[Score]) -> str:
    lines = []
    for score in sorted(scores, key=lambda of: of.rmse_deg):
        spec = method_spec(score.method)
        line = [score.label, spec.knows if spec else "-", _rmse(score), _ends(score.to_best_ci95)]
        line += [f"{score.rmse_steady_deg:.3f}", percent(score.coverage95)]
        lines.append([*line, _figure(score.width95_deg, ".2f")])
    headers = ["method", "knows", "RMSE [deg]", "times the best", "after 5 s [deg]"]
    return aligned_table(lines, [*headers, "coverage [%]", "width [deg]"], left=2)


def scores_csv(scores: Sequence[Score]) -> str:
    """Return the scores as CSV, a line each; unknown values are empty."""
    return csv_text(list(map(_score_row, scores)))


def _score_row(score: Score) -> Row:
    """`times_best` is the paired interval to the best method."""

    def of(*names: str) -> Row:
        return {name: getattr(score, name) for name in names}

    def ends(low: str, high: str, interval: Sequence[float] | None) -> Row:
        return dict(zip((low, high), interval or (None, None), strict=True))

    return (
        of("method")
        | {"oracle": str(score.oracle).lower()}
        | of("noise", "level", "sample_time_s")
        | ends("stroke_low_mm", "stroke_high_mm", score.stroke_mm)
        | of("twin", "rmse_deg")
        | ends("rmse_low_deg", "rmse_high_deg", score.rmse_ci95_deg)
        | of("rmse_steady_deg")
        | ends("times_best_low", "times_best_high", score.to_best_ci95)
        | of("coverage95", "width95_deg", "crps_deg", "seeds", "trainings")
    )


def costs_csv(costs: Mapping[str, Cost]) -> str:
    """Return the costs as CSV, a line for each method; unknown values are empty."""
    return csv_text([{"method": method} | dataclasses.asdict(cost) for method, cost in costs.items()])


def csv_text(rows: Sequence[Row], digits: int = 4) -> str:
    """Return rows with the same keys as CSV, numbers with so many digits; unknown values are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows[0] if rows else [])
    for row in rows:
        writer.writerow(f"{cell:.{digits}g}" if isinstance(cell, float) else cell for cell in row.values())
    return text.getvalue()
