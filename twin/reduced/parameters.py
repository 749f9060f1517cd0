"""Parameters of reduced twins as plain arrays for the kernels, the endoscope along the leading axis."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.mechanics.batch import check_alike
from twin.mechanics.drive import drive_law, is_rigid
from twin.mechanics.friction import LEAST_FRICTION
from twin.mechanics.hinges import hinge_groups, joint_friction
from twin.mechanics.wire import quadratic_stiffness, segment_stiffness, stretch_at, wound_tension
from twin.preset.preset import Preset

Array = NDArray[np.float64]


class Parameters(NamedTuple):
    """M endoscopes with E elements in the sheath of a wire and G groups of hinges in a plane.

    Attributes:
        rest: (M, 2 E + 2) stretch of the segments where all positions are zero, wire a to b [m].
        wire_stiffness: (M,) of a segment [N / m].
        wire_quadratic: (M,) its growth [N / m^2].
        wire_damping: (M,) of a segment [N s / m].
        sheath_friction: (M,) coefficient of one element [-].
        bend_offset: (M,) wrap angle of a straight sheath [rad].
        floor: (M,) friction of one element without tension [N].
        warm_up: (M,) excess of the friction at the start [-].
        warm_up_time: (M,) its time constant [s].
        wear: (M,) growth of the friction with the travel [1 / m].
        hinge_stiffness: (M,) of one hinge [N m / rad].
        hinge_cubic: (M,) its growth [N m / rad^3].
        hinge_rest: (M, planes) angle of a hinge that nothing pulls [rad].
        hinge_damping: (M,) of one hinge [N m s / rad].
        joint_friction: (M, G) of a hinge of each group [N m].
        size: (G,) number of hinges of each group.
        arm: (M,) moment arm of the wires [m].
        routing: (M,) friction coefficient of wires on vertebrae [-].
        drive: (M, 6) constants of `DriveLaw`.
        rigid: (M,) whether the pulley follows the command exactly.
        control_period: between two updates of the drive [s].
    """

    rest: Array
    wire_stiffness: Array
    wire_quadratic: Array
    wire_damping: Array
    sheath_friction: Array
    bend_offset: Array
    floor: Array
    warm_up: Array
    warm_up_time: Array
    wear: Array
    hinge_stiffness: Array
    hinge_cubic: Array
    hinge_rest: Array
    hinge_damping: Array
    joint_friction: Array
    size: Array
    arm: Array
    routing: Array
    drive: Array
    rigid: NDArray[np.bool_]
    control_period: float


def parameters_of(presets: Sequence[Preset]) -> Parameters:
    """Gather the parameters of endoscopes.

    Raises:
        ValueError: there is none, they differ in layout, or gravity pulls at one.
    """
    check_alike(presets)
    for preset in presets:
        refuse_gravity(preset)
    unique = list(dict.fromkeys(presets))
    place = {preset: index for index, preset in enumerate(unique)}
    order = np.array([place[preset] for preset in presets])
    laws = [drive_law(preset) for preset in unique]

    def each(value: Callable[[Preset], ArrayLike]) -> Array:
        """Return a number, or numbers, of every endoscope."""
        rows: Array = np.array([value(preset) for preset in unique], dtype=float)[order]
        return rows

    return Parameters(
        rest=each(_rest_stretch),
        wire_stiffness=each(segment_stiffness),
        wire_quadratic=each(quadratic_stiffness),
        wire_damping=each(lambda p: p.wire_damping * (p.sheath_elements + 1)),
        sheath_friction=each(lambda p: p.sheath_friction / p.sheath_elements),
        bend_offset=each(lambda p: p.sheath_bend_offset),
        floor=each(lambda p: max(p.sheath_friction_floor / p.sheath_elements, LEAST_FRICTION)),
        warm_up=each(lambda p: p.friction_warm_up),
        warm_up_time=each(lambda p: p.warm_up_time),
        wear=each(lambda p: p.friction_wear),
        hinge_stiffness=each(lambda p: p.section_stiffness * p.vertebrae),
        hinge_cubic=each(lambda p: p.section_stiffness * p.section_stiffening * p.vertebrae**3),
        hinge_rest=each(lambda p: [p.initial_bend / p.vertebrae, 0.0][: p.bending_planes]),
        hinge_damping=each(lambda p: p.section_damping * p.vertebrae),
        joint_friction=each(joint_friction),
        size=np.array([len(group) for group in hinge_groups(presets[0].vertebrae)], dtype=float),
        arm=each(lambda p: p.wire_offset),
        routing=each(lambda p: p.routing_friction),
        drive=np.array(laws, dtype=float)[order],
        rigid=np.array([is_rigid(law) for law in laws])[order],
        control_period=presets[0].control_period,
    )


def refuse_gravity(preset: Preset) -> None:
    """Refuse an endoscope that gravity pulls at.

    Raises:
        ValueError: a component of its gravity is not zero.
    """
    for name in ("gravity_x", "gravity_y", "gravity_z"):
        if getattr(preset, name):
            value = getattr(preset, name)
            raise InputError(f"{name} = {value:g}: the reduced twin has no gravity, choose that in MuJoCo")


def _rest_stretch(preset: Preset) -> Array:
    """Return the stretch that winding up leaves in each segment, along the whole chain, (2 E + 2,) [m]."""
    stretch = stretch_at(wound_tension(preset), segment_stiffness(preset), quadratic_stiffness(preset))
    return np.concatenate([stretch, stretch[::-1]])
