"""Dry friction: of a wire in its bent sheath (capstan), on the vertebrae that guide it, and of the hinges."""

import math

import numpy as np
from numpy.typing import NDArray

from twin.preset.preset import Preset

Array = NDArray[np.float64]
Real = Array | float
Index = NDArray[np.intp]
LEAST_FRICTION = 1e-9  # of a sheath element [N]: keeps its constraint in the model where friction is zero
CAUGHT_UP = 0.1  # force beyond sliding friction at which what slid rests, as a share of stiction's [-]
# NumPy's tanh depends, by a rounding, on the place of a value in its array; a batch must not.
_tanh = np.vectorize(math.tanh, otypes=[float])


def friction_drift(warm_up: Real, warm_up_time: Real, wear: Real, time: Real, travel: Real) -> Array:
    """Return the factor on coefficient and floor of sheath friction, of warm-up and wear.

    `warm_up` is the excess at the start [-], decaying with `warm_up_time` [s]; `wear` grows with the travel
    of the pulleys [1 / m].
    """
    factor: Array = 1 + warm_up * np.exp(-time / warm_up_time) + wear * travel
    return factor


def friction_per_tension(friction: Real, bend: Real, elements: int) -> Array:
    """Return the friction force of one sheath element per unit of mean tension on its two sides.

    A wire that slides over an angle dphi loses tension by T_out = T_in exp(-mu dphi) (Euler 1769, Eytelwein
    1808). With the mean tension of both sides, that is a force

        F = T_in - T_out = 2 tanh(mu dphi / 2) (T_in + T_out) / 2

    which is exact for any number of elements, which share the bend [rad], and for both directions of sliding.
    """
    force: Array = 2 * _tanh(friction * np.asarray(bend) / elements / 2)
    return force


def friction_floor(floor: Real, growth: Real, exponent: Real, bend: Real) -> Real:
    """Return the friction of a wire in its sheath that does not depend on its tension [N].

    A wire has a stiffness of its own: a bent sheath has to bend it, and is pressed by it, even where it is
    not pulled. Measured loops at eight bends of a sheath show such a friction, which rises with the bend
    [rad] less than in proportion (exponents of some 2/3), and hardly one in proportion to the tension.
    """
    return floor + growth * bend**exponent


def element_friction(tension: Array, per_tension: Real, floor: Real) -> Array:
    """Return the force at which each sheath element begins to slide, (..., elements) [N].

    From the tension in each length of wire (..., elements + 1) [N], the factor of `friction_per_tension`, and
    the friction of one element that does not depend on the tension [N].
    """
    return per_tension * (tension[..., 1:] + tension[..., :-1]) / 2 + floor


def hinge_friction(joint: Array, routing: Real, tension: Array, turn: Array) -> Array:
    """Return the torque at which each hinge begins to turn: its own plus that of the wires on the vertebrae.

    Where hinge i is bent by d_i, a wire of tension T presses on its guide with T |d_i|. Bending the hinges
    beyond i further pulls the wire through that guide, by the moment arm r times their angles. The work
    against friction, mu T |d_i| r per angle, is a torque on each of those hinges:

        tau_j = tau_joint_j + mu r T (|d_1| + ... + |d_j-1| + |d_j| / 2)

    summed over the two wires of a plane: the capstan equation to first order in mu and the bend. `joint` and
    `turn` are (..., vertebrae), `routing` is mu r [m], `tension` (...) the sum of the wires' [N].
    """
    wrapped = np.cumsum(turn, axis=-1) - turn / 2
    return joint + (routing * tension)[..., None] * wrapped


def hinge_groups(vertebrae: int) -> list[Index]:
    """Return the hinges, base to tip, in at most 8 groups of neighbours that share a friction constraint."""
    return np.array_split(np.arange(vertebrae), min(vertebrae, 8))


def group_of_hinge(vertebrae: int) -> Index:
    """Return the number of the group that each hinge is in, base to tip, (vertebrae,)."""
    sizes = [len(group) for group in hinge_groups(vertebrae)]
    return np.repeat(np.arange(len(sizes)), sizes)


def joint_friction(preset: Preset) -> Array:
    """Return the dry friction torque of a hinge of each group, base to tip, (groups,) [N m]."""
    place = (np.arange(preset.vertebrae) + 0.5) / preset.vertebrae
    of_hinges = preset.joint_friction * (1 + preset.joint_friction_taper * (1 - 2 * place))
    return np.array([of_hinges[group].mean() for group in hinge_groups(preset.vertebrae)])
