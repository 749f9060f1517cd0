"""The page of an evaluation: the best method, errors by noise next to the paper's, and tracking."""

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from twin.errors import InputError
from twin.estimation.registry import method_spec
from twin.evaluation.paper import TABLES, PaperTable, noise_label
from twin.evaluation.ranking import Ranking, rankings_of
from twin.evaluation.results import load_tracks
from twin.evaluation.score import Score, mean_coverage, read_evaluation
from twin.files.origin import stated_origin
from twin.report import figures, tables
from twin.report import page as html

COLUMNS = {"rmse_deg": tables.INDEX_LABELS["rmse_deg"]} | tables.INDEX_LABELS
"""Indices of the paper's tables, RMSE first: a narrow screen shows the first columns first."""
RANKED = (
    "RMSE: geometric mean over noises, with its 95 % interval over noise seeds, records and trainings. Times "
    "the first: paired 95 % interval of the ratio; a method is worse than the first where it is above 1. "
    "Oracles, which saw the clean truth, and methods that know the density of the noise do not compete."
)
EXPLAINED = (
    "Bold as above. In brackets: the paper's figures, of another endoscope. Scored against the clean truth, "
    "from the sample after the wrong initial estimate on. MD is the mean of |e - mean e|: the paper prints "
    "squares, but its figures are in degrees."
)


def evaluation_page(path: Path) -> html.Page:
    """Return the page of an `evaluation.json`, and of the tracks in its folder."""
    scores, contents = read_evaluation(path)
    origin, rankings = stated_origin(contents), rankings_of(contents)
    page = html.Page(
        "EndoTwin evaluation: how well is the bending angle estimated?",
        "Estimators under noise",
        intro=(answer(scores), error_table(tables.front_scores(scores))),
    )
    page.add("Errors under every noise", *result_parts(scores, rankings))
    if groups := group_parts(scores, rankings):
        page.add("Every kind of record", *groups)
    tracks = path.with_name("tracks.npz")
    page.add("Tracking", *html.of_file(tracks, lambda of: tracking_parts(of, scores)))
    stated = {"Protocol": html.flat_facts(contents["protocol"]), **html.origin_facts(origin)}
    repeat = html.origin_command(origin, str(path.parent)) or ("endotwin evaluate --help",)
    page.add_origin((*repeat, f"endotwin report {path.parent}"), stated)
    return page


def answer(scores: Sequence[Score]) -> Markup:
    """Return the best method that can be deployed, and the next, in a sentence."""
    if not scores:
        raise InputError("it has no rows")
    front = [score for score in tables.front_noises(scores) if tables.is_deployable(score)]
    if not front:
        return html.text("No method that can be deployed was compared.", "headline")
    noises = len({score.condition for score in front})
    over = f"geometric mean over {noises} noises" if noises > 1 else noise_label(*front[0].condition)
    errors = tables.mean_errors(front)
    best, *others = tables.best_two(front)
    error = errors[best]
    if not others:
        return html.text(f"{best} has an RMSE of {error:.2f} deg ({over}).", "headline")
    (second,) = others
    larger = errors[second]
    sentence = (
        f"{best} has the least error of the methods that can be deployed: {error:.2f} deg, "
        f"where the next, {second}, has {larger:.2f} (RMSE, {over})."
    )
    return html.text(sentence, "headline")


def error_table(scores: Sequence[Score]) -> Markup:
    """Return the RMSE on one group of episodes under every noise; oracles and yardsticks are last."""
    noises = list(dict.fromkeys(score.condition for score in scores))
    by_label = {score.label: score for score in scores}
    cells = {
        (of.label, of.condition): html.Cell(f"{of.rmse_deg:.2f}", style="best" if of.is_best else "")
        for of in scores
    }
    competing, others = [], []
    for label in tables.mean_errors(scores):
        row = [cells.get((label, noise), "-") for noise in noises]
        if tables.is_deployable(by_label[label]):
            competing.append((html.Cell(label), *row))
        else:
            kind = "sees the true angle" if by_label[label].oracle else "a yardstick"
            others.append((html.Cell(label, (kind,)), *row))
    setting = tables.setting(scores[0].group, scores[0].sample_time_s, scores[0].seeds)
    note = f"RMSE [deg] on {setting}; R in deg². {tables.BOLD}"
    heads = (noise_label(*noise).replace(",", "").replace(" deg²", "") for noise in noises)
    unbroken = (head.replace(" = ", "\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}") for head in heads)
    return html.table(("method", *unbroken), competing + others, note=note, numbers=True)


def result_parts(scores: Sequence[Score], rankings: Sequence[Ranking]) -> list[Markup]:
    """Return the errors under every noise as a figure and, folded, all methods and the paper's tables."""
    first = tables.protocol_scores(scores)
    caption = (
        "RMSE against the true angle, with the 95 % interval of its mean over noise seeds; the least mean "
        "error on top."
    )
    narrow = figures.noise_figure(tables.front_scores(scores), figures.COLUMN)
    parts = [
        html.figure(
            figures.noise_figure(first), caption, f"{caption} Tables below hold the figures.", narrow
        ),
        html.folded(
            "All methods, ranked, and what they know", *ranked_table(first, rankings), error_table(first)
        ),
    ]
    published = [part for of in TABLES for part in _paper_tables(first, of)]
    more = html.folded("The paper's Tables II and III", *published, html.text(EXPLAINED, "note"))
    return [*parts, more] if published else parts


