"""The linear map: the line's pull for the next reference, whatever is measured."""

import math

import numpy as np
import pytest
from controlled import LIMITS, closed_loop, knowledge
from hypothesis import given
from hypothesis import strategies as st

from twin.control.controllers.feedback import LINEAR

any_number = st.one_of(st.floats(), st.sampled_from([math.nan, math.inf, -math.inf]))


@given(st.lists(any_number, min_size=30, max_size=30))
def test_it_is_the_line_of_the_next_reference_and_asks_no_sensor(measured):
    known = knowledge()
    wanted = 50 * np.sin(np.arange(30) * 0.1)
    controller = LINEAR.make(known)
    course = closed_loop(controller, lambda pull: 0.0, wanted, lambda k, bend: measured[k])
    np.testing.assert_allclose(course.pull_mm[1:], wanted[1:] / known.line.slope, atol=1e-9)
    assert math.isnan(controller.estimate_deg)


def test_beyond_the_stroke_it_stands_at_its_end():
    course = closed_loop(LINEAR.make(knowledge()), lambda pull: 0.0, np.full(20, 500.0))
    assert course.pull_mm[-1] == pytest.approx(LIMITS.high_mm)
