"""The factor of the sheath's friction: how far the tip stays behind, and a part of the state."""

import numpy as np
import pytest

from twin.physics import Endoscope
from twin.preset import load_preset

PRESET = load_preset("ureteroscope")
STROKE = 2e-3 * np.sin(np.linspace(0.0, 4 * np.pi, 400))  # [m]


def lost_motion(factor: float) -> float:
    """Area of the last loop over its height, the width of the loop [m]."""
    endoscope = Endoscope.from_preset(PRESET, drawn=False)
    endoscope.scale_friction(factor)
    bends = []
    for pull in STROKE:
        endoscope.advance(pull)
        bends.append(endoscope.bend())
    pull, bend = STROKE[200:], np.array(bends[200:])
    return abs(np.trapezoid(bend, pull)) / np.ptp(bend)


def test_more_friction_widens_the_loop_and_none_leaves_that_of_the_hinges():
    none, own, more = (lost_motion(factor) for factor in (0.0, 1.0, 2.0))
    assert 3 * none < own < more / 1.3


def test_it_multiplies_the_friction_of_every_element_and_ends_at_one():
    endoscope = Endoscope.from_preset(PRESET, drawn=False)
    endoscope.advance(0.0)
    own = endoscope.sheath_friction()
    endoscope.scale_friction(2.0)
    endoscope.advance(0.0)
    np.testing.assert_allclose(endoscope.sheath_friction(), 2 * own, rtol=1e-3)
    endoscope.scale_friction(1.0)
    endoscope.advance(0.0)
    np.testing.assert_allclose(endoscope.sheath_friction(), own, rtol=1e-3)


def test_it_is_a_part_of_the_state_and_ends_with_a_reset():
    endoscope, other = (Endoscope.from_preset(PRESET, drawn=False) for _ in range(2))
    endoscope.scale_friction(0.5)
    other.restore_state(endoscope.save_state())
    bends = [[of.advance(pull) or of.bend() for pull in STROKE[:60]] for of in (endoscope, other)]
    assert bends[0] == bends[1]
    endoscope.reset()
    untouched = Endoscope.from_preset(PRESET, drawn=False)
    bends = [[of.advance(pull) or of.bend() for pull in STROKE[:60]] for of in (endoscope, untouched)]
    assert bends[0] == bends[1]


@pytest.mark.parametrize("factor", [-0.1, np.nan, np.inf])
def test_a_factor_that_is_none_is_refused(factor):
    with pytest.raises(ValueError, match="friction factor of"):
        Endoscope.from_preset(PRESET, drawn=False).scale_friction(factor)
