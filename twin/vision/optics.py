"""Optics of two cameras in OpenCV's conventions: pinhole, lens distortion, pose, and mounting.

A camera's own axes are x to the right, y down and z forward. A point X of the world is at R X + t there; its
normalised place (x / z, y / z) is distorted radially and tangentially (Brown 1966) and becomes a pixel by the
matrix K, whose origin is the middle of the upper left pixel.
"""

import dataclasses
from typing import Any

import cv2 as _cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from twin.physics.drawing.canvas import View
from twin.preset.preset import Preset
from twin.vision.rig import StereoRig

cv2: Any = _cv2  # its own annotations are of arrays of every type, ours of floats
_cv2.setNumThreads(1)  # a worker has one core

Array = NDArray[np.float64]
_UP = np.array([-1.0, 0.0, 0.0])  # of the pictures: the endoscope hangs into them, its tip below
_CENTRE = 0.43  # of what is seen, ahead of the base [section lengths]
_TURN_DEG, _PLACE, _FOCUS, _AXIS_PX, _TANGENTIAL = 0.5, 0.005, 0.01, 3.0, 3e-4  # tolerances
_K1, _K2 = -0.10, 0.05


@dataclasses.dataclass(frozen=True)
class Optics:
    """Camera."""

    matrix: Array  # K (3, 3) [pixels]
    distortion: Array  # (5,) k1, k2, p1, p2, k3
    rotation: Array  # R (3, 3) from the world to the camera
    translation: Array  # t (3,) [m]
    width: int  # of a picture [pixels]
    height: int  # of a picture [pixels]

    @property
    def position(self) -> Array:
        """(3,) of the camera in the world [m]."""
        return -self.rotation.T @ self.translation

    @property
    def projection(self) -> Array:
        """(3, 4) projection of a point of the world to its normalised place, without distortion."""
        return np.column_stack([self.rotation, self.translation])

    def project(self, points: Array) -> Array:
        """Return the pixels (n, 2) of points (n, 3) of the world [m]."""
        turn, _ = cv2.Rodrigues(self.rotation)
        pixels: Array
        pixels, _ = cv2.projectPoints(
            points.reshape(-1, 1, 3), turn, self.translation, self.matrix, self.distortion
        )
        return pixels.reshape(-1, 2).astype(float)

    def normalised(self, pixels: Array) -> Array:
        """Return the normalised places (n, 2), without distortion, of pixels (n, 2)."""
        places: Array = cv2.undistortPoints(pixels.reshape(-1, 1, 2), self.matrix, self.distortion)
        return places.reshape(-1, 2).astype(float)


class Lens:
    """Lens of a camera: it distorts the picture of a pinhole, a little wider, which the renderer draws."""

    def __init__(self, optics: Optics, margin: float = 0.06) -> None:
        focal = float(optics.matrix[0, 0])
        extra = round(margin * optics.width)
        self.width, self.height = optics.width + 2 * extra, optics.height + 2 * extra
        rows, columns = np.mgrid[: optics.height, : optics.width]
        pixels = np.stack([columns.ravel(), rows.ravel()], axis=1).astype(float)
        places = optics.normalised(pixels)
        # In the middle of a pixel of the pinhole, whose axis is at the middle of its picture.
        across = places[:, 0] * focal + self.width / 2 - 0.5
        along = places[:, 1] * focal + self.height / 2 - 0.5
        shape = optics.height, optics.width
        self._maps = across.reshape(shape).astype(np.float32), along.reshape(shape).astype(np.float32)
        _, down, forward = optics.rotation
        self.view = View(optics.position, forward, -down, self.height / 2 / focal)

    def bend(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the picture of the camera (height, width) out of that of the pinhole."""
        bent: NDArray[np.float32] = cv2.remap(
            picture, *self._maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        return bent


def mounted_cameras(preset: Preset, rig: StereoRig) -> tuple[Optics, Optics]:
    """Return the true left and right camera, with the tolerances of real ones; a measurement knows neither.

    They are on either side of the shaft. A shaft along their baseline would look alike at any distance.
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
