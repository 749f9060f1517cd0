"""Tables of a comparison of controllers: all trials, against the others, and reference by reference."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.files.atomic import MADE_BY, write_whole

TABLE = "control.md"
"""File of all tables."""

Values = Mapping[str, Any]
Cells = dict[str, dict[str, str]]


def control_table(totals: Sequence[Values], fmt: str = "markdown") -> str:
    """Return the table of errors: one row a condition, one column a controller [deg]."""
    cells = _cells(totals, _condition, _error)
    first = next(iter(cells))
    ways = {of["controller"]: of["travel_mm"] for of in totals if of["condition"] == first}
    cells[f"way of the command, {first} [mm]"] = {name: f"{way:.1f}" for name, way in ways.items()}
    return _table("condition", cells, fmt)


def write_tables(folder: Path, values: Values) -> None:
    """Write all tables as Markdown."""
    totals, against = values["totals"], values["comparisons"]
    parts = [
        "RMSE of tracking [deg] of all trials, in brackets that of the worst twin.",
        control_table(totals),
        "The last 20 s: RMSE [deg], in brackets the largest error.",
        _table("condition", _cells(totals, _condition, _late)),
        "Way of the command, mean of a trial [mm].",
        _table("condition", _cells(totals, _condition, lambda of: f"{of['travel_mm']:.1f}")),
    ]
    if against:
        parts += [
            f"How much less error {against[0]['controller']} has (95 % interval, paired).",
            _table("condition", _cells(against, _condition, _less, column="rival")),
        ]
    parts += [
        "Each reference: mean RMSE of the twins [deg], in brackets the worst.",
        _table("reference", _cells(values["rows"], _reference, _error)),
        f"<!-- {MADE_BY} -->",
    ]
    write_whole(folder / TABLE, "\n\n".join(parts) + "\n")


def _condition(of: Values) -> str:
    return str(of["condition"])


def _reference(of: Values) -> str:
    low, high = of["stroke_mm"]
    return f"{of['condition']}: {of['signal']}, [{low:g}, {high:g}] mm"


def _error(of: Values) -> str:
    return f"{of['rmse_deg']:.2f} ({of['worst_twin_rmse_deg']:.2f})"


def _late(of: Values) -> str:
    return f"{of['late_rmse_deg']:.2f} ({of['late_worst_deg']:.1f})"


def _less(of: Values) -> str:
    low, high = of["reduction_ci95"]
    return f"{100 * of['reduction']:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def _cells(
    values: Sequence[Values],
    row: Callable[[Values], str],
    say: Callable[[Values], str],
    column: str = "controller",
) -> Cells:
    """Return texts by row and column, in the order in which both come."""
    cells: Cells = {}
    for of in values:
        cells.setdefault(row(of), {})[of[column]] = say(of)
    return cells


def _table(first: str, cells: Cells, fmt: str = "markdown") -> str:
    """Return a table of texts; a row is empty where it has none."""
    from tabulate import tabulate

    names = list(dict.fromkeys(name for row in cells.values() for name in row))
    rows = [[place, *(row.get(name, "") for name in names)] for place, row in cells.items()]
    kind = "pipe" if fmt == "markdown" else fmt
    return str(tabulate(rows, [first, *names], tablefmt=kind, disable_numparse=True))
