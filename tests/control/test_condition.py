"""Conditions: what happens on the way and when, and which endoscopes are drawn."""

import numpy as np
import pytest
from controlled import PRESET, knowledge

from twin.control.conditions import (
    BENDING_AT_S,
    BENDING_S,
    BENT_BY,
    CAPSTAN,
    CONDITIONS,
    HOLD_S,
    TOUCHED_AT_S,
    ControlCondition,
    ControlSettings,
)
from twin.preset import load_ranges
from twin.simulation import simulate_batch

RANGES = load_ranges("ureteroscope")
T = 0.1
N = round((HOLD_S + 40) / T)
TIME = np.arange(N) * T - HOLD_S


def draws(condition, count=40):
    return [condition.draw(PRESET, RANGES, np.random.default_rng(k)) for k in range(count)]


def test_the_sheath_bends_by_a_quarter_turn_in_its_time():
    bend = ControlCondition("bends", sample_time=T, bends=True).sheath_bend(PRESET, N) - PRESET.sheath_bend
    assert not bend[TIME < BENDING_AT_S].any()
    np.testing.assert_allclose(bend[TIME >= BENDING_AT_S + BENDING_S], BENT_BY)
    assert (np.diff(bend) >= 0).all()


def test_the_tip_is_touched_from_some_time_to_the_end():
    force = ControlCondition("touched", sample_time=T, tip_force=0.1).tip_forces(N)
    np.testing.assert_array_equal(force, np.where(TIME >= TOUCHED_AT_S - 1e-9, 0.1, 0.0))


def test_friction_by_the_capstan_is_as_much_as_the_nominal_one_at_rest():
    """Euler-Eytelwein: the tension behind a bend is that before it times exp(mu bend)."""
    bend, tension = PRESET.sheath_bend, PRESET.pretension

    def lost(preset):
        pressed = preset.sheath_friction_floor
        pressed += preset.sheath_friction_growth * bend**preset.sheath_friction_exponent
        return tension * np.expm1(preset.sheath_friction * bend) + pressed

    assert lost(PRESET.replace(**dict(CAPSTAN))) == pytest.approx(lost(PRESET), rel=0.05)


def test_wider_endoscopes_leave_the_ranges_and_no_others_do():
    name, low, high = RANGES.limits[0]
    inside, wider = (
        np.array([getattr(preset, name) for preset in draws(ControlCondition("c", wider=factor))])
        for factor in (1.0, 1.5)
    )
    assert low <= inside.min() <= inside.max() <= high
    assert wider.min() < low
    assert wider.max() > high


@pytest.mark.parametrize("condition", CONDITIONS, ids=lambda condition: condition.name)
def test_every_condition_has_endoscopes_of_its_own_kind_and_the_same_references(condition):
    settings = ControlSettings(PRESET, RANGES, twins=2, seconds=2.0)
    stroke = settings.strokes_mm[0]
    known = knowledge(stroke_mm=stroke, sample_time=condition.sample_time)
    cases = settings.cases(condition, stroke, known)
    assert len(cases) == 2 * len(condition.signals)
    for name, value in condition.changes:
        assert all(getattr(case.preset, name) == value for case in cases)
    for case in cases:
        assert len(case.noise_deg) == len(case.reference_deg)
        assert len(case.sheath_bend) in (0, len(case.reference_deg))
        assert len(case.tip_force) in (0, len(case.reference_deg))
    same = ControlCondition("same", sample_time=condition.sample_time, signals=condition.signals)
    for case, other in zip(cases, settings.cases(same, stroke, known), strict=True):
        np.testing.assert_array_equal(case.reference_deg, other.reference_deg)


def test_the_command_may_go_as_far_as_any_endoscope_of_the_ranges_needs():
    """Up from below and down from above, to the ends of the references: no error is for want of stroke."""
    settings = ControlSettings(PRESET, RANGES)
    presets = [RANGES.draw(PRESET, np.random.default_rng([7, k])) for k in range(60)]
    for stroke in settings.strokes_mm:
        limits, line = settings.limits(stroke), knowledge(stroke_mm=stroke).line
        (least, most), half = line.reached_deg, 0.65 / 2
        middle, width = (least + most) / 2, most - least
        sweep = np.concatenate(
            [
                np.linspace(0, limits.low_mm, 100),
                np.linspace(limits.low_mm, limits.high_mm, 300),
                np.linspace(limits.high_mm, limits.low_mm, 300),
            ]
        )
        for episode in simulate_batch(presets, [sweep * 1e-3] * len(presets), 0.02, physics="reduced"):
            assert episode.truth_deg[100:400].max() > middle + half * width
            assert episode.truth_deg[400:].min() < middle - half * width
