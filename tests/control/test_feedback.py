"""PI on an estimate, on straight plants whose loop can be written down."""

import math

import numpy as np
import pytest
from controlled import LIMITS, T, assert_within, closed_loop, knowledge
from hypothesis import given
from hypothesis import strategies as st

from twin.control.controller import CommandLimits, Sensed
from twin.control.controllers.feedback import PI_SETTINGS, EstimateFeedback

GAINS = {name: setting.default for name, setting in PI_SETTINGS.items()}
WIDE = CommandLimits(-20.0, 20.0, 200.0)
LINE = knowledge().line


class Exact:
    """An estimate that is the measurement."""

    def __init__(self, bend_deg: float) -> None:
        self.bend_deg = bend_deg

    def push(self, time_s: float, pull_mm: float, measurement_deg: float) -> None:
        self.bend_deg = measurement_deg


def feedback(limits=LIMITS, settings=GAINS) -> EstimateFeedback:
    return EstimateFeedback(knowledge(limits=limits), Exact, settings)


def straight(ratio=1.0, offset=0.0):
    """A plant whose slope is a multiple of the line's."""
    return lambda pull: ratio * LINE.slope * pull + offset


@given(
    st.floats(0.6, 1.4),
    st.floats(-8, 8),
    st.floats(-20, 20),
    st.floats(0.005, 0.025),
    st.floats(0.05, 0.2),
)
def test_the_error_to_a_constant_reference_follows_the_closed_loop_and_ends(ratio, offset, wanted, p, i):
    """e(k+1) = e(k) - s [P (e(k) - e(k-1)) + I T e(k)] on a plant of slope s, whatever its offset."""
    controller = feedback(WIDE, {"proportional_mm_per_deg": p, "integral_mm_per_deg_s": i})
    course = closed_loop(controller, straight(ratio, offset), np.full(600, wanted))
    error = wanted - course.bend_deg
    expected, slope = [0.0, error[0]], ratio * LINE.slope
    for _ in range(len(error) - 1):
        before, now = expected[-2:]
        expected.append(now - slope * (p * (now - before) + i * T * now))
    np.testing.assert_allclose(error, expected[1:], atol=1e-8)
    assert abs(error[-1]) < 1e-6


def test_a_reference_that_moves_is_commanded_ahead_by_the_line():
    """On a plant that is the line, the bend of each sample is the reference of that sample."""
    wanted = 30 * np.sin(np.arange(200) * T)
    course = closed_loop(feedback(WIDE), straight(offset=LINE.offset_deg), wanted)
    np.testing.assert_allclose(course.bend_deg, wanted, atol=1e-9)


@given(st.floats(-3, 3), st.floats(-50, 50))
def test_it_starts_without_a_jump_wherever_the_endoscope_stands(first, wanted):
    controller = feedback(WIDE)
    controller.start(first, wanted)
    assert controller.estimate_deg == wanted
    assert controller.step(Sensed(0.0, wanted, wanted, wanted)) == pytest.approx(first, abs=1e-12)


@pytest.mark.parametrize("offset", [-15.0, 15.0])
@pytest.mark.parametrize("beyond", [90.0, 140.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_however_long_it_was_at_the_limit_it_leaves_it_at_once(offset, beyond, side):
    """Without anti-windup, two minutes at the limit would take minutes to unlearn."""
    away = []
    for seconds in (6, 120):
        held = round(seconds / T)
        wanted = side * np.concatenate([np.zeros(20), np.full(held, beyond), np.full(40, 20.0)])
        course = closed_loop(feedback(), straight(offset=side * offset), wanted)
        assert_within(LIMITS, course.pull_mm)
        assert course.pull_mm[held + 18] == pytest.approx(side * 3.5, abs=1e-6)
        away.append(course.pull_mm[held + 19 :])
    np.testing.assert_allclose(*away, atol=1e-6)
    # The drop is known one sample ahead; from the next one on it goes as fast as it may.
    assert np.abs(away[1][2]) <= LIMITS.high_mm - LIMITS.speed_mm_s * T + 1e-9


def test_at_the_limit_of_speed_the_sum_does_not_grow_either():
    slow = CommandLimits(-5.0, 5.0, 0.5)
    wanted = np.concatenate([np.zeros(5), np.full(300, 60.0)])
    course = closed_loop(feedback(slow), straight(), wanted)
    assert_within(slow, course.pull_mm)
    assert course.bend_deg.max() < 60 + 0.5
    assert course.bend_deg[-1] == pytest.approx(60, abs=1e-6)


def test_an_error_whose_growth_of_one_sample_is_beyond_the_speed_is_removed_too():
    """I T e of 4.5 mm a sample, where 0.2 are allowed: it goes as fast as it may, and comes to rest."""
    limits = CommandLimits(-5.0, 5.0, 2.0)
    gains = {"proportional_mm_per_deg": 0.001, "integral_mm_per_deg_s": 3.0}
    course = closed_loop(feedback(limits, gains), straight(ratio=0.2, offset=-15.0), np.zeros(200))
    assert_within(limits, course.pull_mm)
    assert np.diff(course.pull_mm[:10]) == pytest.approx(0.2)
    assert course.bend_deg[-1] == pytest.approx(0.0, abs=1e-6)


def test_at_a_limit_the_sum_still_goes_where_it_leads_away_from_it():
    """The line asks for less than can be followed while the bend is too low: the sum grows by I T e."""
    controller = feedback(CommandLimits(-5.0, 5.0, 0.5))
    controller.start(0.0, 0.0)
    assert controller.step(Sensed(0.0, -10.0, 0.0, -60.0)) == pytest.approx(-0.05)
    grown = GAINS["integral_mm_per_deg_s"] * T * 10
    wanted = LINE.slope * (-0.07 - grown) + LINE.offset_deg
    assert controller.step(Sensed(T, 0.0, 0.0, wanted)) == pytest.approx(-0.07, abs=1e-9)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_an_estimate_that_is_no_number_holds_the_command_and_leaves_no_trace(wrong):
    plant = straight(ratio=0.8, offset=5.0)
    wanted = np.full(60, 20.0)
    disturbed, alone = feedback(WIDE), feedback(WIDE)
    course = closed_loop(disturbed, plant, wanted, lambda k, bend: wrong if 10 <= k < 20 else bend)
    np.testing.assert_allclose(course.pull_mm[11:21], course.pull_mm[10])
    # Behind it, the loop goes on as one that had paused.
    undisturbed = closed_loop(alone, plant, wanted)
    np.testing.assert_allclose(course.pull_mm[20:], undisturbed.pull_mm[10:50], atol=1e-12)
