"""Cases of a comparison: controllers are tuned on other endoscopes than are scored, at any speed of work."""

import numpy as np
import pytest
from controlled import PRESET, knowledge

from twin.control.conditions import BENT_BY, CONDITIONS, FAST_PERIOD_S, HOLD_S, TUNING, ControlSettings
from twin.preset import load_ranges

T = 0.1
STROKES = ((-1.0, 1.0), (2.0, 4.0))
SETTINGS = ControlSettings(PRESET, load_ranges("ureteroscope"), STROKES, twins=3, seconds=10.0, seed=4)


def known_of_strokes():
    return [knowledge(stroke_mm=stroke, sample_time=T, noise_variance=1.0) for stroke in STROKES]


def tuning_cases():
    return [case for known in known_of_strokes() for case in SETTINGS.tuning_cases(known)]


def test_no_endoscope_noise_or_reference_of_the_tuning_is_scored():
    scored = [
        case for known in known_of_strokes() for case in SETTINGS.cases(CONDITIONS[0], known.stroke_mm, known)
    ]
    tuned = tuning_cases()
    assert {case.preset for case in tuned}.isdisjoint(case.preset for case in scored)
    for case in tuned:
        assert not any(np.isin(case.noise_deg, other.noise_deg).any() for other in scored)


def test_the_tuning_has_quick_work_and_a_sheath_that_bends_within_it():
    for cases in (SETTINGS.tuning_cases(known) for known in known_of_strokes()):
        quick = cases[[kind for kind, _ in TUNING].index("fast-sine")].reference_deg[round(HOLD_S / T) :]
        period = round(FAST_PERIOD_S / T)
        np.testing.assert_allclose(quick[period:], quick[:-period], atol=1e-9)
        bending = [case for case in cases if len(case.sheath_bend)]
        assert len(bending) == sum(bends for _, bends in TUNING) == 1
        moved = bending[0].sheath_bend - bending[0].preset.sheath_bend
        assert moved[round(HOLD_S / T)] == 0
        assert moved[-1] == pytest.approx(BENT_BY)
