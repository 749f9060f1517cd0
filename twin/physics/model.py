"""The MJCF model of an endoscope: the hand-written scene, and what repeats along section and sheath.

One slide joint is the pulley. Each of the two wires runs from it through the sheath, where it is cut into
elements that slide with friction (joints `sheath_a0`, `sheath_a1`, ..., pulley to tip), and then through
the vertebrae, where it is a spatial tendon. Between two elements the wire is a spring that pulls but does not
push: MuJoCo's `springlength="low high"` has no force inside the interval.
"""

import mujoco

from twin.assets import assets_folder
from twin.preset import Preset

WIRES = ("a", "b")
_SIDE = {"a": 1.0, "b": -1.0}
_FAR = -1.0  # lower end of the dead band of a wire's spring [m]: never reached, so the wire never pushes
_RESOLUTION = 1.6  # largest angular frequency times the time step; explicit springs are stable below 2
_UNSEEN = 3  # group of geoms that MuJoCo does not draw, unless asked to: masses
_PULLEY_MASS = 1.0  # [kg]
_PULLEY_STIFFNESS = 4e5  # [N/m], far above that of a wire
_PULLEY_DAMPING = 2 * (_PULLEY_STIFFNESS * _PULLEY_MASS) ** 0.5  # critical


def model_xml(preset: Preset) -> str:
    """Return the whole model as MJCF text."""
    spec = mujoco.MjSpec.from_file(str(assets_folder() / "endoscope.xml"))
    spec.option.timestep = preset.time_step
    _add_pulley(spec)
    _add_sheath(spec, preset)
    _add_bending_section(spec, preset)
    for wire in WIRES:
        _add_wire(spec, preset, wire)
    spec.compile()
    return spec.to_xml()


def segment_stiffness(preset: Preset) -> float:
    """Stiffness of one length of wire between two elements [N / m]: all of them in series are the wire."""
    return preset.wire_stiffness * (preset.sheath_elements + 1)


def element_mass(preset: Preset) -> float:
    """Inertia of one sheath element [kg]: the least that resolves the fastest wave along the wire.

    A wire's own mass would need steps of microseconds. The motion is quasi-static, so a larger inertia
    changes nothing that is measured. A chain of masses and springs has frequencies up to sqrt(4 k / m).
    """
    return 4 * segment_stiffness(preset) * (preset.time_step / _RESOLUTION) ** 2


def section_inertia(preset: Preset) -> float:
    """Inertia added against bending of the whole section [kg m^2]: as `element_mass`, stiffest mode."""
    stiffness = preset.section_stiffness + 2 * segment_stiffness(preset) * preset.wire_offset**2
    return stiffness * (preset.time_step / _RESOLUTION) ** 2


def _add_pulley(spec: mujoco.MjSpec) -> None:
    """One slide that pulls wire a and pays out wire b, driven by a servo without lag.

    The integrating actuator ramps linearly between two commanded distances and holds each as a stiff spring
    does: it yields by the difference of the tensions over its stiffness. The other one feeds the commanded
    velocity forward, so that no error in position is needed to move.
    """
    body = spec.worldbody.add_body(name="pulley")
    body.add_joint(name="pulley", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[-1, 0, 0], armature=_PULLEY_MASS)
    _add_point_mass(body)
    spec.add_actuator(
        name="pulley_position",
        target="pulley",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        dyntype=mujoco.mjtDyn.mjDYN_INTEGRATOR,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=[_PULLEY_STIFFNESS] + [0] * 9,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        biasprm=[0, -_PULLEY_STIFFNESS] + [0] * 8,
    )
    spec.add_actuator(
        name="pulley_velocity",
        target="pulley",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=[_PULLEY_DAMPING] + [0] * 9,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        biasprm=[0, 0, -_PULLEY_DAMPING] + [0] * 7,
    )


def _add_sheath(spec: mujoco.MjSpec, preset: Preset) -> None:
    """The friction elements: masses that slide along the shaft; their friction follows the tension."""
    radius = 1.35 * preset.wire_offset
    spec.worldbody.add_geom(
        name="sheath",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=[-preset.sheath_length, 0, 0, 0, 0, 0],
        size=[radius, 0, 0],
        material="sheath",
    )
    for wire in WIRES:
        for element in range(preset.sheath_elements):
            body = spec.worldbody.add_body(
                name=f"sheath_{wire}{element}",
                pos=[_element_position(preset, element), 0, _SIDE[wire] * preset.wire_offset],
            )
            joint = body.add_joint(
                name=f"sheath_{wire}{element}",
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=[-1, 0, 0],
                armature=element_mass(preset),
                frictionloss=max(preset.sheath_friction_floor / preset.sheath_elements, _LEAST_FRICTION),
            )
            _make_friction_dry(joint, preset)
            _add_point_mass(body)
            body.add_site(name=f"sheath_{wire}{element}")


