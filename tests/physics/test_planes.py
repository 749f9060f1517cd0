"""Two bending planes, shape of the section, gravity and initial curvature against geometry and statics."""

import numpy as np
import pytest
from both_twins import MUJOCO, Twin
from plain_endoscope import PLAIN
from scipy.optimize import minimize

from twin.preset.preset import Preset

SAMPLE_TIME = 0.02  # [s]
GRAVITY = 9.81  # [m / s^2]
TWO_PLANES = PLAIN.replace(
    name="two planes", bending_planes=2, vertebrae=6, section_length=0.04, section_mass=2e-4
)
# A heavy section on wires so soft and slack that they hardly hold it.
HANGING = Preset(
    "hanging",
    vertebrae=6,
    section_length=0.04,
    section_mass=0.02,
    section_stiffness=0.05,
    section_damping=1e-3,
    wire_offset=1.3e-3,
    pretension=0.0,
    wire_stiffness=10.0,
    wire_damping=0.0,
    time_step=2.5e-3,
    control_period=5e-3,
).without_friction()
PULL = 2e-3 * np.sin(2 * np.pi * np.arange(120) / 100)
AT_REST = np.zeros(len(PULL))


def at_rest(preset: Preset, twin: Twin = MUJOCO):
    endoscope = twin.endoscope.from_preset(preset)
    for _ in range(300):
        before = endoscope.joint_angle().copy()
        endoscope.advance(0.0)
    speed = np.abs(endoscope.joint_angle() - before) / preset.control_period
    assert speed.max() < 1e-3  # [rad / s]
    return endoscope


@pytest.mark.parametrize(
    "changes",
    [{}, {"joint_friction": 0.0}, {"routing_friction": 0.2, "wire_stiffening": 0.1, "backlash": 2e-4}],
    ids=["rough", "free hinges", "rough vertebrae"],
)
def test_wire_c_bends_sideways_as_wire_a_bends_upwards(twin, changes):
    preset = TWO_PLANES.replace(**changes)
    upwards = twin.simulate(preset, PULL, SAMPLE_TIME)
    sideways = twin.simulate(preset, AT_REST, SAMPLE_TIME, lateral_pull=PULL)
    reached = 2e-5 * np.abs(upwards.bend).max()  # by an iterative solver of the friction constraints
    assert np.abs(upwards.bend).max() > 0.1
    np.testing.assert_allclose(sideways.lateral_bend, upwards.bend, atol=reached)
    np.testing.assert_allclose(sideways.lateral_joint_angle, upwards.joint_angle, atol=reached)
    np.testing.assert_allclose(sideways.wire_tension[:, 2:], upwards.wire_tension[:, :2], atol=1e-3)
    for other in (sideways.bend, upwards.lateral_bend):
        assert np.abs(other).max() < reached


def test_second_plane_at_rest_changes_nothing_in_the_first(twin):
    """But for the start, where wires of one plane are wound up, and those of two have been bent all round."""
    two = twin.simulate(TWO_PLANES, PULL, SAMPLE_TIME)
    one = twin.simulate(TWO_PLANES.replace(bending_planes=1), PULL, SAMPLE_TIME)
    wiped_out = slice(80, None)  # by the largest pull to either side
    reached = (
        2e-3 * np.abs(one.bend).max()
    )  # where a pull turns back within a sample, which two planes divide
    np.testing.assert_allclose(two.bend[wiped_out], one.bend[wiped_out], atol=reached)


def test_planes_have_wires_of_their_own_but_vertebrae_in_common(twin):
    """Without friction, two pulls do not know of each other; one that is held presses on all vertebrae."""
    smooth = TWO_PLANES.without_friction()
    rough, held = smooth.replace(routing_friction=0.3), np.full(len(PULL), 2e-3)
    alone, both = (twin.simulate(smooth, PULL, SAMPLE_TIME, lateral_pull=pull) for pull in (AT_REST, PULL))
    np.testing.assert_allclose(both.bend, alone.bend, atol=1e-4 * np.abs(alone.bend).max())
    np.testing.assert_allclose(both.lateral_bend, both.bend, atol=1e-4 * np.abs(alone.bend).max())
    alone, both = (twin.simulate(rough, PULL, SAMPLE_TIME, lateral_pull=pull) for pull in (AT_REST, held))
    assert np.abs(both.bend - alone.bend).max() > 5e-3 * np.abs(alone.bend).max()


def energy(angle: np.ndarray, preset: Preset) -> float:
    """Of a hanging section in its plane: springs of the hinges, weight of rigid links, the stretched wire."""
    n = preset.vertebrae
    direction, link = np.cumsum(angle), preset.section_length / n
    ends = np.cumsum(link * np.array([np.cos(direction), np.sin(direction)]), axis=1)
    middle = ends - link / 2 * np.array([np.cos(direction), np.sin(direction)])
    weight = preset.section_mass / n * np.array([preset.gravity_x, preset.gravity_z])
    stretch = preset.wire_offset * angle.sum()  # of the one wire, and slack of the other
    turn = angle - preset.initial_bend / n
    stiffens = preset.section_stiffening * n**2 / 2
    springs = n * preset.section_stiffness * (turn**2 + stiffens * turn**4).sum()
    return (springs + preset.wire_stiffness * stretch**2) / 2 - weight @ middle.sum(axis=1)


@pytest.mark.parametrize(
    "world",
    [
        {"gravity_z": -GRAVITY},
        {"gravity_z": GRAVITY, "vertebrae": 3},
        {"gravity_z": -GRAVITY, "section_mass": 0.3},
        {"gravity_z": -GRAVITY, "gravity_x": -2 * GRAVITY, "section_mass": 0.1},
        {"gravity_x": GRAVITY, "initial_bend": 1.2, "section_mass": 0.1},
        {"gravity_z": -GRAVITY, "initial_bend": -0.3, "section_mass": 0.3, "section_stiffening": 5.0},
    ],
    ids=["down", "towards wire a", "far down", "tip up", "curved", "stiffening"],
)
def test_section_hangs_where_its_energy_is_least(world):
    preset = HANGING.replace(**world)
    least = minimize(energy, np.zeros(preset.vertebrae), args=(preset,), options={"gtol": 1e-9}).x
    angle = at_rest(preset).joint_angle()
    np.testing.assert_allclose(angle, least, atol=1e-5 * np.abs(least).max())
    assert np.sign(angle.sum()) == np.sign(preset.gravity_z or preset.initial_bend)
    assert np.abs(angle.sum()) > 0.01


def test_gravity_along_a_straight_section_or_across_its_plane_does_not_bend_it():
    assert np.abs(at_rest(HANGING.replace(gravity_x=GRAVITY)).bend()) < 1e-7
    assert np.abs(at_rest(HANGING.replace(gravity_y=GRAVITY)).bend()) < 1e-7


@pytest.mark.parametrize("planes", [1, 2])
def test_section_that_no_wire_pulls_rests_at_its_initial_bend(twin, planes):
    """The soft wire on its outside takes what little it can: K (bend_0 - bend) = k r^2 bend."""
    preset = HANGING.replace(initial_bend=-0.9, bending_planes=planes)
    endoscope = at_rest(preset, twin)
    stiffness = preset.section_stiffness
    share = stiffness / (stiffness + preset.wire_stiffness * preset.wire_offset**2)
    assert share > 0.999
    assert endoscope.bend() == pytest.approx(-0.9 * share, rel=1e-5)
    np.testing.assert_allclose(endoscope.joint_angle(), -0.9 * share / 6, rtol=1e-4)
    assert endoscope.lateral_bend() == pytest.approx(0, abs=1e-7)
