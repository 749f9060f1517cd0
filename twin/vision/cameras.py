"""Mounting of a rig's two cameras before the bending section, with the tolerances of real ones."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from twin.preset.preset import Preset
from twin.vision.optics import Optics
from twin.vision.rig import StereoRig

Array = NDArray[np.float64]

_UP = np.array([-1.0, 0.0, 0.0])  # of the pictures: the endoscope hangs into them, its tip below
_CENTRE = 0.43  # of what is seen, ahead of the base [section lengths]
_TURN_DEG, _PLACE, _FOCUS, _AXIS_PX, _TANGENTIAL = 0.5, 0.005, 0.01, 3.0, 3e-4  # tolerances
_K1, _K2 = -0.10, 0.05


def mounted_cameras(preset: Preset, rig: StereoRig) -> tuple[Optics, Optics]:
    """Return the left and the right camera, as they really are: nobody who measures knows these numbers.

    They stand on either side of the shaft. A shaft along their baseline would look alike at any distance.
    """
    rng = np.random.default_rng([rig.seed, 0])
    length = preset.section_length
    centre = np.array([_CENTRE * length, 0.0, 0.0])
    focal = rig.height / 2 / (rig.half_height / rig.distance)
    cameras = []
    for side in (-0.5, 0.5):
        angle = side * np.radians(rig.angle_deg)
        away = rig.distance * length * np.array([0.0, -np.cos(angle), np.sin(angle)])
        position = centre + away * (1 + _PLACE * rng.standard_normal())
        forward = (centre - position) / np.linalg.norm(centre - position)
        right = np.cross(forward, _UP)
        right /= np.linalg.norm(right)
        aligned = np.array([right, np.cross(forward, right), forward])  # x right, y down, z forward
        tilt = Rotation.from_rotvec(np.radians(_TURN_DEG) * rng.standard_normal(3)).as_matrix()
        rotation = tilt @ aligned
        own = focal * (1 + _FOCUS * rng.standard_normal())
        axis = np.array([rig.width, rig.height]) / 2 - 0.5 + _AXIS_PX * rng.standard_normal(2)
        radial = rig.distortion * np.array([_K1, _K2]) * (1 + 0.1 * rng.standard_normal(2))
        tangential = rig.distortion * _TANGENTIAL * rng.standard_normal(2)
        matrix = np.array([[own, 0.0, axis[0]], [0.0, own, axis[1]], [0.0, 0.0, 1.0]])
        distortion = np.array([*radial, *tangential, 0.0])
        translation = -rotation @ position
        cameras.append(Optics(matrix, distortion, rotation, translation, rig.width, rig.height))
    return cameras[0], cameras[1]
