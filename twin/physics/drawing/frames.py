"""Frames of the drawn parts: links of the bending section, and the sheath on its way to the pulley.

Each frame has its x axis along the centre line, towards the tip; z is in the plane of wires a and b.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from twin.preset.preset import Preset

Array = NDArray[np.float64]

_SHEATH_LENGTHS, _SHEATH_RADII = 4.0, 36.0
SHEATH_BONES = 40
"""Number of frames along the drawn sheath."""
_STRAIGHT = 0.12
"""Share of the drawn sheath that is straight at either end."""
_RISE = 3.2
"""Height that a sheath gains over a whole turn, in distances of the wires: a loop passes over itself."""


class Frames(NamedTuple):
    """Frames along a centre line.

    Attributes:
        position: (..., frames, 3) origins [m].
        rotation: (..., frames, 3, 3) axes, as columns.
    """

    position: Array
    rotation: Array


def link_frames(joint_angle: Array, lateral: Array, section_length: float) -> Frames:
    """Return the frame of each link at its hinge, base to tip, and that of the tip.

    Every hinge turns the link after it about -y, and then, with two bending planes, about z.

    Args:
        joint_angle: (N, vertebrae) hinge angles [rad].
        lateral: (N, vertebrae) the same sideways; empty with one bending plane.
        section_length: of the bending section [m].

    Returns:
        Frames (N, vertebrae + 1); the last one, at the tip, is turned as the last link.
    """
    count, vertebrae = joint_angle.shape
    lateral = lateral if len(lateral) else np.zeros_like(joint_angle)
    turned = Rotation.identity(count)
    position = np.zeros((count, vertebrae + 1, 3))
    rotation = np.empty((count, vertebrae + 1, 3, 3))
    for index in range(vertebrae):
        hinges = np.stack([-joint_angle[:, index], lateral[:, index]], axis=1)
        turned = turned * Rotation.from_euler("YZ", hinges)
        rotation[:, index] = turned.as_matrix()
        position[:, index + 1] = position[:, index] + rotation[:, index, :, 0] * section_length / vertebrae
    rotation[:, -1] = rotation[:, -2]
    return Frames(position, rotation)


def drawn_sheath_length(preset: Preset) -> float:
    """Return the length of the drawn sheath [m]: at its true length all else would be tiny.

    It is some lengths of the bending section, or enough for a thick one to be bent.
    """
    return max(_SHEATH_LENGTHS * preset.section_length, _SHEATH_RADII * preset.wire_offset)


def sheath_frames(preset: Preset, bend: float) -> Frames:
    """Return frames along the drawn sheath, evenly from the base to the pulley, (`SHEATH_BONES` + 1).

    It leaves the base straight, turns by `bend` in the horizontal plane, away from the viewer, and ends
    straight.

    Args:
        preset: shape and size.
        bend: angle that the sheath is bent by [rad].
    """
    length = drawn_sheath_length(preset)
    share = np.linspace(0.0, 1.0, 20 * SHEATH_BONES + 1)
    turned = bend * _smooth(np.clip((share - _STRAIGHT) / (1 - 2 * _STRAIGHT), 0.0, 1.0))
    rise = _RISE * preset.wire_offset * turned / (2 * np.pi)
    along = np.stack([np.cos(turned), np.sin(turned)], axis=1)  # against the way that is walked
    steps = (along[1:] + along[:-1]) / 2 * length / (len(share) - 1)
    flat = np.concatenate([np.zeros((1, 2)), -np.cumsum(steps * [1, -1], axis=0)])
    position = np.column_stack([flat[:, 0], flat[:, 1], rise])[::20]
    turned = turned[::20]
    rotation = np.zeros((len(turned), 3, 3))
    rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(turned)
    rotation[:, 0, 1], rotation[:, 1, 0] = np.sin(turned), -np.sin(turned)
    rotation[:, 2, 2] = 1.0
    return Frames(position, rotation)


def _smooth(share: Array) -> Array:
    """Return the share of the bend that is reached: the curvature rises and falls over a tenth."""
    edge = 0.1
    rising = np.where(share < edge, share**2 / (2 * edge), share - edge / 2)
    end = 1 - share
    falling = (1 - edge) - np.where(end < edge, end**2 / (2 * edge), end - edge / 2)
    reached: Array = np.where(share < 0.5, rising, falling) / (1 - edge)
    return reached
