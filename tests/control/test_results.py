"""Results: rows, totals, how much less error ours has, and tables."""

import numpy as np
import pytest

from twin.control.conditions import CONDITIONS
from twin.control.results import (
    MEASURES,
    ControlResult,
    comparisons,
    control_table,
    measures_of,
    with_percentages,
)
from twin.control.trial import ControlTrial

STROKES = ((-1.0, 1.0), (2.0, 4.0))


def result(name, errors, condition=CONDITIONS[0]):
    """A controller with errors (strokes, twins, signals)."""
    measures = {measure: np.full(np.shape(errors), -1.0) for measure in MEASURES}
    return ControlResult(name, condition, STROKES, measures | {"rmse_deg": np.asarray(errors, float)}, {})


def errors(seed, scale):
    return scale * np.random.default_rng(seed).uniform(0.5, 1.5, (2, 6, 3))


def test_a_row_for_each_signal_and_stroke_is_of_its_own_trials():
    values = errors(0, 1.0)
    rows = result("ours", values).rows()
    assert [(row["signal"], row["stroke_mm"]) for row in rows[:4]] == [
        ("sine", [-1.0, 1.0]),
        ("multi-sine", [-1.0, 1.0]),
        ("random-steps", [-1.0, 1.0]),
        ("sine", [2.0, 4.0]),
    ]
    assert rows[4]["rmse_deg"] == pytest.approx(values[1, :, 1].mean())
    assert rows[4]["worst_twin_rmse_deg"] == values[1, :, 1].max()
    assert rows[4]["estimate_rmse_deg"] is None  # nothing was estimated
    assert rows[4]["holding_reversals_per_s"] is None  # the reference was never held


def test_a_reduction_is_paired_by_twin_and_as_unsure_as_few_twins_make_it():
    """What twins have in common widens no interval; equal controllers differ in few of 20 cases."""
    theirs = errors(1, 1.0) * np.linspace(1, 20, 6)[:, None]
    (half,) = comparisons([result("ours", 0.5 * theirs), result("theirs", theirs)], "ours")
    assert half["reduction"] == pytest.approx(0.5)
    assert half["reduction_ci95"] == pytest.approx([0.5, 0.5])
    rng, trials, apart = np.random.default_rng(5), 200, 0
    for _ in range(trials):
        of_twin = np.exp(0.4 * rng.standard_normal((2, 1, 6, 1)))
        one, other = of_twin * np.exp(0.2 * rng.standard_normal((2, 2, 6, 3)))
        (found,) = comparisons([result("ours", one), result("theirs", other)], "ours")
        low, high = found["reduction_ci95"]
        apart += not low <= 0 <= high
    assert apart <= 0.05 * trials + 2 * np.sqrt(0.05 * 0.95 * trials)


def test_an_oracle_is_no_rival():
    given = [result(name, errors(0, 1.0)) for name in ("ours", "theirs", "oracle")]
    assert [of["rival"] for of in comparisons(given, "ours")] == ["theirs"]
    assert [of.total()["oracle"] for of in given] == [False, False, True]


def test_errors_are_a_percentage_of_the_uncompensated_one_of_the_same_trials():
    given = [result("linear", errors(0, 8.0)), result("pid", errors(1, 1.0))]
    totals = with_percentages([of.total() for of in given])
    assert totals[0]["percent_of_uncompensated"] == 100.0
    assert totals[1]["percent_of_uncompensated"] == pytest.approx(100 * given[1].rmse_deg / given[0].rmse_deg)
    rows = with_percentages([row for of in given for row in of.rows()])
    mean = [of.measures["rmse_deg"].mean(axis=1) for of in given]
    expected = 100 * mean[1] / mean[0]
    np.testing.assert_allclose([row["percent_of_uncompensated"] for row in rows[6:]], expected.ravel())


def test_without_the_uncompensated_one_there_is_no_percentage():
    alone = with_percentages([result("pid", errors(1, 1.0)).total()])
    assert alone[0]["percent_of_uncompensated"] is None


def test_measures_leave_the_hold_at_the_start_out():
    time = np.arange(400) * 0.02
    bend = np.where(time < 3, 50.0, 1.0)
    pull = np.where(time < 3, time, 3.0)
    trial = ControlTrial(np.zeros(400), pull, bend, bend, np.full(400, np.nan), time > 5.5, 0.02)
    measures = dict(zip(MEASURES, measures_of(trial), strict=True))
    assert measures.pop("fallback_share") == pytest.approx(0.5, abs=0.01)
    assert set(measures.values()) == {1.0, 0.0, -1.0}
    assert (measures["travel_mm"], measures["estimate_rmse_deg"]) == (0.0, -1.0)


def total(controller, rmse, condition="R = 1", **others):
    return {
        "controller": controller,
        "condition": condition,
        "rmse_deg": rmse,
        "worst_twin_rmse_deg": 2 * rmse,
        "late_rmse_deg": 3 * rmse,
        "late_worst_deg": 4 * rmse,
        "travel_mm": 10 * rmse,
    } | others


TOTALS = [total("pid", 1.0), total("ours", 0.25), total("pid", 1.5, "bends")]


def rows_of(text):
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("|") and ":--" not in line
    ]


def test_conditions_are_rows_controllers_columns_and_the_last_row_is_the_travel():
    assert rows_of(control_table(TOTALS)) == [
        ["condition", "pid", "ours"],
        ["R = 1", "1.00 (2.00)", "0.25 (0.50)"],
        ["bends", "1.50 (3.00)", ""],
        ["travel of the command, R = 1 [mm]", "10.0", "2.5"],
    ]
