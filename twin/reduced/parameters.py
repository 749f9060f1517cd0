"""Parameters of reduced twins as plain arrays for the kernels, the endoscope along the leading axis."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.mechanics.batch import check_alike
from twin.mechanics.drive import commands_kept, drive_law, is_rigid
from twin.mechanics.friction import LEAST_FRICTION
from twin.mechanics.hinges import hinge_groups, joint_friction
from twin.mechanics.wire import quadratic_stiffness, rest_stretch, segment_stiffness
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
        floor: (M,) friction of one element without tension, in a straight sheath [N].
        growth: (M,) what one radian of its bend adds [N].
        exponent: (M,) of that growth [-].
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
        holds: (M,) friction of the sheath at rest over that of sliding [-].
        drive: (M, 7) constants of `DriveLaw`.
        zero: (M, planes) command at which the endoscope is neutral [m].
        late: most commands that a delay makes any of them keep.
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
    growth: Array
    exponent: Array
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
    holds: Array
    drive: Array
    zero: Array
    late: int
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
        rest=each(_chain_at_rest),
        wire_stiffness=each(segment_stiffness),
        wire_quadratic=each(quadratic_stiffness),
        wire_damping=each(lambda p: p.wire_damping * (p.sheath_elements + 1)),
        sheath_friction=each(lambda p: p.sheath_friction / p.sheath_elements),
        bend_offset=each(lambda p: p.sheath_bend_offset),
        floor=each(lambda p: max(p.sheath_friction_floor / p.sheath_elements, LEAST_FRICTION)),
        growth=each(lambda p: p.sheath_friction_growth / p.sheath_elements),
        exponent=each(lambda p: p.sheath_friction_exponent),
        warm_up=each(lambda p: p.friction_warm_up),
        warm_up_time=each(lambda p: p.warm_up_time),
        wear=each(lambda p: p.friction_wear),
        hinge_stiffness=each(lambda p: p.section_stiffness * p.vertebrae),
        hinge_cubic=each(lambda p: p.section_stiffness * p.section_stiffening * p.vertebrae**3),
        hinge_rest=each(lambda p: [bend / p.vertebrae for bend in p.initial_bends]),
        hinge_damping=each(lambda p: p.section_damping * p.vertebrae),
        joint_friction=each(joint_friction),
        size=np.array([len(group) for group in hinge_groups(presets[0].vertebrae)], dtype=float),
        arm=each(lambda p: p.wire_offset),
        routing=each(lambda p: p.routing_friction),
        holds=each(lambda p: 1.0 + p.stiction),
        drive=np.array(laws, dtype=float)[order],
        zero=each(lambda p: p.command_zeros),
        late=max(map(commands_kept, laws)),
        rigid=np.array(
            [is_rigid(law) and not any(p.command_zeros) for law, p in zip(laws, unique, strict=True)]
        )[order],
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


def _chain_at_rest(preset: Preset) -> Array:
    """Return the stretch of the segments of both wires, along the whole chain, (2 E + 2,) [m]."""
    return np.concatenate([rest_stretch(preset, False), rest_stretch(preset, True)[::-1]])
