"""MJCF model of an endoscope: the hand-written scene plus generated vertebrae, wires and sheath elements.

A joint `hinge_i` bends each vertebra. The pulley and the friction elements of the sheath (`sheath_a0`,
`sheath_a1`, ..., pulley to tip) slide. Between two of them a wire is a spring, a fixed tendon `wire_a0`,
`wire_a1`, ...; the last length of a wire runs along the vertebrae at a constant distance from their axis, so
that a hinge pays out or takes up wire by that moment arm times its angle. With two bending planes every
vertebra has a second, crossed hinge, and there is a second pulley for the wires c and d.

Springs are stiff and their masses light, so that a step of the velocities v by time must be implicit. With
damping of D + K h, for a spring K and the time step h, it is backward Euler:

    (M + h (D + K h)) (v' - v) = h (f - (D + K h) v + friction)

MuJoCo's implicit integrators add h (D + K h) to M after friction has been found for M alone: what should
stop at once then goes on sliding for many steps, as h^2 K is far above M. Here it is inertia of the joints
and tendons (`armature`), and friction is found for what is moved.
"""

import copy
import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco

from twin.episode import WIRE_PLACES, WIRES
from twin.files.assets import assets_folder
from twin.mechanics.drive import PULLEY_STIFFNESS
from twin.mechanics.friction import LEAST_FRICTION, hinge_groups, joint_friction
from twin.mechanics.wire import rest_stretch, segment_stiffness, sheath_floor, spring_law
from twin.physics.layout import NEIGHBOURS, PLANES, WAYS
from twin.preset.preset import Preset

_FAR = -1.0  # lower end of the dead band of a wire's spring [m]: never reached, so the wire never pushes
# Inertia over stiffness times the time step squared, of elements and of hinges. It delays what begins to
# move, by its share of the tension that the command adds in a step. Less finds friction in more iterations,
# and with a fifth of it, endoscopes diverge. A wire's own mass would need steps of microseconds.
_LIGHTNESS, _HINGE_LIGHTNESS = 0.1, 0.12
_PULLEY_MASS = 0.1  # [kg]
_TOLERANCE = 1e-17  # of the search for friction: MJCF that MuJoCo writes has no number below 1e-12 but 0
_MOST_JOINTS = 6  # that MuJoCo takes on one body


class Implicit(NamedTuple):
    """Inertia and damping that make springs implicit at a time step; wires have theirs in `load.py`."""

    pulley_damping: float  # [N s / m]
    pulley_inertia: float  # [kg]
    element_inertia: float  # [kg]
    hinge_damping: float  # [N m s / rad]
    hinge_inertia: float  # [kg m^2]


def implicit(preset: Preset, time_step: float) -> Implicit:
    """Return inertia and damping at a time step [s]."""
    pulley_damping = 2 * math.sqrt(PULLEY_STIFFNESS * _PULLEY_MASS) + time_step * PULLEY_STIFFNESS  # critical
    segment = segment_stiffness(preset)
    hinge_damping = preset.vertebrae * (preset.section_damping + time_step * preset.section_stiffness)
    bending = preset.section_stiffness + 2 * segment * preset.wire_offset**2
    return Implicit(
        pulley_damping,
        _PULLEY_MASS + time_step * pulley_damping,
        _LIGHTNESS * segment * time_step**2,
        hinge_damping,
        _HINGE_LIGHTNESS * bending * time_step**2 * preset.vertebrae + time_step * hinge_damping,
    )


def constraint_time(time_step: float) -> float:
    """Return the time constant of the constraints of friction [s], the shortest that MuJoCo takes."""
    return 2 * time_step


@functools.lru_cache(maxsize=64)  # one preset is often simulated many times
def model_xml(preset: Preset) -> str:
    """Return the complete model as MJCF text."""
    spec = mujoco.MjSpec.from_file(str(assets_folder() / "endoscope.xml"))
    spec.option.timestep = preset.time_step
    spec.option.gravity = preset.gravity
    spec.worldbody.add_geom(
        name="sheath",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=[-preset.sheath_length, 0, 0, 0, 0, 0],
        size=[1.35 * preset.wire_offset, 0, 0],
        material="sheath",
    )
    tip = _add_bending_section(spec, preset)
    _add_slides(tip, preset)
    for plane in PLANES[: preset.bending_planes]:
        _add_motor(spec, preset, plane)
    _add_friction(spec, preset)
    for wire in WIRES[: preset.wires]:
        _add_wire(spec, preset, wire)
    spec.compile()
    xml: str = spec.to_xml()
    return xml


def compiled_model(xml: str, *, drawn: bool) -> mujoco.MjModel:
    """Compile a model, with or without its shapes, lights and cameras.

    Without those, which MuJoCo would place in every step, it moves bit for bit as the whole one, as nothing
    of them has mass or touches anything.
    """
    return copy.copy(_compiled(xml, drawn))


