"""The page of an evaluation: methods in a ranked table, errors by noise next to the paper's, and tracking."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from twin.errors import InputError
from twin.estimation.registry import method_spec
from twin.evaluation.metrics import geometric_mean
from twin.evaluation.paper import TABLES, PaperTable, noise_label
from twin.evaluation.ranking import MethodRank, Ranking, competes, rankings_of
from twin.evaluation.results import load_tracks
from twin.evaluation.score import Score, mean_coverage, read_evaluation
from twin.files.origin import stated_origin
from twin.files.shown import cut
from twin.report import figures, tables
from twin.report import page as html

COLUMNS = {"rmse_deg": tables.INDEX_LABELS["rmse_deg"]} | tables.INDEX_LABELS
"""Indices of the paper's tables, RMSE first: a narrow screen shows the first columns first."""
MOST_NOISES = 6  # noises that the figure of the paper's suite has room for
RANKED = (
    "RMSE: geometric mean over noises, with its 95 % interval over noise seeds, records and trainings. Times "
    "the first: paired 95 % interval of the ratio; a method is worse than the first where it is above 1. "
    "Oracles saw the clean truth, and neither they nor ensembles compete."
)
EXPLAINED = (
    "An RMSE is bold where the paired 95 % intervals of all others are above it. In brackets: the paper's "
    "figures, of another endoscope. Scored against the clean truth, from the sample after the wrong initial "
    "estimate on. MD is the mean of |e - mean e|: the paper prints squares, but its figures are in degrees."
)


def evaluation_page(path: Path) -> html.Page:
    """Return the page of an `evaluation.json`, and of the tracks in its folder."""
    scores, contents = read_evaluation(path)
    origin, rankings = stated_origin(contents), rankings_of(contents)
    page = html.Page(
        "EndoTwin evaluation: how well is the bending angle estimated?", "Estimators under noise"
    )
    page.add("Results", *result_parts(scores, rankings))
    if groups := group_parts(scores, rankings):
        page.add("Every kind of record", *groups)
    page.add("Tracking", *_tracking(path.with_name("tracks.npz"), scores))
    page.add(
        "What was run",
        html.facts({"Protocol": html.flat_facts(contents["protocol"]), **html.origin_facts(origin)}),
    )
    repeat = html.origin_command(origin, str(path.parent)) or ("endotwin evaluate --help",)
    page.add_commands((*repeat, f"endotwin report {path.parent}"))
    return page


def _tracking(path: Path, scores: Sequence[Score]) -> Sequence[Markup]:
    if not path.is_file():
        return [html.gap(f"There is no {path.name} with these results.")]
    try:
        return tracking_parts(path, scores)
    except InputError as error:
        return [html.gap(f"{path.name} cannot be shown: {cut(error, 300)}.")]


def result_parts(scores: Sequence[Score], rankings: Sequence[Ranking] = ()) -> list[Markup]:
    """Return the ranked table, the errors under every noise as a figure, and the paper's tables."""
    if not scores:
        raise InputError("it has no rows")
    first = tables.protocol_scores(scores)
    parts = [ranked_table(first, rankings)]
    if len({score.condition for score in first}) > MOST_NOISES:
        caption = (
            f"RMSE of every method under every noise, {tables.group_name(first[0].group)}; the best on top."
        )
        parts.append(html.figure(figures.noise_figure(first), caption))
    else:
        caption = "RMSE against the clean truth, with the 95 % interval of its mean over noise seeds"
        if any(score.paper_rmse_deg is not None for score in scores):
            caption += "; hollow marks are the paper's, measured on another endoscope"
        parts.append(
            html.figure(
                figures.rmse_figure(scores), f"{caption}.", f"{caption}; the tables below hold the figures."
            )
        )
    published = [part for of in TABLES for part in _paper_tables(first, of)]
    if not published:
        return [*parts, _error_table(first)]
    return [*parts, *published, html.text(EXPLAINED, "note")]


def group_parts(scores: Sequence[Score], rankings: Sequence[Ranking] = ()) -> list[Markup]:
    """Return what the full suite adds: every group and sample time, and the distance to the limit."""
    parts: list[Markup] = []
    if ranked := figures.rankings_to_draw(rankings):
        caption = (
            "RMSE in units of that of the first, with paired 95 % intervals over records, draws of the noise "
            "and trainings."
        )
        parts.append(html.figure(figures.rank_figure(ranked), caption))
    groups = list(dict.fromkeys((score.group, score.sample_time_s) for score in scores))
    if len(groups) < 2 and not tables.has_limit(scores):
        return parts
    if tables.has_limit(scores):
        caption = "RMSE of each method over that of the limit, geometric mean over noises; the best on top."
        parts.append(html.figure(figures.limit_figure(scores), caption))
    if tables.interval_scores(first := tables.protocol_scores(scores)):
        caption = (
            "Stated 95 % intervals: share of samples that hold the truth under each noise, and continuous "
            "ranked probability score; the best on top."
        )
        parts.append(html.figure(figures.interval_figure(first), caption))
    for group, T in groups:
        own = tables.chosen_scores(scores, T, group)
        name = f"{tables.group_name(group)}, T = {T:g} s"
        parts.append(html.folded(name, ranked_table(own, rankings), _error_table(own)))
    return parts


