"""Readings of reduced twins: tension, slack and friction of the wires from where the nodes are."""

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import element_friction, friction_floor, friction_per_tension
from twin.mechanics.wire import tension_at
from twin.reduced.parameters import Parameters

Array = NDArray[np.float64]


def tension_and_slack(
    parameters: Parameters, element: Array, hinge: Array, pulley: Array
) -> tuple[Array, Array]:
    """Return tension [N] and slack [m] of each wire segment, both (..., M, wires, E + 1), pulley to tip.

    Args:
        parameters: of M endoscopes.
        element: (..., M, planes, 2 E) positions of `ReducedState`.
        hinge: (..., M, planes, G) likewise.
        pulley: (..., M, planes) likewise.
    """
    arm = parameters.arm[:, None]
    tip = arm * (hinge * parameters.size).sum(axis=-1)
    half = element.shape[-1] // 2
    first, second = element[..., :half], element[..., half:]
    chain = np.concatenate([pulley[..., None], first, tip[..., None], second, pulley[..., None]], axis=-1)
    stretch = parameters.rest[:, None, :] + chain[..., :-1] - chain[..., 1:]
    of_wires = np.stack([stretch[..., : half + 1], stretch[..., :half:-1]], axis=-2)
    of_wires = of_wires.reshape(*of_wires.shape[:-3], -1, half + 1)
    stiffness, quadratic = parameters.wire_stiffness[:, None, None], parameters.wire_quadratic[:, None, None]
    return tension_at(of_wires, stiffness, quadratic), np.maximum(-of_wires, 0.0)


def sheath_friction(parameters: Parameters, tension: Array, sheath_bend: Array, drift: Array) -> Array:
    """Return the breakaway friction of each sheath element, (..., M, wires, E) [N].

    Args:
        parameters: of M endoscopes.
        tension: (..., M, wires, E + 1), of `tension_and_slack`.
        sheath_bend: (..., M) angle that the sheath is bent by [rad].
        drift: (..., M) factor of warm-up and wear.
    """
    wrapped = parameters.sheath_friction * drift * (sheath_bend + parameters.bend_offset)
    per_tension = friction_per_tension(wrapped, 1.0, 1)[..., None, None]
    floor = friction_floor(parameters.floor, parameters.growth, parameters.exponent, sheath_bend) * drift
    sliding = element_friction(tension, per_tension, floor[..., None, None])
    return parameters.holds[:, None, None] * sliding
