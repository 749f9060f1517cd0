"""Position of the tip: forward kinematics of the vertebrae, a chain of rigid links on hinges.

Each vertebra turns first in the plane of wires a and b, then in that of wires c and d (as the hinges of
`twin/physics/model.py` do).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def tip_position(joint_angle: Array, lateral_joint_angle: Array, section_length: float) -> Array:
    """Return the position of the tip, (N, 3) [m].

    The shaft lies along x and ends at the origin; the tip bends towards z in the plane of wires a and b, and
    towards y in that of wires c and d.

    Args:
        joint_angle: (N, V) angle of each hinge, base to tip [rad].
        lateral_joint_angle: (N, V) the same of the sideways hinges; empty with one plane.
        section_length: of the V links together [m].
    """
    from scipy.spatial.transform import Rotation  # here: who only simulates needs none

    samples, vertebrae = joint_angle.shape
    sideways = lateral_joint_angle if lateral_joint_angle.size else np.zeros_like(joint_angle)
    link = np.array([section_length / vertebrae, 0.0, 0.0])
    place, turned = np.zeros((samples, 3)), Rotation.identity(samples)
    for angle, lateral in zip(joint_angle.T, sideways.T, strict=True):
        turned = turned * Rotation.from_euler("YZ", np.stack([-angle, lateral], axis=1))
        place += turned.apply(link)
    return place
