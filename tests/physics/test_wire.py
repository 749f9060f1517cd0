"""A wire as springs in series: tension against stretch, stiffness under load, and what winding up leaves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.mechanics.wire import quadratic_stiffness, segment_stiffness, stretch_at, tension_at, wound_tension
from twin.physics import simulate
from twin.preset.preset import Preset

SAMPLE_TIME = 0.02  # [s]
STIFFNESSES = st.floats(10.0, 1e9)
STIFFENINGS = st.floats(0.0, 10.0)
TENSIONS = st.floats(1e-6, 500.0)
PRESET = Preset(
    "wound",
    vertebrae=4,
    wire_offset=1.3e-3,
    wire_stiffness=8e3,
    wire_damping=3.0,
    pretension=3.0,
    sheath_elements=5,
    sheath_friction=0.3,
    sheath_bend=2.0,
    sheath_friction_floor=0.1,
    time_step=2.5e-3,
    control_period=5e-3,
)
WINDINGS = [
    {},
    {"sheath_friction_floor": 2.0},  # more than is left at the tip: slack there
    {"wire_stiffening": 0.5},
    {"wire_toe": 0.5},
    {"bending_planes": 2, "sheath_elements": 3},
    {"sheath_friction": 0.0, "sheath_friction_floor": 0.0, "joint_friction": 0.0},
]


def quadratic(stiffness, stiffening):
    return stiffening * stiffness**2 / 2


@given(stiffness=STIFFNESSES, stiffening=STIFFENINGS, tension=TENSIONS)
def test_tension_and_stretch_are_inverse_of_each_other(stiffness, stiffening, tension):
    coefficients = stiffness, quadratic(stiffness, stiffening)
    stretch = stretch_at(tension, *coefficients)
    assert tension_at(stretch, *coefficients) == pytest.approx(tension, rel=1e-12)
    assert stretch_at(tension_at(stretch, *coefficients), *coefficients) == pytest.approx(stretch, rel=1e-12)


@given(stiffness=STIFFNESSES, stiffening=STIFFENINGS, tension=TENSIONS, toe=st.floats(1e-3, 100.0))
def test_with_a_toe_they_are_inverse_too_and_a_wire_is_soft_below_it(stiffness, stiffening, tension, toe):
    """Without stiffening dT/dx = k (1 - exp(-T / T0)); a wire that carries far more is as without a toe."""
    law = stiffness, quadratic(stiffness, stiffening), toe / stiffness
    tension = max(tension, toe / 100)
    assert tension_at(stretch_at(tension, *law), *law) == pytest.approx(tension, rel=1e-6)
    straight = stiffness, 0.0, toe / stiffness
    stretch, step = stretch_at(tension, *straight), 1e-4 * toe / stiffness
    slope = (tension_at(stretch + step, *straight) - tension_at(stretch - step, *straight)) / (2 * step)
    assert slope == pytest.approx(-stiffness * np.expm1(-tension / toe), rel=1e-5)
    taut = 50 * toe / stiffness
    assert tension_at(taut, *law) == pytest.approx(tension_at(taut, *law[:2]), rel=1e-12)


@given(stiffness=STIFFNESSES, stiffening=STIFFENINGS, tension=TENSIONS)
def test_stiffness_under_tension(stiffness, stiffening, tension):
    """From T = k x + k2 x^2 follows (dT/dx)^2 = k^2 + 4 k2 T, and with k2 = s k^2 / 2: k sqrt(1 + 2 s T)."""
    coefficients = stiffness, quadratic(stiffness, stiffening)
    stretch = stretch_at(tension, *coefficients)
    apart = tension_at(1.001 * stretch, *coefficients) - tension_at(0.999 * stretch, *coefficients)
    slope = apart / (0.002 * stretch)  # central differences are exact for a parabola
    assert slope == pytest.approx(stiffness * np.sqrt(1 + 2 * stiffening * tension), rel=1e-9)


@pytest.mark.parametrize("stiffening", [0.0, 0.2])
def test_wires_of_a_rigid_section_are_springs_between_pulley_and_tip(stiffening):
    rigid = PRESET.without_friction().replace(section_stiffness=1e3, wire_stiffening=stiffening)
    wire = rigid.wire_stiffness, quadratic(rigid.wire_stiffness, stiffening)
    pull = np.concatenate([np.linspace(0, 1e-3, 50), np.full(25, 1e-3)])
    episode = simulate(rigid, pull, SAMPLE_TIME)
    wound = stretch_at(rigid.pretension, *wire)
    for sample in (10, 30, -1):
        expected = [tension_at(wound + side * episode.pulley[sample], *wire) for side in (1, -1)]
        moving = rigid.wire_damping * 1e-3  # [N], at 1 mm/s
        np.testing.assert_allclose(episode.tension[sample], expected, rtol=1e-3, atol=2 * moving)
    assert episode.tension[-1, 1] == 0.0  # paid out by more than it was stretched


@given(
    tension=TENSIONS,
    friction=st.floats(0.0, 2.0),
    bend=st.floats(0.0, 10.0),
    offset=st.floats(0.0, 10.0),
    elements=st.integers(1, 64),
)
def test_wound_wire_follows_the_capstan_equation(tension, friction, bend, offset, elements):
    preset = Preset(
        "wound",
        pretension=tension,
        sheath_friction=friction,
        sheath_bend=bend,
        sheath_bend_offset=offset,
        sheath_elements=elements,
        sheath_friction_floor=0.0,
    )
    wound = wound_tension(preset)
    share = np.arange(elements + 1) / elements
    assert wound[0] == tension
    np.testing.assert_allclose(
        wound, tension * np.exp(-friction * (bend + offset) * share), rtol=1e-6, atol=1e-14 * tension
    )


def test_friction_that_exceeds_the_pretension_leaves_the_inner_lengths_slack():
    """Without a bend every element takes floor / elements: 3 N last for the first three of 1 N each."""
    preset = PRESET.replace(sheath_bend=0.0, sheath_friction_floor=5.0, sheath_elements=5)
    np.testing.assert_allclose(wound_tension(preset), [3.0, 2.0, 1.0, 0.0, 0.0, 0.0], atol=1e-15)
    assert (wound_tension(PRESET.replace(pretension=0.0)) == 0).all()


@pytest.mark.parametrize("changes", WINDINGS)
def test_wound_endoscope_is_at_rest_and_stays(twin, changes):
    preset = PRESET.replace(**changes)
    endoscope = twin.endoscope.from_preset(preset)
    wound = np.tile(wound_tension(preset), (preset.wires, 1))
    if preset.bending_planes == 2:  # as long as wound up, and the same everywhere
        stretch = stretch_at(wound, segment_stiffness(preset), quadratic_stiffness(preset)).mean()
        wound[:] = tension_at(stretch, segment_stiffness(preset), quadratic_stiffness(preset))
    assert (endoscope.joint_angle() == 0).all()
    assert (twin.sliding(endoscope) == 0).all()
    np.testing.assert_allclose(endoscope.wire_tension(), wound, rtol=1e-12)
    for _ in range(200):
        endoscope.advance(0.0)
    np.testing.assert_allclose(endoscope.wire_tension(), wound, atol=1e-5 * preset.pretension)
    assert np.abs([*endoscope.joint_angle(), *twin.sliding(endoscope)]).max() < 1e-7  # [rad], [m]
