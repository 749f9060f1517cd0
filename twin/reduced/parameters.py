"""Parameters and state of reduced twins: plain arrays for the kernels, endoscopes along the leading axis."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import DivergedError, InputError
from twin.mechanics.command import check_alike
from twin.mechanics.drive import DriveLaw, drive_law, is_rigid
from twin.mechanics.friction import (
    LEAST_FRICTION,
    element_friction,
    friction_floor,
    friction_per_tension,
    hinge_groups,
    joint_friction,
)
from twin.mechanics.wire import rest_stretch, spring_law, tension_at
from twin.preset.preset import Preset

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

MISSING_LIMIT_N = 1e-6  # force that may be missing from equilibrium [N]; with more an endoscope has failed

# Columns of `Parameters.constants`: of a segment of wire [N / m], its growth [N / m^2], damping [N s / m];
WIRE_STIFFNESS, WIRE_QUADRATIC, WIRE_DAMPING = range(3)
# coefficient of an element [-], wrap angle of a straight sheath [rad], friction of an element without tension
# in that [N], what one radian of its bend adds [N], exponent [-], friction at rest over that of sliding [-];
SHEATH_FRICTION, BEND_OFFSET, FLOOR, GROWTH, EXPONENT, HOLDS = range(3, 9)
# excess of the friction at the start [-], its time constant [s], growth with the travel [1 / m];
WARM_UP, WARM_UP_TIME, WEAR = range(9, 12)
# stiffness of one hinge [N m / rad], its growth [N m / rad^3], damping [N m s / rad], moment arm of the wires
# [m], friction coefficient of wires on vertebrae [-].
HINGE_STIFFNESS, HINGE_CUBIC, HINGE_DAMPING, ARM, ROUTING = range(12, 17)
WIRE_TOE = 17  # width of the toe of a segment of wire [m]
RIGID = 18  # 1 where the pulley follows the command exactly
DRIVE = 19  # first of the constants of `DriveLaw`
ZERO = DRIVE + len(DriveLaw._fields)  # first of two commands at which the endoscope is neutral [m]
HINGE_REST = ZERO + 2  # first of two angles of a hinge that nothing pulls [rad]
TIME, TRAVEL, MISSING_FORCE, COMMAND = range(
    4
)  # columns of `ReducedState.run`; the last is the first of three


class Parameters(NamedTuple):
    """M endoscopes with E elements in the sheath of a wire and G groups of hinges in a plane."""

    constants: Array  # (M, 31) by the columns above
    rest: Array  # (M, 2 E + 2) stretch of the segments where all positions are zero, wire a to b [m]
    joint_friction: Array  # (M, G) of a hinge of each group [N m]
    size: Array  # (G,) number of hinges of each group
    planes: int
    late: int  # most commands that a delay makes any of them keep
    control_period: float  # between two updates of the drive [s]

    def only(self, m: int) -> "Parameters":
        """Return the parameters of one endoscope."""
        one = slice(m, m + 1)
        return self._replace(
            constants=self.constants[one], rest=self.rest[one], joint_friction=self.joint_friction[one]
        )


class ReducedState(NamedTuple):
    """State of M endoscopes with P planes, E elements in the sheath of a wire and G groups of hinges."""

    element: Array  # (M, P, 2 E) positions of the sheath elements, towards the end of the chain [m]
    hinge: Array  # (M, P, G) angle of a hinge of each group [rad]
    slip: Signs  # (M, P, 2 E) direction in which each element slid in the last increment: -1, 0 or 1
    turn: Signs  # (M, P, G) the same of each group
    pulley: Array  # (M, P) position of the pulley [m]
    drive: Array  # (M, P, 4) motor, its last stride, the gear after it and the command [m]
    past: Array  # (M, P, L) commands of the last control periods that a delay keeps, the last one first [m]
    run: Array  # (M, 6) by the columns above: the four properties below
    layout: NDArray[np.int64]  # (3,) numbers of planes, elements and vertebrae

    @property
    def time(self) -> Array:
        """(M,) since the start of the run [s]."""
        return self.run[:, TIME]

    @property
    def travel(self) -> Array:
        """(M,) that the pulleys have travelled [m]."""
        return self.run[:, TRAVEL]

    @property
    def missing(self) -> Array:
        """(M,) largest force that was missing from equilibrium since the state was made [N]."""
        return self.run[:, MISSING_FORCE]

    @property
    def command(self) -> Array:
        """(M, 3) pull [m], lateral pull [m] and bend of the sheath [rad]."""
        return self.run[:, COMMAND:]


def parameters_of(presets: Sequence[Preset]) -> Parameters:
    """Gather the parameters of endoscopes; they must agree in their layout, and have no gravity."""
    check_alike(presets)
    for preset in presets:
        refuse_gravity(preset)
    unique = list(dict.fromkeys(presets))
    place = {preset: index for index, preset in enumerate(unique)}
    order = np.array([place[preset] for preset in presets])

    def each(value: Callable[[Preset], ArrayLike]) -> Array:
        rows: Array = np.array([value(preset) for preset in unique], dtype=float)[order]
        return rows

    return Parameters(
        constants=each(_constants),
        rest=each(_chain_at_rest),
        joint_friction=each(joint_friction),
        size=np.array([len(group) for group in hinge_groups(presets[0].vertebrae)], dtype=float),
        planes=presets[0].bending_planes,
        late=max(math.ceil(drive_law(preset).delay) for preset in unique),
        control_period=presets[0].control_period,
    )


def _constants(p: Preset) -> list[float]:
    """Return a row of `Parameters.constants`."""
    stiffness, quadratic, width = spring_law(p)
    law, second = drive_law(p), [0.0] * (2 - p.bending_planes)
    return [
        stiffness,
        quadratic,
        p.wire_damping * (p.sheath_elements + 1),
        p.sheath_friction / p.sheath_elements,
        p.sheath_bend_offset,
        max(p.sheath_friction_floor / p.sheath_elements, LEAST_FRICTION),
        p.sheath_friction_growth / p.sheath_elements,
        p.sheath_friction_exponent,
        1.0 + p.stiction,
        p.friction_warm_up,
        p.warm_up_time,
        p.friction_wear,
        p.section_stiffness * p.vertebrae,
        p.section_stiffness * p.section_stiffening * p.vertebrae**3,
        p.section_damping * p.vertebrae,
        p.wire_offset,
        p.routing_friction,
        width,
        float(is_rigid(law) and not any(p.command_zeros)),
        *map(float, law),
        *p.command_zeros,
        *second,
        *(bend / p.vertebrae for bend in p.initial_bends),
        *second,
    ]


def _chain_at_rest(preset: Preset) -> Array:
    """Return the stretch of the segments of both wires, along the complete chain, (2 E + 2,) [m]."""
    return np.concatenate([rest_stretch(preset, False), rest_stretch(preset, True)[::-1]])


def refuse_gravity(preset: Preset) -> None:
    """Refuse an endoscope with gravity."""
    for axis, value in zip("xyz", preset.gravity, strict=True):
        if value:
            rule = "the reduced twin has no gravity, choose that in MuJoCo"
            raise InputError(f"gravity_{axis} = {value:g}: {rule}")


def new_state(parameters: Parameters, sheath_bend: Array) -> ReducedState:
    """Return the state of straight endoscopes in sheaths that are bent by (M,) angles [rad]."""
    (count, segments), planes = parameters.rest.shape, parameters.planes
    elements, groups = segments - 2, len(parameters.size)
    zero = parameters.constants[:, ZERO : ZERO + planes]
    run = np.zeros((count, COMMAND + 3))
    run[:, COMMAND : COMMAND + planes] = zero
    run[:, -1] = sheath_bend
    return ReducedState(
        element=np.zeros((count, planes, elements)),
        hinge=np.zeros((count, planes, groups)),
        slip=np.zeros((count, planes, elements), np.int8),
        turn=np.zeros((count, planes, groups), np.int8),
        pulley=np.zeros((count, planes)),
        drive=np.zeros((count, planes, 4)),
        past=np.repeat(zero[:, :, None], parameters.late, axis=2),
        run=run,
        layout=np.array([planes, elements // 2, parameters.size.sum()], dtype=np.int64),
    )


def not_converged(preset: Preset, missing: float) -> DivergedError:
    """Return the error for an endoscope that found no equilibrium."""
    how_far = f"{missing:g} N are missing" if math.isfinite(missing) else "a force is no number"
    return DivergedError(f"the reduced twin of {preset.name!r} found no equilibrium: {how_far}")


def tension_and_slack(
    parameters: Parameters, element: Array, hinge: Array, pulley: Array
) -> tuple[Array, Array]:
    """Return tension [N] and slack [m] of each wire segment, both (..., M, wires, E + 1), pulley to tip.

    Positions are those of `ReducedState`, with any leading axes.
    """
    arm = parameters.constants[:, ARM, None]
    tip = arm * (hinge * parameters.size).sum(axis=-1)
    half = element.shape[-1] // 2
    first, second = element[..., :half], element[..., half:]
    chain = np.concatenate([pulley[..., None], first, tip[..., None], second, pulley[..., None]], axis=-1)
    stretch = parameters.rest[:, None, :] + chain[..., :-1] - chain[..., 1:]
    of_wires = np.stack([stretch[..., : half + 1], stretch[..., :half:-1]], axis=-2)
    of_wires = of_wires.reshape(*of_wires.shape[:-3], -1, half + 1)
    law = (parameters.constants[:, k, None, None] for k in (WIRE_STIFFNESS, WIRE_QUADRATIC, WIRE_TOE))
    return tension_at(of_wires, *law), np.maximum(-of_wires, 0.0)


def sheath_friction(parameters: Parameters, tension: Array, sheath_bend: Array, drift: Array) -> Array:
    """Return the breakaway friction of each sheath element, (..., M, wires, E) [N].

    `tension` is (..., M, wires, E + 1); the bend of the sheath [rad] and the factor of warm-up and wear on
    its friction are (..., M).
    """
    of = parameters.constants.T
    per_tension = friction_per_tension(of[SHEATH_FRICTION] * drift * (sheath_bend + of[BEND_OFFSET]), 1.0, 1)
    floor = friction_floor(of[FLOOR], of[GROWTH], of[EXPONENT], sheath_bend) * drift
    sliding = element_friction(tension, per_tension[..., None, None], floor[..., None, None])
    at_rest: Array = of[HOLDS][:, None, None] * sliding
    return at_rest