def group_parts(scores: Sequence[Score], rankings: Sequence[Ranking]) -> list[Markup]:
    """Return what the full suite adds: every group and sample time, and the distance to the limit."""
    parts: list[Markup] = []
    if ranked := figures.rankings_to_draw(rankings):
        caption = (
            "RMSE in units of that of the first, with paired 95 % intervals over records, draws of the noise "
            "and trainings."
        )
        narrow = figures.rank_figure(ranked, figures.COLUMN)
        parts.append(html.figure(figures.rank_figure(ranked), caption, narrow=narrow))
    groups = list(dict.fromkeys((score.group, score.sample_time_s) for score in scores))
    if len(groups) < 2 and not tables.has_limit(scores):
        return parts
    if tables.has_limit(scores):
        caption = "RMSE of each method over that of the limit, geometric mean over noises; the best on top."
        narrow = figures.limit_figure(scores, figures.COLUMN)
        parts.append(html.figure(figures.limit_figure(scores), caption, narrow=narrow))
    if tables.interval_scores(first := tables.protocol_scores(scores)):
        caption = (
            "Stated 95 % intervals: share of samples that hold the truth under each noise, and continuous "
            "ranked probability score; the best on top."
        )
        narrow = figures.interval_figure(first, figures.COLUMN)
        parts.append(html.figure(figures.interval_figure(first), caption, narrow=narrow))
    for group, T in groups:
        own = tables.chosen_scores(scores, T, group)
        parts.append(html.folded(tables.setting(group, T), *ranked_table(own, rankings), error_table(own)))
    return parts


def tracking_parts(path: Path, scores: Sequence[Score]) -> list[Markup]:
    """Return the paper's Figs. 5 to 10 from a file of tracks, with the scores of the comparison."""
    tracks = load_tracks(path)
    drawn, narrow = (figures.paper_figures(tracks, scores, of) for of in (figures.PAGE, figures.COLUMN))
    if not drawn:
        raise InputError("it has none of the noises and methods of the paper's figures")
    return [html.figure(*of, narrow=narrow[number][0]) for number, of in drawn.items()]


def ranked_table(scores: Sequence[Score], rankings: Sequence[Ranking]) -> list[Markup]:
    """Return the methods on one group of episodes as a table, the least error first; none without ranks."""
    place = scores[0].sample_time_s, *scores[0].group
    ranking = next((of for of in rankings if (of.sample_time_s, of.stroke_mm, of.twin) == place), None)
    if ranking is None:
        return []
    by_label: dict[str, list[Score]] = {}
    for score in scores:
        by_label.setdefault(score.label, []).append(score)
    rows = []
    for of in tables.by_error(ranking):
        own = by_label.get(of.method, [])
        spec = method_spec(own[0].method if own else of.method)
        coverage = mean_coverage(own)
        method = html.Cell(of.method, (spec.knows,) if spec else ())
        rank = html.Cell("-" if of.rank is None else f"{of.rank}", _interval(of.rank_ci95, "d"))
        error = html.Cell(f"{of.rmse_deg:.3f}", _interval(of.rmse_ci95_deg, ".3f"))
        ratio = "-" if of.to_best_ci95 is None else "{:.2f} to {:.2f}".format(*of.to_best_ci95)
        share = "-" if coverage is None else f"{100 * coverage:.0f}"
        rows.append((method, rank, error, ratio, share, f"{own[0].trainings}" if own else "-"))
    head = ("method, and what it knows", "rank", "RMSE [deg]", "times the first", "coverage [%]", "trainings")
    return [html.table(head, rows, title="Methods", note=RANKED, cards=True, numbers=True)]


def _interval(interval: tuple[float, float] | None, form: str) -> tuple[str, ...]:
    return () if interval is None else (f"{interval[0]:{form}} to {interval[1]:{form}}",)


def _paper_tables(scores: Sequence[Score], of: PaperTable) -> list[Markup]:
    parts = []
    for level in sorted({score.level for score in scores if score.noise == of.noise} & set(of.values)):
        rows = {score.label: score for score in scores if score.condition == (of.noise, level)}
        cells = [(name, *(_paper_cell(rows[name], of) for of in COLUMNS)) for name in tables.ordered(rows)]
        title = f"{tables.table_title(of)}, {of.symbol} = {level:g}"
        parts.append(html.table(("method", *COLUMNS.values()), cells, title=title, numbers=True))
    return parts


def _paper_cell(score: Score, index: str) -> html.Cell:
    ours = f"{getattr(score, index):.3f}".replace("-", "\N{MINUS SIGN}")
    published = tables.published_value(score, index)
    small = () if published is None else (f"({tables.paper_figure(published)})",)
    return html.Cell(ours, small, "best" if score.is_best and index == "rmse_deg" else "")
