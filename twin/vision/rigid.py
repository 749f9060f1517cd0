"""Rigid motions in space: points from two pictures, and the pose of a known shape that fits them best."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.vision.calibration import StereoCalibration
from twin.vision.opencv import cv2

Array = NDArray[np.float64]


class Pose(NamedTuple):
    """Pose of a known shape.

    Attributes:
        rotation: (3, 3) its axes, as columns.
        position: (3,) its origin [m].
    """

    rotation: Array
    position: Array


def triangulate(left: Array, right: Array, calibration: StereoCalibration) -> Array:
    """Return points (n, 3) [m] in the axes of the left camera, from their pixels (n, 2) in both pictures."""
    places = [
        camera.normalised(pixels) for camera, pixels in ((calibration.left, left), (calibration.right, right))
    ]
    projections = calibration.left.projection, calibration.right.projection
    homogeneous = cv2.triangulatePoints(*projections, places[0].T, places[1].T).astype(float)
    points: Array = (homogeneous[:3] / homogeneous[3]).T
    return points


def fitted_pose(shape: Array, points: Array) -> Pose:
    """Return the pose in which a shape (n, 3) is nearest to points (n, 3), in least squares (Kabsch 1976)."""
    centre, middle = shape.mean(axis=0), points.mean(axis=0)
    left, _, right = np.linalg.svd((shape - centre).T @ (points - middle))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = (left @ flip @ right).T
    return Pose(rotation, middle - rotation @ centre)


def reprojection(
    shape: Array, pose: Pose, left: Array, right: Array, calibration: StereoCalibration
) -> float:
    """Return the root mean square distance of a shape in a pose from its pixels in both pictures [pixels]."""
    points = shape @ pose.rotation.T + pose.position
    off = [calibration.left.project(points) - left, calibration.right.project(points) - right]
    return float(np.sqrt(np.mean(np.square(off)) * 2))


def mean_rotation(rotations: list[Array]) -> Array:
    """Return the rotation (3, 3) that is nearest to the mean of rotations, in least squares."""
    left, _, right = np.linalg.svd(np.mean(rotations, axis=0))
    mean: Array = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return mean
