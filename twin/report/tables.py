"""The paper's Tables II and III from the rows of `evaluation.json`, each figure beside the published one."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from tabulate import tabulate

from twin.evaluation.paper import TABLES, PaperTable, paper_value

FORMATS = {"plain": "simple", "markdown": "pipe", "html": "unsafehtml"}
INDEX_LABELS = {
    "mae_deg": "MAE [deg]",
    "rmse_deg": "RMSE [deg]",
    "md_deg": "MD [deg]",
    "var_deg2": "Var [deg²]",
    "bias_deg": "bias [deg]",
}
_ORDER = ("C-H", "AM", "AM-tuned", "LSTM", "Direct RL", "RAM")

Row = dict[str, Any]


def method_name(row: Row) -> str:
    """Return the method of a row; one that saw the clean truth is labelled as an oracle."""
    name = str(row["method"])
    return f"{name} (oracle)" if row.get("oracle") and "oracle" not in name.lower() else name


def ordered(methods: Iterable[str]) -> list[str]:
    """Return method names once each, in the paper's order; what the paper has not follows, as it came."""
    unique = list(dict.fromkeys(methods))
    return sorted(unique, key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))


def place(row: Row) -> tuple[tuple[float, ...], str]:
    """Return the stroke [mm] and the kind of twin of a row."""
    return tuple(map(float, row.get("stroke_mm") or ())), str(row.get("twin", ""))


def protocol_rows(rows: Sequence[Row], sample_time_s: float | None = None) -> list[Row]:
    """Return the rows of the paper's protocol: of the first stroke and twin, and of one sample time.

    The sample time is the one asked for, else the longest.
    """
    rows = [row for row in rows if place(row) == place(rows[0])]
    times = {float(row["sample_time_s"]) for row in rows}
    if not times:
        return []
    wanted = max(times) if sample_time_s is None else sample_time_s
    return [row for row in rows if float(row["sample_time_s"]) == wanted]


def paper_table(
    rows: Sequence[Row], noise: str, fmt: str = "plain", *, sample_time_s: float | None = None
) -> str:
    """Return Table II (`noise` = gaussian) or III (poisson): a line per level and index, a column per method.

    Args:
        rows: of `evaluation.json`.
        noise: kind of the noise.
        fmt: one of `FORMATS`.
        sample_time_s: which sample time to report [s]; else the longest.

    Returns:
        The table, with cells such as `0.700 (paper 0.635)` and the best of each line in bold where the format
        can; empty when no row belongs to it.

    Raises:
        ValueError: there is no table of this noise, or no such format.
    """
    table = _table_of(noise)
    if fmt not in FORMATS:
        raise ValueError(f"unknown format {fmt!r}; valid: {', '.join(FORMATS)}")
    chosen = [row for row in protocol_rows(rows, sample_time_s) if row["noise"] == noise]
    cells = {(float(row["level"]), method_name(row)): row for row in chosen}
    methods = ordered(method_name(row) for row in chosen)
    lines = []
    for level in sorted({level for level, _ in cells} & set(table.values)):
        name = f"{table.symbol} = {level:g}"
        for index, label in INDEX_LABELS.items():
            group = {method: cells.get((level, method), {}) for method in methods}
            best = _best(group, index)
            values = [_cell(row, method, index, fmt, method == best) for method, row in group.items()]
            lines.append([name, label, *values])
            name = ""
    if not lines:
        return ""
    headers = ["noise", "index", *methods]
    if fmt == "html":
        headers = [escape(header) for header in headers]
    align = ("left", "left", *["right"] * len(methods))
    return str(tabulate(lines, headers, tablefmt=FORMATS[fmt], colalign=align, disable_numparse=True))


def paper_tables(rows: Sequence[Row], fmt: str = "plain", *, sample_time_s: float | None = None) -> str:
    """Return both tables under their titles; arguments as in `paper_table`."""
    parts = []
    for table in TABLES:
        body = paper_table(rows, table.noise, fmt, sample_time_s=sample_time_s)
        if body:
            title = table_title(table)
            heading = {"markdown": f"**{title}**", "html": f"<h3>{title}</h3>"}.get(fmt, title)
            parts.append(f"{heading}\n\n{body}")
    return "\n\n".join(parts)


def table_title(table: PaperTable) -> str:
    """Return the heading of a table: its number in the paper, and the noise."""
    return f"Table {table.number}: {table.noise.capitalize()} noise that training never saw"


def _table_of(noise: str) -> PaperTable:
    for table in TABLES:
        if table.noise == noise:
            return table
    raise ValueError(f"no table of {noise!r} noise; valid: {', '.join(table.noise for table in TABLES)}")


def _best(group: dict[str, Row], index: str) -> str | None:
    """The method with the smallest figure; an oracle, which nobody can deploy, does not compete."""
    figures = {name: abs(row[index]) for name, row in group.items() if index in row and not row.get("oracle")}
    return min(figures, key=lambda name: figures[name]) if figures else None


def _cell(row: Row, method: str, index: str, fmt: str, best: bool) -> str:
    if row.get(index) is None:
        return "-"
    ours = f"{row[index]:.3f}"
    if fmt == "html":
        ours = ours.replace("-", "&minus;")
    if best and fmt != "plain":
        ours = f"<strong>{ours}</strong>" if fmt == "html" else f"**{ours}**"
    published = paper_value(row["noise"], float(row["level"]), method, index)
    if published is None:
        return ours
    rounded = f"{published + 1e-9:.3f}"  # the paper prints four decimals: a last 5 is rounded up
    return f"{ours} <small>paper {rounded}</small>" if fmt == "html" else f"{ours} (paper {rounded})"
