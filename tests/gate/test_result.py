"""A verdict follows from its checks: nothing that fails passes, and nothing required stays open."""

import json
import math

import pytest

from twin.gate.result import Check, GateVerdict, not_shown


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
    assert Check("a", "b", holds=holds, required=required).passes is passes


def test_one_check_that_fails_is_a_no_go_with_its_reason():
    good, bad = Check("good", "fine", holds=True), Check("bad", "too slow", holds=False)
    assert GateVerdict((good,), {}).word == "go"
    verdict = GateVerdict((good, bad), {})
    assert (verdict.word, verdict.reasons) == ("no-go", ("bad: too slow",))


def test_a_go_says_what_was_not_shown():
    verdict = GateVerdict((Check("good", "fine", holds=True), not_shown("logs", "none given")), {})
    assert verdict.word == "go"
    assert "not shown: logs" in verdict.reasons


def test_no_number_of_gate_json_is_infinite():
    check = Check("a", "b", figure=math.inf, bar=1.0, holds=False, rows=({"x": math.nan},))
    assert json.loads(json.dumps(check.to_dict(), allow_nan=False))["figure"] is None
