"""Forward kinematics of the bending section: a chain of rigid links on hinges.

The shaft is along x and ends at the origin. Each hinge turns the link after it about -y, in the plane of
wires a and b, and then, with two bending planes, about z, in that of wires c and d (as the hinges of
`twin/physics/model.py` do).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Frames(NamedTuple):
    """Frames along a centre line: the x axis points along it, towards the tip."""

    position: Array  # (..., frames, 3) origins [m]
    rotation: Array  # (..., frames, 3, 3) axes, as columns


def link_frames(joint_angle: Array, lateral: Array, section_length: float) -> Frames:
    """Return the frame of each link at its hinge, base to tip, and that of the tip, (N, vertebrae + 1).

    Hinge angles and those sideways, empty with one bending plane, are (N, vertebrae) [rad]; the length of the
    section is in metres. The tip is turned as the last link.
    """
    from scipy.spatial.transform import Rotation  # here: simulations need none

    count, vertebrae = joint_angle.shape
    lateral = lateral if lateral.size else np.zeros_like(joint_angle)
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
