"""PID on the measurement: its low-pass against the solution of its equation, its derivative against PI."""

import itertools
import math

import numpy as np
import pytest
from controlled import LIMITS, T, closed_loop, knowledge
from hypothesis import given
from hypothesis import strategies as st

from twin.control.controller import CommandLimits, Sensed
from twin.control.controllers.feedback import PID, LowPass

SETTINGS = {name: setting.default for name, setting in PID.settings.items()}
cutoffs = st.floats(0.05, 20.0)


def filtered(low_pass: LowPass, measured) -> np.ndarray:
    bends = []
    for k, value in enumerate(measured):
        low_pass.push(k * T, 0.0, value)
        bends.append(low_pass.bend_deg)
    return np.array(bends)


@given(cutoffs, st.floats(0.005, 0.2), st.floats(-50, 50), st.floats(-5, 5))
def test_a_step_is_answered_with_the_time_constant_of_its_frequency(cutoff, sample_time, begun, step):
    """tau = 1 / (2 pi f): what is left of a step is exp(-t / tau), at any sample time."""
    low_pass = LowPass(begun, sample_time, cutoff, 100.0)
    time = np.arange(1, 41) * sample_time
    left = np.exp(-time * 2 * np.pi * cutoff)
    np.testing.assert_allclose(filtered(low_pass, [begun + step] * 40), begun + step * (1 - left), atol=1e-9)


@given(cutoffs, st.floats(0.1, 20), st.one_of(st.floats(1e2, 1e300), st.floats(-1e300, -1e2)))
def test_a_spike_moves_it_by_no_more_than_the_clip(cutoff, clip, spike):
    low_pass = LowPass(10.0, T, cutoff, clip)
    moved = filtered(low_pass, [spike])[0] - 10.0
    share = 1 - math.exp(-2 * math.pi * cutoff * T)
    assert moved == pytest.approx(math.copysign(share * clip, spike), rel=1e-9)
    assert abs(low_pass.rate_deg_s) <= clip / T * (1 + 1e-9)


@given(st.lists(st.floats(-80, 80), min_size=2, max_size=30))
def test_its_rate_is_that_of_its_output(measured):
    low_pass = LowPass(0.0, T, 2.0, 3.0)
    before = 0.0
    for value in measured:
        low_pass.push(0.0, 0.0, value)
        assert low_pass.rate_deg_s == pytest.approx((low_pass.bend_deg - before) / T, abs=1e-9)
        before = low_pass.bend_deg


def test_the_derivative_is_that_of_the_reference_less_that_of_the_bend():
    """Beside one without it, on the same stream, each time from the same command."""
    wide, gain = CommandLimits(-20.0, 20.0, 200.0), 0.004
    with_it, without = (
        PID.make(knowledge(limits=wide, settings={"pid": {"derivative_mm_s_per_deg": of}}))
        for of in (gain, 0.0)
    )
    low_pass = LowPass(0.0, T, SETTINGS["cutoff_hz"], SETTINGS["clip_deg"])
    wanted, rng = 10 * np.sin(np.arange(80) * T), np.random.default_rng(0)
    for controller in (with_it, without):
        controller.start(0.0, wanted[0])
    for k, (now, following) in enumerate(itertools.pairwise(wanted)):
        measured = now + rng.normal()
        before = low_pass.bend_deg
        low_pass.push(k * T, 0.0, measured)
        rate = (low_pass.bend_deg - before) / T
        sensed = Sensed(k * T, measured, now, following)
        asked = with_it.step(sensed) - without.step(sensed)
        assert asked == pytest.approx(gain * ((following - now) / T - rate), abs=1e-9)
        with_it.pull_mm = without.pull_mm = 0.0


def test_there_is_no_error_left_to_a_constant_reference():
    known = knowledge()
    line = known.line
    course = closed_loop(PID.make(known), lambda pull: 0.9 * line.slope * pull + 4.0, np.full(1500, 25.0))
    assert course.bend_deg[-1] == pytest.approx(25.0, abs=1e-6)
    assert course.believed_deg[-1] == pytest.approx(25.0, abs=1e-6)
    assert np.abs(course.pull_mm).max() < LIMITS.high_mm
