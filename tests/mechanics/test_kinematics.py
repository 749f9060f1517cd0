"""Position of the tip: of MuJoCo's own kinematics, and of an arc of a circle."""

import numpy as np
import pytest
from plain_endoscope import PLAIN

from twin.mechanics.kinematics import link_frames
from twin.physics.endoscope import Endoscope

LENGTH = 0.04  # [m]


def tip_position(*arguments) -> np.ndarray:
    """Position of the tip, (N, 3) [m]."""
    return link_frames(*arguments).position[:, -1]


def test_tip_is_where_mujoco_has_it_in_two_planes():
    preset = PLAIN.replace(bending_planes=2, initial_bend=0.2, lateral_initial_bend=-0.5)
    endoscope = Endoscope.from_preset(preset)
    for step in range(40):
        endoscope.advance(step * 8e-5, -step * 5e-5)
    angles = endoscope.joint_angle(), endoscope.lateral_joint_angle()
    assert min(np.abs(angle.sum()) for angle in angles) > 0.3
    (tip,) = tip_position(*(angle[np.newaxis] for angle in angles), preset.section_length)
    np.testing.assert_allclose(tip, endoscope.tip_position(), atol=1e-9)


@pytest.mark.parametrize("bend", [-2.0, 0.4, 1.5])
def test_many_links_that_bend_alike_lie_on_an_arc(bend):
    """Of length L and angle theta: (L sin(theta) / theta, 0, L (1 - cos(theta)) / theta)."""
    many = np.full((1, 2000), bend / 2000)
    arc = LENGTH / bend * np.array([np.sin(bend), 0.0, 1 - np.cos(bend)])
    np.testing.assert_allclose(tip_position(many, np.empty((1, 0)), LENGTH)[0], arc, atol=LENGTH / 1000)
