"""Friction of a wire in its bent sheath against the capstan equation, alone and in the simulation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.physics import simulate
from twin.physics.friction import element_friction
from twin.preset import load_preset

SAMPLE_TIME = 0.02  # [s]
PRESET = load_preset("ureteroscope")


@given(
    elements=st.integers(1, 64),
    friction=st.floats(0, 1),
    bend=st.floats(0, 4 * np.pi),
    tension=st.floats(0.1, 100),
)
def test_elements_of_any_number_make_up_the_capstan_equation(elements, friction, bend, tension):
    share = np.arange(elements + 1) / elements
    sliding = tension * np.exp(-friction * bend * share)  # Euler: exact at every angle of wrap
    drop = element_friction(sliding, friction, bend, floor=0.0)
    np.testing.assert_allclose(drop, -np.diff(sliding), rtol=1e-9, atol=1e-12 * tension)
    np.testing.assert_array_equal(element_friction(sliding[::-1], friction, bend, floor=0.0), drop[::-1])
    assert element_friction(0 * sliding, friction, bend, floor=2.0).sum() == pytest.approx(2.0)


@pytest.mark.parametrize("friction", [PRESET.sheath_friction, 0.3])
@pytest.mark.parametrize("bend", [0.5, np.pi, 2 * np.pi])
def test_sliding_wire_obeys_the_capstan_equation(friction, bend):
    preset = PRESET.replace(
        sheath_friction=friction, sheath_bend=bend, sheath_friction_floor=0.0, joint_friction=0.0
    )
    there, back = np.linspace(0, 8e-3, 201), np.linspace(8e-3, 1e-3, 351)
    tension = simulate(preset, np.concatenate([there, back]), SAMPLE_TIME).wire_tension[:, 0]
    pulled, released = tension[100:201], tension[-60:]
    np.testing.assert_allclose(pulled[:, -1] / pulled[:, 0], np.exp(-friction * bend), rtol=0.02)
    back_ratio = np.mean(released[:, -1] / released[:, 0])  # of a wire that slips back in small steps
    assert back_ratio == pytest.approx(np.exp(friction * bend), rel=0.02)
    per_element = np.exp(-friction * bend / preset.sheath_elements)
    np.testing.assert_allclose(pulled[:, 1:] / pulled[:, :-1], per_element, rtol=0.02)


def test_bend_converges_with_the_number_of_elements():
    pull = np.concatenate([np.linspace(0, 3e-3, 150), np.linspace(3e-3, 1.5e-3, 75)])
    bends = [simulate(PRESET.replace(sheath_elements=n), pull, SAMPLE_TIME).bend for n in (1, 3, 12, 24)]
    off = [np.abs(bend - bends[-1]).max() / np.ptp(bends[-1]) for bend in bends[:-1]]
    assert (np.diff(off) < 0).all()
    assert off[-1] < 0.02