@functools.lru_cache(maxsize=64)  # a copy takes a hundredth of the time
def _compiled(xml: str, drawn: bool) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(xml)
    for unseen in () if drawn else (*spec.geoms, *spec.lights, *spec.cameras):
        spec.delete(unseen)
    model: mujoco.MjModel = spec.compile()
    model.opt.noslip_tolerance = _TOLERANCE
    return model


def _add_motor(spec: mujoco.MjSpec, preset: Preset, plane: str) -> None:
    """Add a position actuator to a pulley; servo and backlash come before it (`twin/mechanics/drive.py`).

    The integrating actuator ramps linearly between two distances and holds each as a stiff spring does: it
    yields by the difference of the tensions over its stiffness. The other one feeds the velocity forward, so
    that no error in position is needed to move.
    """
    damping = implicit(preset, preset.time_step).pulley_damping
    fixed, affine = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    for name, dynamics, gain, bias in (
        ("position", mujoco.mjtDyn.mjDYN_INTEGRATOR, PULLEY_STIFFNESS, [0, -PULLEY_STIFFNESS, 0]),
        ("velocity", mujoco.mjtDyn.mjDYN_NONE, damping, [0, 0, -damping]),
    ):
        spec.add_actuator(
            name=f"{plane}{name}",
            target=f"{plane}pulley",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            dyntype=dynamics,
            gaintype=fixed,
            gainprm=[gain] + [0] * 9,
            biastype=affine,
            biasprm=bias + [0] * 7,
        )


def _add_slides(tip: mujoco.MjsBody, preset: Preset) -> None:
    """Add pulleys and sheath elements as slide joints of invisible, weightless bodies.

    They are nested in the last vertebra, although nothing hangs there: inertia of a tendon couples joints of
    one kinematic tree only, each with those before it, and wires couple them all. A slide's inertia is its
    joint's armature, so the frame it is carried in does not matter. Each wire has a branch of its own below
    the pulleys, as no force couples the elements of two wires, and as few bodies as its slides fit on.
    """
    law = implicit(preset, preset.time_step)
    pulleys = _add_weightless(tip, "pulleys")
    for plane in PLANES[: preset.bending_planes]:
        pulleys.add_joint(
            name=f"{plane}pulley",
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[-1, 0, 0],
            armature=law.pulley_inertia,
        )
    for wire in WIRES[: preset.wires]:
        body = pulleys
        for element in range(preset.sheath_elements):
            if element % _MOST_JOINTS == 0:
                body = _add_weightless(body, f"wire_{wire}{element}")
            joint = body.add_joint(
                name=f"sheath_{wire}{element}",
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=[-1, 0, 0],
                armature=law.element_inertia,
            )
            if preset.bending_planes == 1:
                joint.frictionloss = _least_sheath_friction(preset)
                _make_friction_dry(joint, preset)


def _add_weightless(parent: mujoco.MjsBody, name: str) -> mujoco.MjsBody:
    body = parent.add_body(name=name)
    body.mass, body.ipos, body.inertia, body.explicitinertial = 1e-9, [0, 0, 0], [1e-12] * 3, True
    return body


def _add_bending_section(spec: mujoco.MjSpec, preset: Preset) -> mujoco.MjsBody:
    link = preset.section_length / preset.vertebrae
    body = spec.worldbody
    for index in range(preset.vertebrae):
        body = body.add_body(name=f"vertebra_{index}", pos=[0 if index == 0 else link, 0, 0])
        axes = ([0, -1, 0], [0, 0, 1])
        for plane, axis, curve in zip(PLANES, axes, preset.initial_bends, strict=False):
            _add_hinge(body, preset, f"{plane}hinge_{index}", axis, curve)
        body.mass = preset.section_mass / preset.vertebrae
        body.ipos = [link / 2, 0, 0]
        slender = body.mass * (link**2 / 12 + preset.wire_offset**2 / 4)
        body.inertia = [body.mass * preset.wire_offset**2 / 2, slender, slender]
        body.explicitinertial = True
        _draw_link(body, link, preset)
    body.add_site(name="tip", pos=[link, 0, 0])
    _draw(body, "CYLINDER", 0.75 * link, 1.05 * link, 1.3 * preset.wire_offset, "tip")
    _draw(body, "CYLINDER", 1.05 * link, 1.06 * link, 0.6 * preset.wire_offset, "lens")
    return body


def _add_hinge(body: mujoco.MjsBody, preset: Preset, name: str, axis: list[int], curve: float) -> None:
    count = preset.vertebrae
    stiffness = preset.section_stiffness * count
    law = implicit(preset, preset.time_step)
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=axis,
        stiffness=[stiffness, 0, stiffness * preset.section_stiffening * count**2],
        springref=curve / count,
        damping=[law.hinge_damping, 0, 0],
        armature=law.hinge_inertia,
    )


