"""Controllers: their limits, the nominal line, the table, and what they command whatever they measure."""

import math

import numpy as np
import pytest
from controlled import LIMITS, PRESET, STROKE_MM, T, assert_within, closed_loop, knowledge
from hypothesis import given, settings
from hypothesis import strategies as st
from small_tracking import write_tiny

from twin.control import controller as registry
from twin.control.controller import (
    CommandLimits,
    Controller,
    ControllerSpec,
    Line,
    Sensed,
    Setting,
    controller_specs,
    find_controllers,
    fit_line,
)
from twin.control.controllers.feedback import LinearMap

DEPLOYABLE = [spec.name for spec in controller_specs() if not spec.oracle]
WRONG_STROKES = ((3.0, 3.0), (4.0, 3.0), (math.nan, 3.0), (-math.inf, 3.0), (-math.inf, math.inf))
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
    """A controller that wants a list of pulls, one after the other."""

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
        *(((*stroke, 1.0), "mm: the first must be below the second") for stroke in WRONG_STROKES),
        *(
            ((0.0, 3.0, speed), "mm/s: must be positive and finite")
            for speed in (0.0, -2.0, math.nan, math.inf)
        ),
    ],
)
def test_limits_that_cannot_be_are_refused_in_one_line(values, message):
    with pytest.raises(ValueError, match=message) as refused:
        CommandLimits(*values)
    assert type(refused.value).__name__ == "InputError"
    assert "\n" not in str(refused.value)


FRICTIONLESS = (
    PRESET.without_friction().without_viscosity().replace(section_stiffening=0.0, wire_stiffening=0.0)
)


def slope_of_taut_wires(preset) -> float:
    """Bend by pull [deg / mm]: the section's moment K theta is that of the wires, 2 k r (u - r theta)."""
    k, r, K = preset.wire_stiffness, preset.wire_offset, preset.section_stiffness
    return float(np.degrees(2 * k * r / (K + 2 * k * r**2)) * 1e-3)


@settings(max_examples=10)
@given(st.floats(3500, 6000), st.floats(0.9e-3, 1.3e-3), st.floats(0.015, 0.03), st.floats(-2e-4, 2e-4))
def test_without_friction_and_slack_it_is_that_of_the_equilibrium(k, r, K, zero):
    preset = FRICTIONLESS.replace(wire_stiffness=k, wire_offset=r, section_stiffness=K, command_zero=zero)
    slope = slope_of_taut_wires(preset)
    line = fit_line(preset, (-1.0, 1.6))
    assert line.slope == pytest.approx(slope, rel=5e-3)
    assert line.offset_deg == pytest.approx(-slope * zero * 1e3, abs=0.05)
    np.testing.assert_allclose(
        line.reached_deg, slope * (np.array([-1.0, 1.6]) - zero * 1e3), rtol=5e-3, atol=0.05
    )


@given(st.floats(1, 100), st.floats(-50, 50), st.floats(-90, 90))
def test_its_pull_brings_the_bend(slope, offset, bend):
    line = Line(slope, offset, (-60.0, 60.0))
    assert line.slope * line.pull_mm(bend) + line.offset_deg == pytest.approx(bend, abs=1e-9)


SETTINGS = {"gain": Setting(2.0, 1.0, 9.0), "rate_per_s": Setting(0.5, 0.1, 1.0)}


@pytest.fixture
def new(monkeypatch) -> ControllerSpec:
    """A controller between two others, registered for one test."""
    controller_specs()  # all files are imported before the table is copied
    monkeypatch.setattr(registry, "_SPECS", dict(registry._SPECS))

    def build(known, settings):
        made = LinearMap(known, {})
        made.settings = settings
        return made

    return registry.register_controller(ControllerSpec("my-law", 1.5, "nothing", build, SETTINGS))


def test_a_new_one_is_found_by_its_name_and_among_all_in_its_place(new):
    assert find_controllers(["my-law"]) == (new,)
    names = [spec.name for spec in find_controllers(["all"])]
    assert names == [spec.name for spec in controller_specs()]
    assert names[names.index("my-law") - 1 : names.index("my-law") + 2] == [
        "model-inverse",
        "my-law",
        "twin-inverse",
    ]
    assert len(names) == len(set(names))