def _add_bending_section(spec: mujoco.MjSpec, preset: Preset) -> None:
    """A chain of links on hinges, with a hole for each wire in the middle of each link."""
    count = preset.vertebrae
    link = preset.section_length / count
    for wire in WIRES:
        spec.worldbody.add_site(name=f"base_{wire}", pos=[0, 0, _SIDE[wire] * preset.wire_offset])
    body = spec.worldbody
    for index in range(count):
        body = body.add_body(name=f"vertebra_{index}", pos=[0 if index == 0 else link, 0, 0])
        joint = body.add_joint(
            name=f"hinge_{index}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, -1, 0],
            stiffness=preset.section_stiffness * count,
            damping=preset.section_damping * count,
            armature=section_inertia(preset) * count,
            frictionloss=preset.joint_friction,
        )
        _make_friction_dry(joint, preset)
        body.add_geom(
            name=f"vertebra_{index}",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            fromto=[0.1 * link, 0, 0, link if index == count - 1 else 0.9 * link, 0, 0],
            size=[1.25 * preset.wire_offset, 0, 0],
            mass=_SECTION_MASS / count,
            group=_UNSEEN,
        )
        _add_bones(body, link, preset.wire_offset)
        for wire in WIRES:
            body.add_site(name=f"hole_{wire}{index}", pos=[link / 2, 0, _SIDE[wire] * preset.wire_offset])
    body.add_site(name="tip", pos=[link, 0, 0])
    _add_drawn(
        body, mujoco.mjtGeom.mjGEOM_CYLINDER, 0.75 * link, 1.05 * link, 1.3 * preset.wire_offset, "tip"
    )
    _add_drawn(
        body, mujoco.mjtGeom.mjGEOM_CYLINDER, 1.05 * link, 1.06 * link, 0.6 * preset.wire_offset, "lens"
    )


def _add_bones(body: mujoco.MjsBody, link: float, wire_offset: float) -> None:
    """Draw the inside of one link: a disc that guides the wires, on a slender backbone."""
    _add_drawn(body, mujoco.mjtGeom.mjGEOM_CAPSULE, 0, link, 0.45 * wire_offset, "backbone")
    _add_drawn(body, mujoco.mjtGeom.mjGEOM_CYLINDER, 0.28 * link, 0.72 * link, 1.05 * wire_offset, "vertebra")


def _add_drawn(
    body: mujoco.MjsBody, shape: mujoco.mjtGeom, start: float, end: float, radius: float, material: str
) -> None:
    """Add a shape along x that is only seen: it has no mass and touches nothing."""
    body.add_geom(type=shape, fromto=[start, 0, 0, end, 0, 0], size=[radius, 0, 0], material=material, mass=0)


def _add_wire(spec: mujoco.MjSpec, preset: Preset, wire: str) -> None:
    """The lengths of one wire, as springs in series, stretched so far that they carry the pretension."""
    stiffness = segment_stiffness(preset)
    damping = preset.wire_damping * (preset.sheath_elements + 1)
    stretch = preset.pretension / stiffness
    for element in range(preset.sheath_elements):
        tendon = spec.add_tendon(
            name=f"wire_{wire}{element}",
            stiffness=stiffness,
            damping=damping,
            springlength=[_FAR, -stretch],
        )
        if element == 0:
            tendon.wrap_joint("pulley", _SIDE[wire])
        else:
            tendon.wrap_joint(f"sheath_{wire}{element - 1}", 1.0)
        tendon.wrap_joint(f"sheath_{wire}{element}", -1.0)

    last = preset.sheath_elements - 1
    straight = preset.section_length * (1 - 0.5 / preset.vertebrae) - _element_position(preset, last)
    tendon = spec.add_tendon(
        name=f"wire_{wire}{preset.sheath_elements}",
        stiffness=stiffness,
        damping=damping,
        springlength=[0, straight - stretch],
        width=0.2 * preset.wire_offset,
        material=f"wire_{wire}",
    )
    tendon.wrap_site(f"sheath_{wire}{last}")
    tendon.wrap_site(f"base_{wire}")
    for index in range(preset.vertebrae):
        tendon.wrap_site(f"hole_{wire}{index}")


_SECTION_MASS = 2e-4  # [kg] a few vertebrae of steel; weightless here, and its inertia is below the added one
_LEAST_FRICTION = (
    1e-9  # [N] keeps the constraint in the model where the friction of the sheath is set to zero
)


def _element_position(preset: Preset, element: int) -> float:
    """Where an element of the sheath lies along x [m], pulley to tip; the last is near the vertebrae."""
    return -preset.sheath_length * (preset.sheath_elements - element - 0.5) / preset.sheath_elements


def _make_friction_dry(joint: mujoco.MjsJoint, preset: Preset) -> None:
    """Set a near-rigid friction constraint: the defaults turn dry friction into viscous drag."""
    joint.solimp_friction = [0.9999, 0.9999, 0.001, 0.5, 2]
    joint.solref_friction = [2 * preset.time_step, 1]


def _add_point_mass(body: mujoco.MjsBody) -> None:
    """Give a body that only slides the mass that MuJoCo demands; its inertia is the joint's armature."""
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-3, 0, 0], mass=1e-3, rgba=[0, 0, 0, 0])
