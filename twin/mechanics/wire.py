"""Tension law of a wire segment: a spring that stiffens under tension and cannot push; pretension.

    T = k x + k2 x^2  for a stretch x > 0, else 0,   with k2 = s k^2 / 2

The stiffness dT/dx begins at k and grows there by the fraction s per newton: the strands of a wire rope and
its liner settle under load (Costello, Theory of Wire Rope, 1997), while a solid wire has s = 0. MuJoCo's
polynomial tendon stiffness computes the same force.
"""

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import friction_per_tension
from twin.preset.preset import Preset

Array = NDArray[np.float64]


def segment_stiffness(preset: Preset) -> float:
    """Return the stiffness k of one wire segment [N / m]: all segments in series are the wire."""
    return preset.wire_stiffness * (preset.sheath_elements + 1)


def quadratic_stiffness(preset: Preset) -> float:
    """Return the quadratic coefficient k2 of one wire segment [N / m^2]."""
    return preset.wire_stiffening * segment_stiffness(preset) ** 2 / 2


def tension_at(stretch: Array, stiffness: Array | float, quadratic: Array | float) -> Array:
    """Return the tension [N] of wire segments at a stretch [m]."""
    taut = np.maximum(stretch, 0.0)
    return taut * (stiffness + quadratic * taut)


def stretch_at(tension: Array, stiffness: Array | float, quadratic: Array | float) -> Array:
    """Return the stretch [m] of wire segments at a tension [N]: the inverse of `tension_at`.

    The root is written such that it loses no digits where `quadratic` is small or zero.
    """
    return 2 * tension / (stiffness + np.sqrt(stiffness**2 + 4 * quadratic * tension))


def wound_tension(preset: Preset) -> Array:
    """Return the tension that winding up from slack leaves in each wire segment.

    The pulley pulls both wires alike until they carry `preset.pretension` there. All elements then slide
    towards the pulley, so that every one of them keeps its share of the tension from the tip (capstan
    equation).

    Returns:
        (elements + 1,) tension, pulley to tip [N].
    """
    elements = preset.sheath_elements
    share = friction_per_tension(
        preset.sheath_friction, preset.sheath_bend + preset.sheath_bend_offset, elements
    )
    floor = preset.sheath_friction_floor / elements
    tension = np.empty(elements + 1)
    tension[0] = preset.pretension
    for element in range(elements):
        inner = tension[element] * (1 - share / 2) - floor
        tension[element + 1] = max(inner / (1 + share / 2), 0.0)
    return tension
