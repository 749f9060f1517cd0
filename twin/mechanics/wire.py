"""Tension law of a wire segment: a spring that stiffens under tension and cannot push; pretension.

    T = k y + k2 y^2,   with k2 = s k^2 / 2   and   y = x for a stretch x > 0, else 0

The stiffness dT/dx begins at k and grows there by the fraction s per newton: the strands of a wire rope and
its liner settle under load (Costello, Theory of Wire Rope, 1997), while a solid wire has s = 0.

A wire that is hardly pulled lies in waves in its sheath, its strands apart: it does not turn slack at once,
but is soft up to a tension T0, its toe (as ropes and tendons, Fung 1967). Then, with w = T0 / k,

    y = w ln(1 + exp(x / w))      so that without stiffening      dT/dx = k (1 - exp(-T / T0))
"""

import math

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import friction_floor, friction_per_tension
from twin.preset.preset import Preset

Array = NDArray[np.float64]
LEAST_TAUT = 1e-3  # taut part of a segment that is wound up, over the width of its toe [-]
ABSENT = 1.0  # slack of each segment of a wire that is not there [m]: no pull takes it up


def segment_stiffness(preset: Preset) -> float:
    """Return the stiffness k of one wire segment [N / m]: all segments in series are the wire."""
    return preset.wire_stiffness * (preset.sheath_elements + 1)


def quadratic_stiffness(preset: Preset) -> float:
    """Return the quadratic coefficient k2 of one wire segment [N / m^2]."""
    return preset.wire_stiffening * segment_stiffness(preset) ** 2 / 2


def toe_width(preset: Preset) -> float:
    """Return the width w of the toe of one wire segment [m]; 0 is none."""
    return preset.wire_toe / segment_stiffness(preset)


def spring_law(preset: Preset) -> tuple[float, float, float]:
    """Return the law of one wire segment, as `tension_at` and `stretch_at` take it [N / m, N / m^2, m]."""
    return segment_stiffness(preset), quadratic_stiffness(preset), toe_width(preset)


def taut_part(stretch: float, width: float) -> tuple[float, float]:
    """Return the part y [m] of a segment's stretch that is taut, and its derivative by the stretch [-].

    A kernel. Without a toe, the derivative is 1 for a slack segment too.
    """
    if width == 0.0:
        return max(stretch, 0.0), 1.0
    ratio = stretch / width
    if ratio > 0.0:
        slack = math.exp(-ratio)
        return stretch + width * math.log1p(slack), 1.0 / (1.0 + slack)
    taut = math.exp(ratio)
    return width * math.log1p(taut), taut / (1.0 + taut)


def tension_at(
    stretch: Array, stiffness: Array | float, quadratic: Array | float, width: Array | float = 0.0
) -> Array:
    """Return the tension [N] of wire segments at a stretch [m]; the toe has a width [m]."""
    taut = np.maximum(stretch, 0.0)
    if np.any(width):
        soft = width * np.logaddexp(0.0, stretch / np.where(width > 0, width, 1.0))
        taut = np.where(width > 0, soft, taut)
    tension: Array = taut * (stiffness + quadratic * taut)
    return tension


def stretch_at(
    tension: Array, stiffness: Array | float, quadratic: Array | float, width: float = 0.0
) -> Array:
    """Return the stretch [m] of wire segments at a tension [N]: the inverse of `tension_at`.

    The root is written such that it loses no digits where `quadratic` is small or zero. With a toe, no
    stretch leaves no tension at all: there it is 0.
    """
    taut = 2 * tension / (stiffness + np.sqrt(stiffness**2 + 4 * quadratic * tension))
    if width == 0:
        return taut
    loose = np.log(-np.expm1(-np.maximum(taut, LEAST_TAUT * width) / width))
    return np.where(taut > 0, taut + width * loose, 0.0)


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
    stretch = stretch_at(wound_tension(preset), *spring_law(preset))
    if preset.bending_planes == 2:
        stretch[:] = stretch.mean()
    stretch[-1] -= preset.wire_slack
    return stretch
