"""References, conditions and cases: what happens when, and to which endoscopes."""

import numpy as np
import pytest
from controlled import PRESET, knowledge
from hypothesis import given
from hypothesis import strategies as st

from twin.control.conditions import (
    BENDING_AT_S,
    BENDING_S,
    BENT_BY,
    CONDITIONS,
    HOLD_S,
    SHARE,
    SIGNALS,
    ControlCondition,
    ControlSettings,
    reference,
)
from twin.preset import load_ranges

RANGES = load_ranges("ureteroscope")
T = 0.1
N = round((HOLD_S + 40) / T)
TIME = np.arange(N) * T - HOLD_S


def test_the_sheath_bends_by_a_quarter_turn_in_its_time():
    bend = (
        ControlCondition("bends", sample_time=T, bends_by=BENT_BY).sheath_bend(PRESET, N) - PRESET.sheath_bend
    )
    assert not bend[TIME < BENDING_AT_S].any()
    np.testing.assert_allclose(bend[TIME >= BENDING_AT_S + BENDING_S], BENT_BY)
    assert (np.diff(bend) >= 0).all()


@pytest.mark.parametrize("condition", CONDITIONS, ids=lambda condition: condition.name)
def test_every_condition_has_endoscopes_of_its_own_kind_and_the_same_references(condition):
    settings = ControlSettings(PRESET, RANGES, twins=2, seconds=2.0)
    stroke = settings.strokes_mm[0]
    known = knowledge(stroke_mm=stroke, sample_time=condition.sample_time)
    cases = settings.cases(condition, known)
    assert len(cases) == 2 * len(condition.signals)
    for name, value in condition.changes:
        assert all(getattr(case.preset, name) == value for case in cases)
    for case in cases:
        assert len(case.noise_deg) == len(case.reference_deg)
        assert len(case.sheath_bend) in (0, len(case.reference_deg))
        assert len(case.tip_force) in (0, len(case.reference_deg))
    same = ControlCondition("same", sample_time=condition.sample_time, signals=condition.signals)
    for case, other in zip(cases, settings.cases(same, known), strict=True):
        np.testing.assert_array_equal(case.reference_deg, other.reference_deg)


STROKES = ((-1.0, 1.0), (2.0, 4.0))
SETTINGS = ControlSettings(PRESET, load_ranges("ureteroscope"), STROKES, twins=3, seconds=10.0, seed=4)


def known_of_strokes():
    return [knowledge(stroke_mm=stroke, sample_time=T, noise_variance=1.0) for stroke in STROKES]


def tuning_cases():
    return [case for known in known_of_strokes() for case in SETTINGS.tuning_cases(known)]


def test_no_endoscope_noise_or_reference_of_the_tuning_is_scored():
    scored = [case for known in known_of_strokes() for case in SETTINGS.cases(CONDITIONS[0], known)]
    tuned = tuning_cases()
    assert {case.preset for case in tuned}.isdisjoint(case.preset for case in scored)
    for case in tuned:
        assert not any(np.isin(case.noise_deg, other.noise_deg).any() for other in scored)


kinds = st.sampled_from(SIGNALS)


@given(kinds, st.floats(-90, 80), st.floats(1, 120), st.integers(0, 2**32 - 1), st.sampled_from([0.02, 0.1]))
def test_it_holds_then_stays_in_the_middle_of_what_is_reached(kind, low, span, seed, sample_time):
    reached = (low, low + span)
    wanted = reference(kind, reached, 20.0, sample_time, np.random.default_rng(seed))
    held = round(HOLD_S / sample_time)
    assert wanted.shape == (held + round(20.0 / sample_time),)
    np.testing.assert_array_equal(wanted[:held], wanted[held])
    rest = (1 - SHARE) / 2 * span
    assert low + rest - 1e-9 <= wanted.min()
    assert wanted.max() <= low + span - rest + 1e-9


@pytest.mark.parametrize("seconds", [0.0, 0.1, np.nan])
@pytest.mark.parametrize("kind", [*SIGNALS, "x" * 900])
def test_what_cannot_be_is_refused_in_one_line(kind, seconds):
    rule = "needs at least two samples" if kind in SIGNALS else "unknown reference"
    with pytest.raises(ValueError, match=rule) as refused:
        reference(kind, (-50.0, 50.0), seconds, 0.1, np.random.default_rng(0))
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 150
