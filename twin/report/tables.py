"""Tables of scores in plain text and Markdown, among them the paper's Tables II and III; choice of rows."""

from collections.abc import Iterable, Sequence

import numpy as np
from tabulate import tabulate

from twin.errors import InputError
from twin.estimation.registry import method_spec, method_specs
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.paper import TABLES, PaperTable, noise_label, paper_value
from twin.evaluation.ranking import MethodRank, Ranking, competes
from twin.evaluation.score import Group, Score

FORMATS = {"plain": "simple", "markdown": "pipe"}
INDEX_LABELS = {
    "mae_deg": "MAE [deg]",
    "rmse_deg": "RMSE [deg]",
    "md_deg": "MD [deg]",
    "var_deg2": "Var [deg²]",
    "bias_deg": "bias [deg]",
}


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


def clear_best(scores: Iterable[Score]) -> str | None:
    """Return the label of the least RMSE where the paired 95 % intervals of all others exclude it.

    Args:
        scores: of one noise on one group of episodes. Oracles and ensembles do not compete.

    Returns:
        None where another is level with it, or no interval is known.
    """
    racing = sorted(
        (score for score in scores if competes(score.method, score.oracle)), key=lambda score: score.rmse_deg
    )
    if not racing or any(score.to_best_ci95 is None or score.to_best_ci95[0] <= 1 for score in racing[1:]):
        return None
    return racing[0].label


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
    """Return each method's RMSE over that of the limit, the nearest to it first.

    Ratios are geometric means over noises, then over sample times [s] and groups.
    """
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
    return f"{twin}, [{', '.join(f'{end:g}' for end in stroke)}] mm"


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


def paper_figure(published: float) -> str:
    """Return a published figure to three decimals; the paper prints four, and a last 5 is rounded up."""
    return f"{published + 1e-9:.3f}"


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

    Cells are as `0.700 (paper 0.635)`; the clear best of each line of RMSE is bold in Markdown. The sample
    time is the longest, if not given. Empty where no score belongs to the table.
    """
    table = next((table for table in TABLES if table.noise == noise), None)
    if table is None:
        raise InputError(f"no table of {noise!r} noise; valid: {', '.join(table.noise for table in TABLES)}")
    chosen = [score for score in protocol_scores(scores, sample_time_s) if score.noise == noise]
    cells = {(score.level, score.label): score for score in chosen}
    methods = ordered(score.label for score in chosen)
    lines = []
    for level in sorted({level for level, _ in cells} & set(table.values)):
        rows = [cells.get((level, method)) for method in methods]
        best = clear_best(score for score in rows if score is not None)
        for place, (index, label) in enumerate(INDEX_LABELS.items()):
            bold = best if index == "rmse_deg" and fmt == "markdown" else None
            name = "" if place else f"{table.symbol} = {level:g}"
            lines.append([name, label, *(_cell(score, index, bold) for score in rows)])
    return aligned_table(lines, ["noise", "index", *methods], left=2, fmt=fmt) if lines else ""


def _cell(score: Score | None, index: str, bold: str | None) -> str:
    if score is None:
        return "-"
    ours = f"{getattr(score, index):.3f}"
    if score.label == bold:
        ours = f"**{ours}**"
    published = published_value(score, index)
    return ours if published is None else f"{ours} (paper {paper_figure(published)})"


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
    lines = [
        [
            group_name(score.group),
            noise_label(*score.condition),
            score.label,
            *(f"{getattr(score, index):.3f}" for index in INDEX_LABELS),
        ]
        for score in scores
    ]
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
    lines = [
        [
            of.method,
            f"{of.rmse_deg:.3f}" + in_brackets(of.rmse_ci95_deg, ".3f"),
            "-" if of.rank is None else f"{of.rank}" + in_brackets(of.rank_ci95, "d"),
            "-" if of.to_best_ci95 is None else f"{of.to_best_ci95[0]:.2f} to {of.to_best_ci95[1]:.2f}",
        ]
        for of in by_error(ranking)
    ]
    return aligned_table(lines, ["method", "RMSE [deg]", "rank", "times the first"])
