"""The kernel of the control period against the laws of wires and friction, compiled and interpreted."""

import numpy as np
import pytest
from plain_endoscope import PLAIN

from twin.mechanics.friction import element_friction, friction_per_tension
from twin.mechanics.kernels import COMPILED
from twin.physics import Endoscope
from twin.physics import load as load_module
from twin.physics.load import SLACK_SHARE, Loads, Rewritten, Wires, follow_load

STIFFENING = PLAIN.replace(wire_stiffening=0.2, wire_damping=2.0, bending_planes=2)
PRESETS = [STIFFENING, STIFFENING.replace(wire_stiffness=2e4, sheath_friction=0.05, pretension=9.0)]
ELEMENTS = STIFFENING.sheath_elements


@pytest.fixture(params=["compiled", "interpreted"])
def rewritten(request, monkeypatch):
    """Positions, velocities, and what the load of two endoscopes makes of them; some wires are slack."""
    if request.param == "interpreted":
        if not COMPILED:
            pytest.skip("nothing is compiled here")
        monkeypatch.setattr(load_module, "follow_load", follow_load.py_func)
    layout = Endoscope.from_preset(PRESETS[0]).layout
    rng = np.random.default_rng(0)
    count = layout.hinge.size + layout.pulley.size + layout.element.size
    qpos, qvel = 1e-3 * rng.normal(size=(2, count)), 0.3 * rng.normal(size=(2, count))
    groups = layout.shared.shape[1] - layout.element.size // 2
    out = Rewritten(
        np.zeros((2, *layout.element.shape)),
        np.zeros((2, 2, groups)),
        np.zeros((2, *layout.wire.shape)),
        np.zeros((2, *layout.wire.shape)),
        np.zeros((2, *layout.shared.shape)),
        np.zeros((2, *layout.wrap.shape)),
    )
    Loads(PRESETS, layout, out, qpos, qvel).follow(np.array([1.0, 2.0]), None, np.arange(2))
    return Wires(PRESETS, layout), qpos, qvel, out


def test_friction_of_the_sheath_is_that_of_the_tension(rewritten):
    wires, qpos, _, out = rewritten
    tension, slack = wires.tension_and_slack(qpos)
    assert (slack > 0).any()
    for index, (preset, bend) in enumerate(zip(PRESETS, (1.0, 2.0), strict=True)):
        share = friction_per_tension(preset.sheath_friction, bend + preset.sheath_bend_offset, ELEMENTS)
        expected = element_friction(tension[index], share, preset.sheath_friction_floor / ELEMENTS)
        np.testing.assert_allclose(out.sheath[index], expected, rtol=1e-12)


def test_damping_makes_the_springs_implicit_where_they_are_or_will_be_taut(rewritten):
    wires, qpos, qvel, out = rewritten
    tension, slack = wires.tension_and_slack(qpos)
    stiffness = np.sqrt(wires.stiffness**2 + 4 * wires.quadratic * tension)  # dT/dx
    own = STIFFENING.wire_damping * (ELEMENTS + 1)
    stays_slack = wires.tension_and_slack(qpos + 2 * STIFFENING.control_period * qvel)[1] > 0
    expected = np.where((slack > 0) & stays_slack, 0.0, own + STIFFENING.time_step * stiffness)
    assert 0 < (expected == 0).sum() < expected.size
    assert ((slack > 0) & ~stays_slack).any()
    np.testing.assert_allclose(out.damping, expected, rtol=1e-12)


def test_inertia_is_that_of_the_stiffness_to_come_and_half_of_it_where_a_wire_stays_slack(rewritten):
    wires, qpos, qvel, out = rewritten
    ahead = qpos + 2 * STIFFENING.control_period * qvel
    (tension, slack), (later, slack_later) = (wires.tension_and_slack(at) for at in (qpos, ahead))
    stiffness = np.sqrt(wires.stiffness**2 + 4 * wires.quadratic * np.maximum(tension, later))  # dT/dx
    own = STIFFENING.wire_damping * (ELEMENTS + 1)
    share = np.where((slack > 0) & (slack_later > 0), SLACK_SHARE, 1.0)
    expected = share * STIFFENING.time_step * (own + STIFFENING.time_step * stiffness)
    np.testing.assert_allclose(out.inertia, expected, rtol=1e-12)


def test_a_wire_that_is_not_there_has_no_inertia():
    endoscope = Endoscope.from_preset(PLAIN.replace(wires_per_plane=1))
    inertia = endoscope.model.ptr.tendon_armature[endoscope.layout.wire]
    assert (inertia[0] > 0).all()
    assert (inertia[1] == 0).all()
