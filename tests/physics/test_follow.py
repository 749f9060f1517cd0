"""The kernel of the control period against the laws of wires and friction."""

import numpy as np
import pytest
from called_kernels import called_by_python
from plain_endoscope import PLAIN

from twin.mechanics.friction import element_friction, friction_per_tension
from twin.mechanics.wire import quadratic_stiffness, segment_stiffness
from twin.physics import Endoscope
from twin.physics.load import SLACK_SHARE, follow_load, sheath_friction
from twin.physics.stepping import Stepper

STIFFENING = PLAIN.replace(wire_stiffening=0.2, wire_damping=2.0, bending_planes=2)
PRESETS = [STIFFENING, STIFFENING.replace(wire_stiffness=2e4, sheath_friction=0.05, pretension=9.0)]
FRICTION, FOLLOW = map(called_by_python, (sheath_friction, follow_load))
ELEMENTS, SHEATH_BEND = STIFFENING.sheath_elements, 2.0


@pytest.fixture(params=PRESETS)
def followed(request):
    """Endoscope at a random position and velocity, with what its load makes of it; some wires are slack."""
    stepper, rng = Stepper.of(request.param), np.random.default_rng(0)
    motion = stepper.motion
    motion.qpos[:] = 1e-3 * rng.normal(size=motion.qpos.size)
    motion.qvel[:] = 0.3 * rng.normal(size=motion.qvel.size)
    friction = FRICTION(motion.law, SHEATH_BEND, 1.0, 0.0, 0.0)
    clock = STIFFENING.time_step, STIFFENING.control_period
    FOLLOW(motion.law, motion.forces, motion.qpos, motion.qvel, *clock, *friction)
    return stepper, motion.qpos[None], motion.qvel[None]


def stiffness_at(preset, tension):
    return np.sqrt(segment_stiffness(preset) ** 2 + 4 * quadratic_stiffness(preset) * tension)  # dT/dx


def test_friction_of_the_sheath_is_that_of_the_tension(followed):
    stepper, qpos, _ = followed
    preset = stepper.preset
    tension, slack = stepper.wires.tension_and_slack(qpos)
    assert (slack > 0).any()
    share = friction_per_tension(preset.sheath_friction, SHEATH_BEND + preset.sheath_bend_offset, ELEMENTS)
    expected = element_friction(tension[0], share, preset.sheath_friction_floor / ELEMENTS)
    np.testing.assert_allclose(stepper.motion.forces.sheath, expected, rtol=1e-12)
    np.testing.assert_allclose(stepper.motion.forces.tension, tension[0], rtol=1e-12)


def test_damping_makes_the_springs_implicit_where_they_are_or_will_be_taut(followed):
    stepper, qpos, qvel = followed
    wires = stepper.wires
    tension, slack = wires.tension_and_slack(qpos)
    stiffness = stiffness_at(stepper.preset, tension)
    own = STIFFENING.wire_damping * (ELEMENTS + 1)
    stays_slack = wires.tension_and_slack(qpos + 2 * STIFFENING.control_period * qvel)[1] > 0
    expected = np.where((slack > 0) & stays_slack, 0.0, own + STIFFENING.time_step * stiffness)
    assert 0 < (expected == 0).sum() < expected.size
    assert ((slack > 0) & ~stays_slack).any()
    np.testing.assert_allclose(stepper.motion.forces.damping, expected[0], rtol=1e-12)


def test_inertia_is_that_of_the_stiffness_to_come_and_half_of_it_where_a_wire_stays_slack(followed):
    stepper, qpos, qvel = followed
    wires = stepper.wires
    ahead = qpos + 2 * STIFFENING.control_period * qvel
    (tension, slack), (later, slack_later) = (wires.tension_and_slack(at) for at in (qpos, ahead))
    stiffness = stiffness_at(stepper.preset, np.maximum(tension, later))
    own = STIFFENING.wire_damping * (ELEMENTS + 1)
    share = np.where((slack > 0) & (slack_later > 0), SLACK_SHARE, 1.0)
    expected = share * STIFFENING.time_step * (own + STIFFENING.time_step * stiffness)
    np.testing.assert_allclose(stepper.motion.forces.inertia, expected[0], rtol=1e-12)


def test_a_wire_that_is_not_there_has_no_inertia():
    endoscope = Endoscope.from_preset(PLAIN.replace(wires_per_plane=1))
    inertia = endoscope.model.ptr.tendon_armature[endoscope.layout.wire]
    assert (inertia[0] > 0).all()
    assert (inertia[1] == 0).all()


def test_springs_of_mujoco_touch_the_law_of_wires_with_a_toe():
    stepper = Stepper.of(STIFFENING.replace(wire_toe=1.5))
    motion, wires, rng = stepper.motion, stepper.wires, np.random.default_rng(0)
    motion.qpos[:] = 2e-4 * rng.normal(size=motion.qpos.size)
    clock = STIFFENING.time_step, STIFFENING.control_period
    FOLLOW(motion.law, motion.forces, motion.qpos, motion.qvel, *clock, 0.0, 0.1)
    tension = wires.tension_and_slack(motion.qpos[None])[0][0]
    length = -(wires.lengthening @ motion.qpos).reshape(tension.shape)
    spring, at_rest = motion.forces.stiffness, motion.forces.length
    np.testing.assert_allclose(spring * (-length - at_rest), tension, rtol=1e-9)
    apart = 1e-7 * rng.normal(size=motion.qpos.size)
    change = (wires.tension_and_slack((motion.qpos + apart)[None])[0] - tension[None])[0]
    longer = (wires.lengthening @ apart).reshape(tension.shape)
    np.testing.assert_allclose(spring * longer, change, atol=1e-5)
