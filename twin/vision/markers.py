"""Bending angle from markers: found in both pictures, placed in space, and turned against one another."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.vision.bench import BASE, DICTIONARY, TIP, Pair, Picture, marker_corners
from twin.vision.calibration import StereoCalibration
from twin.vision.optics import cv2

Array = NDArray[np.float64]
LARGEST_RESIDUAL = 0.4  # largest reprojection of a marker that is used, root mean square [pixels]


class Pose(NamedTuple):
    """Pose of a known shape."""

    rotation: Array  # (3, 3) its axes, as columns
    position: Array  # (3,) its origin [m]


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


class MarkerFinder:
    """Finder of the markers in pairs of pictures, and of their poses in the axes of the left camera."""

    def __init__(self, calibration: StereoCalibration, side: float) -> None:
        """Make the detector; `side` is that of a marker's black border [m]."""
        self._calibration = calibration
        self._shapes = {number: marker_corners(side) for number in (BASE, TIP)}
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        parameters.cornerRefinementWinSize = 4
        parameters.cornerRefinementMaxIterations = 50
        parameters.cornerRefinementMinAccuracy = 0.005
        self._detector = cv2.aruco.ArucoDetector(DICTIONARY, parameters)

    def measure_sizes(self, pairs: Sequence[Pair]) -> None:
        """Measure the markers as they appear: blur changes the size of print a little."""
        for number, shape in self._shapes.items():
            both = [
                (left[number], right[number])
                for left, right in self._seen(pairs)
                if number in left.keys() & right.keys()
            ]
            sizes = [_size(triangulate(left, right, self._calibration)) for left, right in both]
            if sizes:
                self._shapes[number] = shape * float(np.median(sizes)) / _size(shape)

    def poses(self, pair: Pair) -> dict[int, Pose]:
        """Return the poses of the markers that are seen well in a pair of pictures, by number."""
        ((left, right),) = self._seen([pair])
        found = {}
        for number, shape in self._shapes.items():
            if number not in left or number not in right:
                continue
            corners = left[number], right[number]
            pose = fitted_pose(shape, triangulate(*corners, self._calibration))
            if reprojection(shape, pose, *corners, self._calibration) <= LARGEST_RESIDUAL:
                found[number] = pose
        return found

    def _seen(self, pairs: Sequence[Pair]) -> list[tuple[dict[int, Array], dict[int, Array]]]:
        return [(self._corners(left), self._corners(right)) for left, right in pairs]

    def _corners(self, picture: Picture) -> dict[int, Array]:
        """Return the corners (4, 2) of the markers in a picture, by number [pixels]; not if seen twice."""
        corners, numbers, _ = self._detector.detectMarkers(picture)
        every = [] if numbers is None else numbers.ravel().tolist()
        return {
            number: corner.reshape(4, 2).astype(float)
            for number, corner in zip(every, corners, strict=True)
            if every.count(number) == 1
        }


class MarkerMeter:
    """Meter of the bending angle by a marker on the shaft and one on the tip."""

    def __init__(self, calibration: StereoCalibration, side: float, planes: int = 1) -> None:
        """Make the finder; `side` is that of a marker's black border [m]."""
        self._finder, self._planes = MarkerFinder(calibration, side), planes
        self._straight = np.eye(3)

    def zero(self, pairs: Sequence[Pair]) -> int:
        """Set the zero from pictures of the straight endoscope; returns the number of measured pairs."""
        self._finder.measure_sizes(pairs)
        turns = [turn for turn in map(self._turn, pairs) if turn is not None]
        if turns:
            self._straight = mean_rotation(turns)
        return len(turns)

    def forget(self) -> None:
        """Do nothing: pairs of pictures are measured independently."""

    def angle(self, pair: Pair) -> float:
        """Return the bending angle in the plane of wires a and b [rad]; NaN where it is unknown."""
        turn = self._turn(pair)
        if turn is None:
            return float("nan")
        # In the axes of the shaft's marker: x along the shaft, y against wire a, z away from the cameras.
        along, against, away = (turn @ self._straight.T)[:, 0]
        if self._planes == 1:
            return float(np.arctan2(-against, along))
        aside = float(np.hypot(against, away))
        return float(np.arctan2(aside, along)) * -float(against) / aside if aside > 0 else 0.0

    def _turn(self, pair: Pair) -> Array | None:
        """Return the rotation of the tip's marker in the axes of the shaft's; None where one is not found."""
        poses = self._finder.poses(pair)
        if len(poses) < 2:
            return None
        turn: Array = poses[BASE].rotation.T @ poses[TIP].rotation
        return turn


def _size(points: Array) -> float:
    """Return the root mean square distance of points (n, 3) from their middle."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))
