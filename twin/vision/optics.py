"""Optics of a camera: pinhole, lens distortion and pose, in OpenCV's conventions.

A camera's own axes are x to the right, y down and z forward. A point X of the world is at R X + t there; its
normalised place (x / z, y / z) is distorted radially and tangentially (Brown 1966) and becomes a pixel by the
matrix K, whose origin is the middle of the upper left pixel.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.physics.drawing.canvas import View
from twin.vision.opencv import cv2

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Optics:
    """Camera.

    Attributes:
        matrix: K (3, 3) [pixels].
        distortion: (5,) k1, k2, p1, p2, k3.
        rotation: R (3, 3) from the world to the camera.
        translation: t (3,) [m].
        width: of a picture [pixels].
        height: of a picture [pixels].
    """

    matrix: Array
    distortion: Array
    rotation: Array
    translation: Array
    width: int
    height: int

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
    """Lens of a camera: it bends the picture of a pinhole, which the renderer draws.

    Attributes:
        view: of the pinhole, a little wider than what is kept.
        width: of the pinhole's picture [pixels].
        height: of it [pixels].
    """

    def __init__(self, optics: Optics, margin: float = 0.06) -> None:
        """Compute where each pixel looks.

        Args:
            optics: of the camera.
            margin: by which the pinhole sees more on each side, in shares of the width.
        """
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
