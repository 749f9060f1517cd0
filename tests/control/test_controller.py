"""The interface of controllers: whatever a controller wants or measures, it commands what can be followed."""

import math

import numpy as np
import pytest
from controlled import LIMITS, STROKE_MM, T, assert_within, closed_loop, knowledge
from hypothesis import given, settings
from hypothesis import strategies as st
from small_tracking import write_tiny

from twin.control.controller import Controller, Sensed, controller_specs, find_controllers

DEPLOYABLE = [spec.name for spec in controller_specs() if not spec.oracle]
any_number = st.one_of(st.floats(), st.sampled_from([math.nan, math.inf, -math.inf]))
WORST = [math.nan, math.inf, -math.inf, 1e308, -1e308, 1e6, 0.0, None]
"""Measurements; None is the true one."""
SEGMENTS = st.lists(
    st.tuples(st.sampled_from(WORST), st.sampled_from([1, -1]), st.integers(1, 150)), min_size=3, max_size=6
)
"""Measurements, whether their sign changes from sample to sample, and for how many samples they last."""


@pytest.fixture(scope="module")
def files(twins_policy, tmp_path_factory):
    """All trained files that controllers run on, by the fields of `ControlKnowledge`."""
    folder = tmp_path_factory.mktemp("tracking")
    tracking = write_tiny(folder / "ppo.onnx", sample_time=T, speed_mm_s=LIMITS.speed_mm_s)
    return {"policy": twins_policy, "tracking_policy": tracking}


class Wanting(Controller):
    """A controller that wants what it is told to, one after the other."""

    def __init__(self, wanted) -> None:
        super().__init__(LIMITS, T)
        self._wants, self.noted = iter(wanted), []

    def _wanted_mm(self, sensed: Sensed) -> float:
        return next(self._wants)

    def _commanded(self) -> None:
        self.noted.append(self.pull_mm)


@given(st.lists(any_number, min_size=1), st.floats(LIMITS.low_mm, LIMITS.high_mm))
def test_whatever_is_wanted_a_number_within_the_limits_is_commanded(wanted, first):
    controller = Wanting(wanted)
    controller.start(first, 0.0)
    pulls = [first]
    for before in wanted:
        pulls.append(controller.step(Sensed(0.0, 0.0, 0.0, 0.0)))
        assert controller.pull_mm == pulls[-1]
        if math.isnan(before):
            assert pulls[-1] == pulls[-2]
    assert_within(LIMITS, pulls)
    assert controller.noted == pulls[1:]


@pytest.mark.parametrize("name", DEPLOYABLE)
@settings(max_examples=3)
@given(segments=SEGMENTS, seed=st.integers(0, 99))
def test_every_controller_stays_within_the_limits_whatever_it_measures(name, segments, seed, files):
    rng = np.random.default_rng(seed)
    stream = [
        None if value is None else value * sign**k for value, sign, count in segments for k in range(count)
    ][:400]
    (spec,) = find_controllers([name])
    known = knowledge(**files)
    controller = spec.make(known)

    def seen(sample: int, bend: float) -> float:
        return bend + rng.normal() if stream[sample] is None else stream[sample]

    levels = rng.uniform(-90, 90, len(stream) // 20 + 1)  # some of them beyond the stroke
    wanted = np.repeat(levels, 20)[: len(stream)]
    course = closed_loop(controller, lambda pull: 20 * pull, wanted, seen, first_mm=STROKE_MM[0])
    assert_within(LIMITS, course.pull_mm)
    assert not np.isinf(course.believed_deg).any()


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1e308])
@pytest.mark.parametrize("name", DEPLOYABLE)
def test_a_reference_that_is_no_angle_ends_no_run(name, wrong, files):
    wanted = np.full(120, 20.0)
    wanted[30:40] = wrong
    (spec,) = find_controllers([name])
    course = closed_loop(spec.make(knowledge(**files)), lambda pull: 20 * pull, wanted)
    assert_within(LIMITS, course.pull_mm)
    if math.isnan(wrong):
        held = course.pull_mm[30:40]
        np.testing.assert_allclose(held, held[0], atol=0.2)  # D of a low-pass that goes on
