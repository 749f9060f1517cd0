"""The spread between trainings of one method, as a table."""

import dataclasses

import numpy as np
import pytest
from scores import SCORE

from twin.report.trainings import training_table

ROW = dataclasses.replace(SCORE, twin="nominal", method="GRU", training_rmse_deg=(0.5, 2.0, 1.0))


def test_figures_are_geometric_means_over_noises_of_each_training():
    rows = [ROW, dataclasses.replace(ROW, noise="poisson", training_rmse_deg=(2.0, 2.0, 4.0))]
    each = np.array([1.0, 2.0, 2.0])  # roots of 0.5 x 2, 2 x 2, 1 x 4
    last = training_table(rows).splitlines()[-1]
    assert "nominal, [-1, 1] mm" in last
    found = last.split("0.1 s")[1].replace("%", "").split()
    mean = each.mean()
    expected = [3, mean, each.std(ddof=1), each.min(), each.max(), 100 * (each.max() / mean - 1)]
    assert [float(figure) for figure in found] == pytest.approx(expected, abs=0.06)


def test_each_kind_of_records_and_sample_time_is_a_line_of_its_own():
    rows = [ROW, dataclasses.replace(ROW, twin="bending"), dataclasses.replace(ROW, sample_time_s=0.02)]
    table = training_table([*rows, dataclasses.replace(ROW, method="RAM")], "markdown")
    lines = table.splitlines()[2:]
    assert [line.split("|")[1].strip() for line in lines] == ["GRU", "GRU", "GRU", "RAM"]


def test_where_no_method_has_several_trainings_there_is_no_table():
    assert training_table([dataclasses.replace(ROW, training_rmse_deg=())]) == ""
