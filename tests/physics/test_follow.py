"""The kernel of the control period against the laws of wires and friction, compiled and interpreted."""

import numpy as np
import pytest
from plain_endoscope import PLAIN

from twin.mechanics.friction import element_friction, friction_per_tension
from twin.mechanics.kernels import COMPILED
from twin.physics import Endoscope
from twin.physics.load import SLACK_SHARE, follow_load, sheath_friction
from twin.physics.stepping import Stepper

STIFFENING = PLAIN.replace(wire_stiffening=0.2, wire_damping=2.0, bending_planes=2)
PRESETS = [STIFFENING, STIFFENING.replace(wire_stiffness=2e4, sheath_friction=0.05, pretension=9.0)]
ELEMENTS, SHEATH_BEND = STIFFENING.sheath_elements, 2.0


@pytest.fixture(params=["compiled", "interpreted"])
def kernels(request):
    """The two kernels, as Numba compiles them and as Python runs them."""
    if request.param == "compiled":
        return sheath_friction, follow_load
    if not COMPILED:
        pytest.skip("nothing is compiled here")
    return sheath_friction.py_func, follow_load.py_func


@pytest.fixture(params=PRESETS)
def followed(request, kernels):
    """Endoscope at a random position and velocity, with what its load makes of it; some wires are slack."""
    stepper, rng = Stepper.of(request.param), np.random.default_rng(0)
    motion = stepper.motion
    motion.qpos[:] = 1e-3 * rng.normal(size=motion.qpos.size)
    motion.qvel[:] = 0.3 * rng.normal(size=motion.qvel.size)
    friction = kernels[0](motion.law, SHEATH_BEND, 1.0, 0.0, 0.0)
    clock = STIFFENING.time_step, STIFFENING.control_period
    kernels[1](motion.law, motion.forces, motion.qpos, motion.qvel, *clock, *friction)
    return stepper, motion.qpos[None], motion.qvel[None]


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
    stiffness = np.sqrt(wires.stiffness**2 + 4 * wires.quadratic * tension)  # dT/dx
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
    stiffness = np.sqrt(wires.stiffness**2 + 4 * wires.quadratic * np.maximum(tension, later))  # dT/dx
    own = STIFFENING.wire_damping * (ELEMENTS + 1)
    share = np.where((slack > 0) & (slack_later > 0), SLACK_SHARE, 1.0)
    expected = share * STIFFENING.time_step * (own + STIFFENING.time_step * stiffness)
    np.testing.assert_allclose(stepper.motion.forces.inertia, expected[0], rtol=1e-12)


def test_a_wire_that_is_not_there_has_no_inertia():
    endoscope = Endoscope.from_preset(PLAIN.replace(wires_per_plane=1))
    inertia = endoscope.model.ptr.tendon_armature[endoscope.layout.wire]
    assert (inertia[0] > 0).all()
    assert (inertia[1] == 0).all()
