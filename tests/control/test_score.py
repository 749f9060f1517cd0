"""Scores: rows by signal and stroke, errors of twins, and how much less error ours has."""

import dataclasses

import numpy as np
import pytest

from twin.control.conditions import CONDITIONS
from twin.control.results import MEASURES, ControlResult, comparisons, measures_of
from twin.control.trial import ControlTrial
from twin.gate.trial import reduction_interval

STROKES = ((-1.0, 1.0), (2.0, 4.0))


def result(name, errors, condition=CONDITIONS[0]):
    """A controller with errors (strokes, twins, signals)."""
    measures = {measure: np.full(np.shape(errors), -1.0) for measure in MEASURES}
    return ControlResult(name, condition, STROKES, measures | {"rmse_deg": np.asarray(errors, float)}, {})


def errors(seed, scale):
    return scale * np.random.default_rng(seed).uniform(0.5, 1.5, (2, 6, 3))


def test_squares_are_of_twins_first():
    of = result("ours", np.arange(36).reshape(2, 6, 3))
    assert of.squares.shape == (6, 6)
    np.testing.assert_array_equal(of.squares[0], np.square([0, 1, 2, 18, 19, 20]))
    assert of.rmse_deg == pytest.approx(np.sqrt(np.mean(np.square(np.arange(36)))))
    np.testing.assert_allclose(of.by_twin_deg, np.sqrt(of.squares.mean(axis=1)))


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


def test_totals_are_of_all_trials():
    of = result("ours", errors(0, 1.0))
    measures = of.measures | {"late_rmse_deg": errors(1, 2.0), "late_worst_deg": errors(2, 3.0)}
    total = dataclasses.replace(of, measures=measures).total()
    assert total["rmse_deg"] == of.rmse_deg
    assert total["worst_twin_rmse_deg"] == of.by_twin_deg.max()
    assert total["late_rmse_deg"] == pytest.approx(np.sqrt((errors(1, 2.0) ** 2).mean()))
    assert total["late_worst_deg"] == errors(2, 3.0).max()


def test_an_oracle_is_no_rival():
    given = [result(name, errors(0, 1.0)) for name in ("ours", "theirs", "oracle")]
    assert [of["rival"] for of in comparisons(given, "ours", 0)] == ["theirs"]
    assert [of.total()["oracle"] for of in given] == [False, False, True]


def test_a_constant_ratio_is_the_reduction_and_all_of_its_interval():
    theirs = errors(1, 1.0)
    (found,) = comparisons([result("ours", theirs / 4), result("theirs", theirs)], "ours", 0)
    assert found["reduction"] == pytest.approx(0.75)
    assert found["reduction_ci95"] == pytest.approx([0.75, 0.75])


def test_equals_differ_by_an_interval_about_zero():
    low, high = reduction_interval(
        errors(2, 1.0).reshape(6, 6), errors(3, 1.0).reshape(6, 6), np.random.default_rng(0)
    )
    assert -0.5 < low < 0 < high < 0.5


def test_measures_leave_the_hold_at_the_start_out():
    time = np.arange(400) * 0.02
    bend = np.where(time < 3, 50.0, 1.0)
    pull = np.where(time < 3, time, 3.0)
    trial = ControlTrial(np.zeros(400), pull, bend, bend, np.full(400, np.nan), time > 5.5, 0.02)
    measures = dict(zip(MEASURES, measures_of(trial), strict=True))
    assert measures.pop("fallback_share") == pytest.approx(0.5, abs=0.01)
    assert set(measures.values()) == {1.0, 0.0, -1.0}
    assert (measures["travel_mm"], measures["estimate_rmse_deg"]) == (0.0, -1.0)


def test_late_errors_are_those_of_the_last_twenty_seconds():
    time = np.arange(3000) * 0.02
    bend = np.where(time < 40, 7.0, 3.0)
    bend[-1] = 5.0
    zero = np.zeros(3000)
    measures = dict(
        zip(MEASURES, measures_of(ControlTrial(zero, zero, bend, bend, zero, zero > 0, 0.02)), strict=True)
    )
    assert measures["late_rmse_deg"] == pytest.approx(np.sqrt(9 + 16 / 1000))
    assert (measures["late_worst_deg"], measures["worst_deg"]) == (5.0, 7.0)
