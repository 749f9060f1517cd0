"""A verdict follows from its checks; the paired comparison recognises the better estimator."""

import json
import math

import numpy as np
import pytest

from twin.gate.check import Check, GateVerdict, not_shown
from twin.gate.trial import compare_paired


@pytest.mark.parametrize(
    ("holds", "required", "passes"),
    [
        (True, True, True),
        (False, True, False),
        (False, False, False),
        (None, True, False),
        (None, False, True),
    ],
)
def test_what_passes(holds, required, passes):
    assert Check(said="a", holds=holds, required=required).passes is passes


def test_one_check_that_fails_is_a_no_go_with_its_reason():
    good = Check(said="fine", holds=True, name="good")
    bad = Check(said="too slow", holds=False, name="bad", remedy="Be faster.")
    verdict = GateVerdict(checks=(good, not_shown("none given", "Give one.")), subject={})
    assert verdict.word == "go"
    assert any("not shown" in reason for reason in verdict.reasons)
    verdict = GateVerdict(checks=(good, bad), subject={})
    assert (verdict.word, verdict.reasons) == ("no-go", ("bad: too slow. Be faster.",))


def test_no_number_of_gate_json_is_infinite():
    check = Check(said="a", figure=math.inf, bar=1.0, holds=False, rows=({"x": math.nan},))
    (values,) = GateVerdict(checks=(check,), subject={}).to_dict()["checks"]
    assert json.loads(json.dumps(values, allow_nan=False))["figure"] is None
    assert values["rows"] == [{"x": None}]


def runs(rng, units=40, draws=3, twin=1.0, noise=0.3):
    """Mean square errors that differ from twin to twin and from draw to draw."""
    level = np.exp(twin * rng.standard_normal((units, 1)))
    return level * np.exp(noise * rng.standard_normal((units, draws)))


def test_pairing_recognises_a_difference_far_smaller_than_that_between_twins():
    rng = np.random.default_rng(2)
    rival = runs(rng)
    same = compare_paired(rival, rival)
    assert (same.difference_deg, same.low_deg, same.high_deg) == (0, 0, 0)
    assert same.rmse_deg == pytest.approx(np.sqrt(rival.mean()))
    assert compare_paired(0.9 * rival, rival).high_deg < 0
    assert compare_paired(rival, 0.9 * rival).low_deg > 0
    shuffled = rng.permutation(rival)
    assert compare_paired(0.9 * shuffled, rival).high_deg > 0


@pytest.mark.parametrize("units", [40, 6])
def test_interval_covers_the_true_difference_as_often_as_stated(units):
    rng, trials, inside = np.random.default_rng(3), 300, 0
    for _ in range(trials):
        rival = runs(rng, units, twin=0.3)
        mine = 0.8 * rival * np.exp(0.2 * rng.standard_normal((units, 1)) - 0.02)
        found = compare_paired(mine, rival)
        truth = (np.sqrt(0.8) - 1) * np.sqrt(np.exp(0.3**2 / 2 + 0.3**2 / 2))
        inside += found.low_deg <= truth <= found.high_deg
    assert 0.91 <= inside / trials <= 0.99


def test_a_single_run_shows_nothing_and_draws_decide_where_units_are_few():
    """An interval of one run is infinite; what two units differ by widens none over their draws."""
    one = compare_paired(np.array([[1.0]]), np.array([[2.0]]))
    assert (one.low_deg, one.high_deg) == (-np.inf, np.inf)
    level = np.array([[1.0], [100.0]])
    few = compare_paired(0.25 * level * np.ones((2, 6)), level * np.ones((2, 6)))
    assert few.low_deg == pytest.approx(few.high_deg)
    assert few.relative_high == pytest.approx(-0.5)
