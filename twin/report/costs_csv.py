"""The costs of methods as a CSV table, beside that of their scores."""

import dataclasses
from collections.abc import Mapping

from twin.evaluation.costs import Cost
from twin.report.csv_table import csv_table

COLUMNS = ("method", *(field.name for field in dataclasses.fields(Cost)))


def costs_csv(costs: Mapping[str, Cost]) -> str:
    """Return the costs, a line for each method; what is not known is left empty."""
    rows = ((method, *dataclasses.astuple(cost)) for method, cost in costs.items())
    return csv_table(COLUMNS, rows)
