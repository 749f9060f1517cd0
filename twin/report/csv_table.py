"""Tables as CSV, for those who compare by other tools."""

import csv
import io
from collections.abc import Iterable, Sequence


def csv_table(columns: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Return rows under the names of their columns, numbers to four digits; None is left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(map(_short, row) for row in rows)
    return text.getvalue()


def _short(value: object) -> object:
    return f"{value:.4g}" if isinstance(value, float) else value
