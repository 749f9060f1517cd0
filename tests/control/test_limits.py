"""Limits of the command: whatever is wanted, what comes out can be followed."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.control.controller import CommandLimits

any_number = st.one_of(st.floats(), st.sampled_from([math.nan, math.inf, -math.inf]))
moderate = st.floats(-1e3, 1e3)


@st.composite
def limits_and_pull(draw) -> tuple[CommandLimits, float]:
    low, high = sorted(draw(st.tuples(moderate, moderate).filter(lambda ends: ends[0] != ends[1])))
    limits = CommandLimits(low, high, draw(st.floats(1e-6, 1e6)))
    return limits, draw(st.floats(low, high))


@given(limits_and_pull(), any_number, st.floats(1e-4, 10.0))
def test_any_wanted_value_becomes_the_nearest_that_can_be_followed(drawn, wanted, sample_time):
    limits, pull = drawn
    found = limits.within(wanted, pull, sample_time)
    way = limits.speed_mm_s * sample_time
    assert limits.low_mm <= found <= limits.high_mm
    assert abs(found - pull) <= way * (1 + 1e-12) + 1e-12
    if math.isnan(wanted):
        assert found == pull
    else:
        nearest = np.clip(wanted, max(limits.low_mm, pull - way), min(limits.high_mm, pull + way))
        assert found == nearest


@given(limits_and_pull(), st.floats(1e-4, 10.0))
def test_the_reach_is_a_way_to_both_sides_cut_by_the_stroke(drawn, sample_time):
    limits, pull = drawn
    low, high = limits.reach(pull, sample_time)
    way = limits.speed_mm_s * sample_time
    assert limits.low_mm <= low <= pull <= high <= limits.high_mm
    assert low == limits.low_mm or low == pull - way
    assert high == limits.high_mm or high == pull + way


@given(limits_and_pull(), st.sampled_from([-1.0, 1.0]), st.floats(1e-3, 1e6), any_number)
def test_a_pull_beyond_the_stroke_is_brought_back_to_it(drawn, side, beyond, wanted):
    limits, _ = drawn
    outside = limits.low_mm - beyond if side < 0 else limits.high_mm + beyond
    assert limits.low_mm <= limits.within(wanted, outside, 0.1) <= limits.high_mm
    low, high = limits.reach(outside, 0.1)
    assert limits.low_mm <= low <= high <= limits.high_mm


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((3.0, 3.0, 1.0), r"stroke \[3, 3\] mm: the first must be below the second"),
        ((4.0, 3.0, 1.0), r"stroke \[4, 3\] mm"),
        ((math.nan, 3.0, 1.0), r"stroke \[nan, 3\] mm"),
        ((-math.inf, 3.0, 1.0), r"stroke \[-inf, 3\] mm"),
        ((-math.inf, math.inf, 1.0), r"stroke \[-inf, inf\] mm"),
        ((0.0, 3.0, 0.0), "speed = 0 mm/s: must be positive and finite"),
        ((0.0, 3.0, -2.0), "speed = -2 mm/s"),
        ((0.0, 3.0, math.nan), "speed = nan mm/s"),
        ((0.0, 3.0, math.inf), "speed = inf mm/s"),
    ],
)
def test_limits_that_cannot_be_are_refused_in_one_line(values, message):
    with pytest.raises(ValueError, match=message) as refused:
        CommandLimits(*values)
    assert type(refused.value).__name__ == "InputError"
    assert "\n" not in str(refused.value)
