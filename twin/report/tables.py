"""The paper's Tables II and III from the rows of `evaluation.json`, each figure beside the published one."""

from collections.abc import Iterable, Sequence
from html import escape

from tabulate import tabulate

from twin.errors import InputError
from twin.estimation.registry import method_specs
from twin.evaluation.paper import TABLES, PaperTable, noise_label, paper_value
from twin.evaluation.score import Group, Score
from twin.report.best import clear_best

FORMATS = {"plain": "simple", "markdown": "pipe", "html": "unsafehtml"}
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


def aligned_table(
    lines: Sequence[Sequence[str]], headers: Sequence[str], *, left: int = 1, fmt: str = "markdown"
) -> str:
    """Return a table whose first columns are words, to the left, and the others figures, to the right.

    Args:
        lines: cells, as they are to be read.
        headers: of the columns.
        left: how many columns are words.
        fmt: one of `FORMATS`.
    """
    align = ("left",) * left + ("right",) * (len(headers) - left)
    return str(tabulate(lines, headers, tablefmt=FORMATS[fmt], colalign=align, disable_numparse=True))


def twin_name(twin: str) -> str:
    """Return what a column of one kind of twin is called."""
    return "the preset" if twin == "nominal" else twin


def protocol_scores(scores: Sequence[Score], sample_time_s: float | None = None) -> list[Score]:
    """Return the scores of the paper's protocol: of the first stroke and twin, and of one sample time.

    The sample time is the one asked for, else the longest.
    """
    scores = [score for score in scores if score.group == scores[0].group]
    times = {score.sample_time_s for score in scores}
    if not times:
        return []
    wanted = max(times) if sample_time_s is None else sample_time_s
    return [score for score in scores if score.sample_time_s == wanted]


def paper_table(
    scores: Sequence[Score], noise: str, fmt: str = "plain", *, sample_time_s: float | None = None
) -> str:
    """Return Table II (`noise` = gaussian) or III (poisson): a line per level and index, a column per method.

    Args:
        scores: of an evaluation.
        noise: kind of the noise.
        fmt: one of `FORMATS`.
        sample_time_s: which sample time to report [s]; else the longest.

    Returns:
        The table, with cells such as `0.700 (paper 0.635)` and the clear best of each line of RMSE in
        bold where the format can; empty when no row belongs to it.

    Raises:
        ValueError: there is no table of this noise, or no such format.
    """
    table = _table_of(noise)
    if fmt not in FORMATS:
        raise InputError(f"unknown format {fmt!r}; valid: {', '.join(FORMATS)}")
    chosen = [score for score in protocol_scores(scores, sample_time_s) if score.noise == noise]
    cells = {(score.level, score.label): score for score in chosen}
    methods = ordered(score.label for score in chosen)
    lines = []
    for level in sorted({level for level, _ in cells} & set(table.values)):
        name = f"{table.symbol} = {level:g}"
        for index, label in INDEX_LABELS.items():
            group = {method: cells.get((level, method)) for method in methods}
            rows = [score for score in group.values() if score is not None]
            best = clear_best(rows) if index == "rmse_deg" else None
            values = [_cell(score, index, fmt, method == best) for method, score in group.items()]
            lines.append([name, label, *values])
            name = ""
    if not lines:
        return ""
    headers = ["noise", "index", *methods]
    if fmt == "html":
        headers = [escape(header) for header in headers]
    return aligned_table(lines, headers, left=2, fmt=fmt)


def paper_tables(scores: Sequence[Score], fmt: str = "plain", *, sample_time_s: float | None = None) -> str:
    """Return both tables under their titles; arguments as in `paper_table`."""
    parts = []
    for table in TABLES:
        body = paper_table(scores, table.noise, fmt, sample_time_s=sample_time_s)
        if body:
            title = table_title(table)
            heading = {"markdown": f"**{title}**", "html": f"<h3>{title}</h3>"}.get(fmt, title)
            parts.append(f"{heading}\n\n{body}")
    return "\n\n".join(parts)


def score_table(scores: Sequence[Score], fmt: str = "plain") -> str:
    """Return every score as a line of a table: group of records, noise, method and indices.

    Args:
        scores: of an evaluation.
        fmt: one of `FORMATS`.
    """
    lines = [
        [
            group_name(score.group),
            noise_label(*score.condition),
            score.label,
            *(f"{getattr(score, index):.3f}" for index in INDEX_LABELS),
        ]
        for score in scores
    ]
    headers = ["records", "noise", "method", *INDEX_LABELS.values()]
    return aligned_table(lines, headers, left=3, fmt=fmt)


def group_name(group: Group) -> str:
    """Return the name of records: the kind of twin and the stroke."""
    stroke, twin = group
    return f"{twin}, [{', '.join(f'{end:g}' for end in stroke)}] mm"


def table_title(table: PaperTable) -> str:
    """Return the heading of a table: its number in the paper, and the noise."""
    return f"Table {table.number}: {table.noise.capitalize()} noise that strict training never saw"


def _table_of(noise: str) -> PaperTable:
    for table in TABLES:
        if table.noise == noise:
            return table
    raise InputError(f"no table of {noise!r} noise; valid: {', '.join(table.noise for table in TABLES)}")


def _cell(score: Score | None, index: str, fmt: str, best: bool) -> str:
    if score is None:
        return "-"
    ours = f"{getattr(score, index):.3f}"
    if fmt == "html":
        ours = ours.replace("-", "&minus;")
    if best and fmt != "plain":
        ours = f"<strong>{ours}</strong>" if fmt == "html" else f"**{ours}**"
    published = paper_value(*score.condition, score.label, index)
    if published is None or score.paper_rmse_deg is None:  # that of another instrument is no peer
        return ours
    rounded = f"{published + 1e-9:.3f}"  # the paper prints four decimals: a last 5 is rounded up
    return f"{ours} <small>paper {rounded}</small>" if fmt == "html" else f"{ours} (paper {rounded})"
