"""Tension law of a wire segment: a spring that stiffens under tension and cannot push; pretension.

    T = k x + k2 x^2  for a stretch x > 0, else 0,   with k2 = s k^2 / 2

The stiffness dT/dx begins at k and grows there by the fraction s per newton: the strands of a wire rope and
its liner settle under load (Costello, Theory of Wire Rope, 1997), while a solid wire has s = 0. MuJoCo's
polynomial tendon stiffness computes the same force.
"""

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import friction_floor, friction_per_tension
from twin.preset.preset import Preset

Array = NDArray[np.float64]
ABSENT = 1.0  # slack of each segment of a wire that is not there [m]: no pull takes it up


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
    """Return the tension that winding up from slack leaves in each wire segment, pulley to tip, (E + 1,) [N].

    The pulley pulls both wires alike until they carry `preset.pretension` there. All elements then slide
    towards the pulley, so that every one of them keeps its share of the tension from the tip (capstan
    equation). Wires with slack, and those without an antagonist, carry nothing.
    """
    elements = preset.sheath_elements
    if preset.wire_slack or preset.wires_per_plane == 1:
        return np.zeros(elements + 1)
    wrapped = preset.sheath_bend + preset.sheath_bend_offset
    share = friction_per_tension(preset.sheath_friction, wrapped, elements)
    floor = sheath_floor(preset) / elements
    tension = np.empty(elements + 1)
    tension[0] = preset.pretension
    for element in range(elements):
        inner = tension[element] * (1 - share / 2) - floor
        tension[element + 1] = max(inner / (1 + share / 2), 0.0)
    return tension


def sheath_floor(preset: Preset) -> float:
    """Return the friction of one wire in the preset's own sheath that does not depend on its tension [N]."""
    growth, exponent = preset.sheath_friction_growth, preset.sheath_friction_exponent
    return float(friction_floor(preset.sheath_friction_floor, growth, exponent, preset.sheath_bend))


def rest_stretch(preset: Preset, antagonist: bool) -> Array:
    """Return the stretch of each segment of a wire in a new, straight endoscope, pulley to tip, (E + 1,) [m].

    It is below 0 where slack: slack is at the tip, as no friction keeps it elsewhere. A wire that is not
    there is one that is never taut. With two bending planes, whose friction is one, bending all round has
    spread the stretch evenly.
    """
    if antagonist and preset.wires_per_plane == 1:
        return np.full(preset.sheath_elements + 1, -ABSENT)
    stretch = stretch_at(wound_tension(preset), segment_stiffness(preset), quadratic_stiffness(preset))
    if preset.bending_planes == 2:
        stretch[:] = stretch.mean()
    stretch[-1] -= preset.wire_slack
    return stretch
