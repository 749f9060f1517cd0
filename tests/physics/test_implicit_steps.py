"""Steps of MuJoCo's twin: implicit in springs and damping, and friction is found for what is moved."""

import mujoco
import numpy as np
import pytest
from plain_endoscope import PLAIN

from twin.mechanics.wire import quadratic_stiffness, segment_stiffness, tension_at
from twin.physics import Endoscope
from twin.physics.load import NEARLY_TAUT, SLACK_SHARE
from twin.physics.model import compiled_model, model_xml
from twin.preset.file import load_preset

PRESETS = [
    PLAIN.replace(wire_damping=2.0, section_damping=1e-4),
    PLAIN.replace(wire_stiffening=0.3, bending_planes=2),
    PLAIN.replace(vertebrae=12, sheath_elements=8, pretension=0.0, wire_slack=1e-4),
]


def inertia(model, data) -> np.ndarray:
    """Return MuJoCo's inertia of all joints, (nv, nv)."""
    mujoco.mj_fwdPosition(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return matrix


def damping(model, endoscope, of_wires) -> np.ndarray:
    """Return the damping of all joints, (nv, nv): of themselves, of the wires, of the motors."""
    matrix = np.diag(model.dof_damping)
    lengthening = endoscope.stepper.wires.lengthening
    matrix += lengthening.T @ np.diag(of_wires.ravel()) @ lengthening
    for plane, pulley in enumerate(endoscope.layout.pulley):
        matrix[pulley, pulley] -= model.actuator_biasprm[2 * plane + 1, 2]
    return matrix


@pytest.mark.parametrize("preset", PRESETS)
def test_inertia_holds_the_time_step_times_all_damping(preset):
    endoscope = Endoscope.from_preset(preset)
    for pull in [*np.linspace(0, 2e-3, 40), *[2e-3] * 20]:
        endoscope.advance(float(pull))
    model, data = endoscope.model.ptr, endoscope.data.ptr
    whole = inertia(model, data)
    slack = endoscope.wire_slack() > NEARLY_TAUT
    alone = preset.wire_damping * (preset.sheath_elements + 1) + preset.time_step * segment_stiffness(preset)
    of_wires = np.where(slack, SLACK_SHARE * alone, model.tendon_damping[endoscope.layout.wire])
    implicit = preset.time_step * damping(model, endoscope, of_wires)
    light = whole - implicit
    np.testing.assert_allclose(light, np.diag(np.diag(light)), atol=1e-4 * np.abs(implicit).max())
    assert (np.diag(light) > 0).all()
    elements = np.diag(light)[endoscope.layout.element]
    np.testing.assert_allclose(elements, elements[0, 0], rtol=1e-6)
    assert np.diag(implicit)[endoscope.layout.element].max() > 3 * elements[0, 0]  # it is stiff


def test_what_slid_is_held_within_a_period_where_the_pull_turns_back():
    """The stiffest wires at their highest tension: nothing creeps on between friction's two limits."""
    preset = load_preset("ureteroscope")
    endoscope = Endoscope.from_preset(preset)
    there = np.linspace(0, 4e-3, 200)
    for pull in there:
        endoscope.advance(float(pull))
    at = endoscope.layout.element[0]
    speed = np.abs(endoscope.data.ptr.qvel[at[0]])
    assert speed > 1e-3  # [m / s]
    endoscope.advance(float(there[-2]))
    assert np.abs(endoscope.data.ptr.qvel[at[1:]]).max() < 1e-3 * speed


def test_step_of_a_wire_alone_is_backward_euler():
    """An element without friction between its springs, against the equation of an implicit step."""
    preset = PLAIN.without_friction().replace(
        sheath_elements=1, wire_damping=5.0, section_stiffness=1e3, section_damping=0.0, control_period=2.5e-3
    )
    endoscope = Endoscope.from_preset(preset)
    model, data = endoscope.model.ptr, endoscope.data.ptr
    element, pulley = endoscope.layout.element[0, 0], endoscope.layout.pulley[0]
    start, step = 2e-5, preset.time_step
    data.qpos[element] = start
    of_wires = model.tendon_damping[endoscope.layout.wire]
    implicit = step * damping(model, endoscope, of_wires)
    light = (inertia(model, data) - implicit)[element, element]
    endoscope.advance(0.0)
    stiffness, own = segment_stiffness(preset), preset.wire_damping * (preset.sheath_elements + 1)
    rest = endoscope.stepper.wires.rest_stretch[0]
    moved = data.qpos[element] - start
    pulled = [
        tension_at(rest + np.array([-x, x]), stiffness, quadratic_stiffness(preset))
        for x in (start, start + moved)
    ]
    after = pulled[1][0] - pulled[1][1]
    assert abs(moved) > 0.3 * start
    assert abs(data.qpos[pulley]) < 1e-3 * start
    assert light * moved / step**2 == pytest.approx(after - 2 * own * moved / step, rel=5e-3)


def test_model_that_is_stepped_is_the_one_that_is_drawn():
    xml = model_xml(PLAIN)
    drawn, stepped = (compiled_model(xml, drawn=drawn) for drawn in (True, False))
    assert drawn.ngeom > stepped.ngeom == 0
    assert drawn.nv == stepped.nv
    for name in ("dof_armature", "tendon_armature", "tendon_stiffness", "body_mass"):
        np.testing.assert_array_equal(getattr(drawn, name), getattr(stepped, name))
    assert drawn.opt.noslip_tolerance == stepped.opt.noslip_tolerance > 0
