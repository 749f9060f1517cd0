"""A section that is curved by itself begins where friction holds it, in both twins alike."""

import numpy as np
import pytest
from both_twins import MUJOCO, REDUCED

from twin.mechanics.friction import joint_friction
from twin.preset.preset import Preset

CURVED = Preset(
    "curved",
    vertebrae=8,
    initial_bend=0.5,
    section_stiffness=0.03,
    joint_friction=2e-3,
    joint_friction_taper=0.4,
    sheath_friction=0.1,
    sheath_friction_floor=1.0,
)


def missing_moment(preset: Preset, endoscope) -> np.ndarray:
    """Return what spring and wires leave for friction to hold at each hinge, (vertebrae,) [N m]."""
    away = endoscope.joint_angle() - preset.initial_bend / preset.vertebrae
    tension = endoscope.wire_tension()[:, -1]
    return preset.wire_offset * (tension[0] - tension[1]) - preset.section_stiffness * preset.vertebrae * away


def test_friction_is_at_its_limit_where_the_section_came_to_rest_and_never_beyond(twin):
    endoscope = twin.endoscope.from_preset(CURVED)
    held = np.abs(missing_moment(CURVED, endoscope))
    assert 0 < endoscope.bend() < CURVED.initial_bend
    np.testing.assert_array_less(held, 1.02 * joint_friction(CURVED))
    assert held.max() > 0.9 * joint_friction(CURVED).min()


@pytest.mark.parametrize("planes", [1, 2])
@pytest.mark.parametrize("curve", [-0.4, 0.1, 1.0])
def test_both_twins_come_to_rest_at_the_same_bend(curve, planes):
    preset = CURVED.replace(initial_bend=curve, bending_planes=planes)
    one, other = (kind.endoscope.from_preset(preset) for kind in (MUJOCO, REDUCED))
    assert one.bend() == pytest.approx(other.bend(), rel=0.01, abs=np.radians(0.15))
    assert one.lateral_bend() == pytest.approx(0.0, abs=1e-6)
