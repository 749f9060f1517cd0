"""Parts of a page about an evaluation: errors by method and noise, beside the paper's, and tracking."""

from collections.abc import Sequence
from pathlib import Path

from twin.errors import InputError
from twin.evaluation.paper import TABLES, PaperTable, noise_label, paper_value
from twin.evaluation.ranking import Ranking
from twin.evaluation.score import Group, Score, read_scores
from twin.evaluation.track import load_tracks
from twin.report.best import clear_best
from twin.report.figures import rmse_figure
from twin.report.findings import all_findings
from twin.report.intervals import interval_figure, interval_scores
from twin.report.limit import limit_figure, noise_figure, times_the_limit
from twin.report.narrow import narrow_rmse_figure
from twin.report.paper_figures import paper_figures
from twin.report.parts import Cell, Folded, Lines, Part, Picture, Table, Text, drawn
from twin.report.ranks import rank_figure, rankings_to_draw
from twin.report.tables import INDEX_LABELS, group_name, ordered, protocol_scores, table_title

COLUMNS = {"rmse_deg": INDEX_LABELS["rmse_deg"]} | INDEX_LABELS
"""Indices of a table, RMSE first: a narrow screen shows the first columns first."""
EXPLAINED = (
    "An RMSE is bold where it is the best beyond doubt: the paired 95 % intervals of all others are above "
    "it. Figures in brackets are the paper's, of another endoscope. Every method is scored against the clean "
    "truth, from the sample after the wrong initial estimate on. MD is the mean of |e - mean e|: the paper "
    "prints squares, but its figures are in degrees. An oracle saw the clean truth and cannot be deployed."
)


def result_parts(scores: Sequence[Score]) -> tuple[Part, ...]:
    """Return the errors of an evaluation: a figure, the paper's tables, and every noise in words."""
    if not scores:
        raise InputError("it has no rows")
    caption, told = _rmse_caption(scores)
    parts: list[Part] = [drawn(rmse_figure(scores), caption, told, narrow_rmse_figure(scores))]
    tables = [part for table in TABLES for part in _paper_parts(scores, table)]
    parts += tables
    if tables:
        parts.append(Text(EXPLAINED, "note"))
    else:
        parts.append(_error_table(protocol_scores(scores)))
    for found in all_findings(scores):
        lines: tuple[Part, ...] = (Text(found.headline), Lines(tuple(found.lines)))
        notes = (Text(found.note, "note"),) if found.note else ()
        parts.append(Folded(f"{found.name}, noise by noise", (*lines, *notes)))
    return tuple(parts)


def group_parts(scores: Sequence[Score], rankings: Sequence[Ranking] = ()) -> tuple[Part, ...]:
    """Return what the full suite adds: every kind of record and sample time, and how far the limit is."""
    parts: list[Part] = []
    if ranked := rankings_to_draw(rankings):
        caption = (
            "Who is better than whom, and how surely: errors in units of the first method's, with paired "
            "95 % intervals over records, draws of the noise and trainings."
        )
        parts.append(drawn(rank_figure(ranked), caption))
    groups = list(dict.fromkeys((score.group, score.sample_time_s) for score in scores))
    if len(groups) < 2 and not any(times_the_limit(scores, T, group) for group, T in groups):
        return tuple(parts)
    first = protocol_scores(scores)
    caption = f"RMSE of every method under every noise, {group_name(first[0].group)}; the best on top."
    parts.append(drawn(noise_figure(first), caption))
    if any(times_the_limit(scores, T, group) for group, T in groups):
        caption = "How many times the limit each method has: geometric means over noises, the best on top."
        parts.append(drawn(limit_figure(scores), caption))
    if interval_scores(first):
        caption = (
            "How honest and how sharp stated 95 % intervals are: share of samples that hold the truth under "
            "each noise, and the continuous ranked probability score; the best on top."
        )
        parts.append(drawn(interval_figure(first), caption))
    parts += [
        Folded(
            f"{group_name(group)}, T = {T:g} s",
            (_error_table([row for row in scores if (row.group, row.sample_time_s) == (group, T)]),),
        )
        for group, T in groups
    ]
    return tuple(parts)


def tracking_parts(path: Path) -> tuple[Picture, ...]:
    """Return the paper's Figs. 5 to 10 from a file of tracks, and the scores beside it.

    Raises:
        ValueError: the file is damaged, or holds none of their noises and methods.
    """
    evaluation = path.with_name("evaluation.json")
    scores = read_scores(evaluation)[0] if evaluation.is_file() else []
    tracks = load_tracks(path)
    on_narrow = paper_figures(tracks, scores, narrow=True)
    shown = tuple(
        drawn(figure, caption, narrow=on_narrow[number][0])
        for number, (figure, caption) in paper_figures(tracks, scores).items()
    )
    if not shown:
        raise InputError("it has none of the noises and methods of the paper's figures")
    return shown


def _rmse_caption(scores: Sequence[Score]) -> tuple[str, str]:
    """Return the caption of the figure of errors, and what it shows in words."""
    caption = "RMSE against the clean truth, with the 95 % interval of its mean over noise seeds"
    if any(score.paper_rmse_deg is not None for score in scores):
        caption += "; hollow marks are the paper's, measured on another endoscope"
    lines = (f"{score.label} {score.rmse_deg:.2f}" for score in protocol_scores(scores)[:12])
    return f"{caption}.", f"{caption}. In degrees: {', '.join(lines)} and so on, as in the tables below."


def _paper_parts(scores: Sequence[Score], table: PaperTable) -> list[Table]:
    """Return a table for each level of a noise: a row for each method, a column for each index."""
    chosen = [score for score in protocol_scores(scores) if score.noise == table.noise]
    parts = []
    for level in sorted({score.level for score in chosen} & set(table.values)):
        rows = {score.label: score for score in chosen if score.level == level}
        best = {"rmse_deg": clear_best(rows.values())}
        title = f"{table_title(table)}, {table.symbol} = {level:g}"
        cells: list[tuple[str | Cell, ...]] = []
        for name in ordered(rows):
            cells.append((name, *(_paper_cell(rows[name], index, best.get(index)) for index in COLUMNS)))
        parts.append(Table(("method", *COLUMNS.values()), tuple(cells), title, style="numbers"))
    return parts


def _paper_cell(score: Score, index: str, best: str | None) -> Cell:
    ours = f"{getattr(score, index):.3f}".replace("-", "\N{MINUS SIGN}")
    published = paper_value(*score.condition, score.label, index)
    known = published is not None and score.paper_rmse_deg is not None
    small = (f"({published + 1e-9:.3f})",) if published is not None and known else ()
    return Cell(ours, small, "best" if score.label == best else "")


def _error_table(scores: Sequence[Score]) -> Table:
    """Return the RMSE of every method under every noise."""
    noises = list(dict.fromkeys(score.condition for score in scores))
    cells = {(score.label, score.condition): score for score in scores}
    best = {noise: clear_best(s for s in scores if s.condition == noise) for noise in noises}
    rows = tuple(
        (
            name,
            *(
                Cell(f"{cells[name, noise].rmse_deg:.3f}", (), "best" if best[noise] == name else "")
                if (name, noise) in cells
                else "-"
                for noise in noises
            ),
        )
        for name in ordered(score.label for score in scores)
    )
    head = ("method", *(noise_label(*noise) for noise in noises))
    group: Group = scores[0].group
    title = f"RMSE [deg], {group_name(group)}" if group[0] else "RMSE [deg]"
    return Table(head, rows, title, cards=len(noises) > 4, style="numbers")
