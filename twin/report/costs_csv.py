"""The costs of methods as a CSV table, beside that of their scores."""

import csv
import dataclasses
import io
from collections.abc import Mapping

from twin.evaluation.costs import Cost

COLUMNS = ("method", *(field.name for field in dataclasses.fields(Cost)))


def costs_csv(costs: Mapping[str, Cost]) -> str:
    """Return the costs, a line for each method; what is not known is left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for method, cost in costs.items():
        values = map(_short, dataclasses.astuple(cost))
        writer.writerow([method, *values])
    return text.getvalue()


def _short(value: object) -> object:
    return f"{value:.4g}" if isinstance(value, float) else value