def _add_wire(spec: mujoco.MjSpec, preset: Preset, wire: str) -> None:
    """Add the segments of one wire as springs in series, stretched by the tension left by winding up."""
    place = WIRES.index(wire)
    plane, side = PLANES[place // 2], 1.0 - 2.0 * (place % 2)
    stiffness, quadratic, width = spring_law(preset)
    damping = preset.wire_damping * (preset.sheath_elements + 1) + preset.time_step * stiffness
    for length, stretch in enumerate(rest_stretch(preset, antagonist=side < 0)):
        tendon = spec.add_tendon(
            name=f"wire_{wire}{length}",
            stiffness=[stiffness, 0.0 if width else quadratic, 0],
            damping=[damping, 0, 0],
            armature=preset.time_step * damping,
            springlength=[_FAR, -float(stretch)],
        )
        if length == 0:
            tendon.wrap_joint(f"{plane}pulley", side)
        else:
            tendon.wrap_joint(f"sheath_{wire}{length - 1}", 1.0)
        if length < preset.sheath_elements:
            tendon.wrap_joint(f"sheath_{wire}{length}", -1.0)
        else:
            for index in range(preset.vertebrae):
                tendon.wrap_joint(f"{plane}hinge_{index}", -side * preset.wire_offset)


def _least_sheath_friction(preset: Preset) -> float:
    """Return the friction of a sheath element without tension [N]."""
    return max(sheath_floor(preset) / preset.sheath_elements, LEAST_FRICTION)


def _add_friction(spec: mujoco.MjSpec, preset: Preset) -> None:
    """Add the dry friction of the hinges, and with two planes, which rub as one, that of the sheath.

    A fixed tendon over a group of hinges opposes their common motion by the same torque in each of them. They
    act in series and carry nearly the same moment, so that they move together; a constraint for every hinge
    would make the cost grow with the square of their number. Neighbours in two planes have two constraints
    on combinations of their motions, along the force that friction holds and across it. The combinations are
    rewritten with that force (`shared_friction.py`); here stands any that holds both.
    """
    groups = list(zip(hinge_groups(preset.vertebrae), joint_friction(preset), strict=True))
    if preset.bending_planes == 1:
        for number, (group, friction) in enumerate(groups):
            hinges = dict.fromkeys((f"hinge_{index}" for index in group), 1.0)
            _add_rubbing(spec, preset, f"joints_{number}", friction, hinges)
        return
    least, half = _least_sheath_friction(preset), 0.5**0.5
    for way, side in zip(WAYS, (half, -half), strict=True):
        for first, second in NEIGHBOURS:
            for element in range(preset.sheath_elements):
                joints = {f"sheath_{first}{element}": half, f"sheath_{second}{element}": side}
                _add_rubbing(spec, preset, f"{way}_{first}{second}{element}", least, joints)
        for number, (group, friction) in enumerate(groups):
            planes = zip(PLANES, (half, side), strict=True)
            hinges = {f"{plane}hinge_{index}": sign for plane, sign in planes for index in group}
            _add_rubbing(spec, preset, f"{way}_joints_{number}", max(friction, LEAST_FRICTION), hinges)


def _add_rubbing(
    spec: mujoco.MjSpec, preset: Preset, name: str, friction: float, joints: dict[str, float]
) -> None:
    tendon = spec.add_tendon(name=name, frictionloss=friction)
    _make_friction_dry(tendon, preset)
    for joint, coefficient in joints.items():
        tendon.wrap_joint(joint, coefficient)


def _draw_link(body: mujoco.MjsBody, link: float, preset: Preset) -> None:
    radius = preset.wire_offset
    _draw(body, "CAPSULE", 0, link, 0.45 * radius, "backbone")
    _draw(body, "CYLINDER", 0.28 * link, 0.72 * link, 1.05 * radius, "vertebra")
    for wire in WIRES[: preset.wires]:
        place = [share * radius for share in WIRE_PLACES[wire]]
        _draw(body, "CAPSULE", 0, link, 0.2 * radius, f"wire_{wire}", place)


def _draw(
    body: mujoco.MjsBody,
    shape: str,
    start: float,
    end: float,
    radius: float,
    material: str,
    place: Sequence[float] = (0, 0),
) -> None:
    """Add a purely visual shape along x: no mass, no contact."""
    kind, ends = getattr(mujoco.mjtGeom, f"mjGEOM_{shape}"), [start, *place, end, *place]
    body.add_geom(type=kind, fromto=ends, size=[radius, 0, 0], material=material, mass=0)


def _make_friction_dry(rubbing: mujoco.MjsJoint | mujoco.MjsTendon, preset: Preset) -> None:
    """Set a near-rigid friction constraint: the defaults turn dry friction into viscous drag."""
    rubbing.solimp_friction = [0.9999, 0.9999, 0.001, 0.5, 2]
    rubbing.solref_friction = [constraint_time(preset.time_step), 1]
