"""A force at the tip: statics of a chain of springs, and a part of the state."""

import numpy as np
import pytest

from twin.physics import Endoscope
from twin.preset import load_preset

PRESET = load_preset("ureteroscope")
UNHELD = PRESET.replace(pretension=0.0, wire_slack=0.02, joint_friction=0.0, section_stiffening=0.0)
"""Without a wire that holds, and without friction of the hinges: springs alone."""


@pytest.mark.parametrize("force", [1e-3, -2e-3])
def test_each_hinge_turns_by_force_times_lever_over_stiffness(force):
    endoscope = Endoscope.from_preset(UNHELD, drawn=False)
    endoscope.reset()
    endoscope.push_tip(force)
    for _ in range(300):
        endoscope.advance(0.0)
    link = UNHELD.section_length / UNHELD.vertebrae
    hinge = np.arange(UNHELD.vertebrae) * link
    centre = hinge[-1] + link / 2  # of the last vertebra, at which it acts
    stiffness = UNHELD.section_stiffness * UNHELD.vertebrae  # springs in series
    expected = force * (centre - hinge) / stiffness
    np.testing.assert_allclose(endoscope.joint_angle(), expected, rtol=0.01, atol=abs(force) * 1e-4)


def test_it_is_a_part_of_the_state_and_ends_with_a_reset():
    endoscope, other = (Endoscope.from_preset(PRESET, drawn=False) for _ in range(2))
    endoscope.reset()
    endoscope.push_tip(0.1)
    endoscope.advance(1e-4)
    state = endoscope.save_state()
    courses = []
    for of in (endoscope, other):
        of.restore_state(state)
        course = []
        for k in range(20):
            of.advance(1e-4 * (k + 2))
            course.append(of.bend())
        courses.append(course)
    np.testing.assert_array_equal(*courses)
    endoscope.push_tip(0.0)
    for _ in range(20):
        endoscope.advance(2.1e-3)
    assert endoscope.bend() < courses[0][-1]
    other.reset()
    untouched = Endoscope.from_preset(PRESET, drawn=False)
    untouched.reset()
    for of in (other, untouched):
        of.advance(1e-3)
    assert other.bend() == untouched.bend()