def tracking_parts(path: Path, scores: Sequence[Score]) -> list[Markup]:
    """Return the paper's Figs. 5 to 10 from a file of tracks, with the scores of the comparison."""
    drawn = figures.paper_figures(load_tracks(path), scores)
    if not drawn:
        raise InputError("it has none of the noises and methods of the paper's figures")
    return [html.figure(*of) for of in drawn.values()]


def ranked_table(scores: Sequence[Score], rankings: Sequence[Ranking] = ()) -> Markup:
    """Return the methods on one group of episodes as a table, the least error first."""
    place = scores[0].sample_time_s, *scores[0].group
    ranking = next((of for of in rankings if (of.sample_time_s, of.stroke_mm, of.twin) == place), None)
    by_label: dict[str, list[Score]] = {}
    for score in scores:
        by_label.setdefault(score.label, []).append(score)
    rows = []
    for of in tables.by_error(ranking) if ranking else _ranked(by_label):
        own = by_label.get(of.method, [])
        spec = method_spec(own[0].method if own else of.method)
        coverage = mean_coverage(own)
        method = html.Cell(of.method, (spec.knows,) if spec else ())
        rank = html.Cell("-" if of.rank is None else f"{of.rank}", _interval(of.rank_ci95, "d"))
        error = html.Cell(f"{of.rmse_deg:.3f}", _interval(of.rmse_ci95_deg, ".3f"))
        ratio = "-" if of.to_best_ci95 is None else "{:.2f} to {:.2f}".format(*of.to_best_ci95)
        share = "-" if coverage is None else f"{100 * coverage:.0f}"
        rows.append((method, rank, error, ratio, share, f"{own[0].trainings}" if own else "-"))
    head = ("method, and what it knows", "rank", "RMSE [deg]", "times the first", "coverage [%]")
    title = f"Methods, {tables.group_name(scores[0].group)}" if scores[0].stroke_mm else "Methods"
    return html.table((*head, "trainings"), rows, title=title, note=RANKED, cards=True, numbers=True)


def _interval(interval: tuple[float, float] | None, form: str) -> tuple[str, ...]:
    return () if interval is None else (f"{interval[0]:{form}} to {interval[1]:{form}}",)


def _ranked(by_label: dict[str, list[Score]]) -> list[MethodRank]:
    most = max(len(own) for own in by_label.values())
    means = {
        label: float(geometric_mean(np.array([score.rmse_deg for score in own])))
        for label, own in by_label.items()
        if len(own) == most
    }
    places, ranked = itertools.count(1), []
    for label in sorted(means, key=lambda name: means[name]):
        racing = competes(by_label[label][0].method, by_label[label][0].oracle)
        ranked.append(MethodRank(label, means[label], None, next(places) if racing else None, None, None))
    return ranked


def _paper_tables(scores: Sequence[Score], of: PaperTable) -> list[Markup]:
    parts = []
    for level in sorted({score.level for score in scores if score.noise == of.noise} & set(of.values)):
        rows = {score.label: score for score in scores if score.condition == (of.noise, level)}
        best = tables.clear_best(rows.values())
        cells = []
        for name in tables.ordered(rows):
            line = [_paper_cell(rows[name], index, name == best and index == "rmse_deg") for index in COLUMNS]
            cells.append((name, *line))
        title = f"{tables.table_title(of)}, {of.symbol} = {level:g}"
        parts.append(html.table(("method", *COLUMNS.values()), cells, title=title, numbers=True))
    return parts


def _paper_cell(score: Score, index: str, best: bool) -> html.Cell:
    ours = f"{getattr(score, index):.3f}".replace("-", "\N{MINUS SIGN}")
    published = tables.published_value(score, index)
    return html.Cell(
        ours, () if published is None else (f"({tables.paper_figure(published)})",), "best" if best else ""
    )


def _error_table(scores: Sequence[Score]) -> Markup:
    noises = list(dict.fromkeys(score.condition for score in scores))
    cells = {(score.label, score.condition): f"{score.rmse_deg:.3f}" for score in scores}
    best = {
        noise: tables.clear_best(score for score in scores if score.condition == noise) for noise in noises
    }
    rows = []
    for name in tables.ordered(score.label for score in scores):
        styles = {noise: "best" if best[noise] == name else "" for noise in noises}
        rows.append((name, *(html.Cell(cells.get((name, of), "-"), (), styles[of]) for of in noises)))
    head = ("method", *(noise_label(*noise) for noise in noises))
    title = f"RMSE [deg], {tables.group_name(scores[0].group)}" if scores[0].stroke_mm else "RMSE [deg]"
    return html.table(head, rows, title=title, cards=len(noises) > 4, numbers=True)
