"""The linear map, PI and PID: on straight plants whose loop can be written down, and on their estimates."""

import itertools
import math

import numpy as np
import pytest
from controlled import DEPLOYMENT, LIMITS, MODEL, R, T, assert_within, closed_loop, knowledge
from hypothesis import given
from hypothesis import strategies as st

from twin.control.controller import CommandLimits, Sensed
from twin.control.controllers.feedback import (
    ACTIVE_MODEL_PI,
    LINEAR,
    PI_SETTINGS,
    PID,
    RAM_TWINS_PI,
    EstimateFeedback,
    LowPass,
)
from twin.control.trial import Plant
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.load import load_estimator

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


any_number = st.one_of(st.floats(), st.sampled_from([math.nan, math.inf, -math.inf]))


@given(st.lists(any_number, min_size=30, max_size=30))
def test_it_is_the_line_of_the_next_reference_and_asks_no_sensor(measured):
    known = knowledge()
    wanted = 50 * np.sin(np.arange(30) * 0.1)
    controller = LINEAR.make(known)
    course = closed_loop(controller, lambda pull: 0.0, wanted, lambda k, bend: measured[k])
    np.testing.assert_allclose(course.pull_mm[1:], wanted[1:] / known.line.slope, atol=1e-9)
    assert math.isnan(controller.estimate_deg)


def course(sample_time=T, variance=R, seed=1):
    known = knowledge(sample_time=sample_time, noise_variance=variance)
    rng = np.random.default_rng(seed)
    wanted = 30 * np.sin(np.arange(300) * 0.05)
    bend = [0.0, 0.0]

    def plant(pull: float) -> float:  # the model of its filter, and a drift
        (bend[0],), _ = MODEL.step(np.array([bend[0]]), np.empty(0), pull, bend[1])
        bend[1] = pull
        return bend[0] + 4.0

    return closed_loop(
        ACTIVE_MODEL_PI.make(known), plant, wanted, lambda k, of: of + rng.normal(0, variance**0.5)
    ), rng


@pytest.mark.parametrize(("sample_time", "variance"), [(T, R), (T, 4.0), (0.02, R)])
def test_it_believes_the_filter_that_was_tuned_with_q_of_its_sample_time_and_the_r_of_the_sensor(
    sample_time, variance
):
    followed, _ = course(sample_time, variance)
    q_bend, q_error = DEPLOYMENT.fallback.process_variance
    share = sample_time / T
    tuned = ActiveModel(MODEL, sample_time, (q_bend * share, q_error * share), variance, (100.0, 1.0))
    rng = np.random.default_rng(1)
    measured = np.array([of + rng.normal(0, variance**0.5) for of in followed.bend_deg])
    expected = tuned.estimate(followed.pull_mm, measured, 0.0)[0]
    np.testing.assert_allclose(followed.believed_deg, expected, atol=1e-6)


def test_it_believes_the_trained_file_at_the_r_of_the_sensor(twins_policy):
    known = knowledge(policy=twins_policy)
    plant, rng = Plant(known.preset, T, "reduced"), np.random.default_rng(2)
    plant.start(0.0)
    wanted = 40 * np.sin(np.arange(150) * 0.05)
    noise = rng.normal(0, R**0.5, len(wanted))
    course = closed_loop(RAM_TWINS_PI.make(known), plant.step, wanted, lambda k, bend: bend + noise[k])
    estimator = load_estimator(twins_policy, Sensor(R, zero_deviation_deg=0.0))
    expected = estimator.estimate(course.pull_mm, course.bend_deg + noise, 0.0)[0]
    np.testing.assert_allclose(course.believed_deg, expected, atol=1e-6)
    assert np.sqrt(np.mean((course.believed_deg - course.bend_deg)[20:] ** 2)) < 1.0


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


def test_the_derivative_is_that_of_the_reference_less_that_of_the_bend():
    """Against one without it, on the same stream, each time from the same command."""
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
