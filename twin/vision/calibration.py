"""Calibration of two cameras by OpenCV, from pictures of a board."""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from twin.errors import InputError
from twin.vision.bench import Bench, Picture, board_square, charuco_board
from twin.vision.optics import Optics, cv2

Array = NDArray[np.float64]
_LEAST_CORNERS, _LEAST_VIEWS = 12, 6
_TILT_DEG, _ASIDE, _DEEP = 32.0, 0.22, 0.45  # of the board: how far it is turned and moved [section lengths]
_CENTRE, _UPRIGHT = 0.43, np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])  # as the cameras see it
_FLAGS = cv2.CALIB_FIX_K3 | cv2.CALIB_FIX_ASPECT_RATIO


@dataclasses.dataclass(frozen=True)
class StereoCalibration:
    """Calibrated cameras in the axes of the left one."""

    left: Optics  # camera, at the origin
    right: Optics  # camera
    rms_px: float  # root mean square of the reprojection of the board's corners [pixels]
    views: int  # pairs of pictures in which the board was found


def calibrate(bench: Bench) -> StereoCalibration:
    """Calibrate the cameras of a bench: take pictures of the board in many poses, and find its corners.

    Each camera is calibrated alone, then the pair (Zhang 2000, as in OpenCV).
    """
    rig, preset = bench.rig, bench.preset
    rng = np.random.default_rng([rig.seed, 1])
    square = board_square(preset)
    board = charuco_board(square)
    detector = cv2.aruco.CharucoDetector(board)
    known = board.getChessboardCorners()
    seen: list[tuple[Array, Array, Array]] = []
    for _ in range(rig.calibration_views):
        move = rng.uniform(-1, 1, 3) * [_ASIDE, _DEEP, _ASIDE] * preset.section_length
        turn = Rotation.from_rotvec(np.radians(_TILT_DEG) * rng.uniform(-1, 1, 3)).as_matrix() @ _UPRIGHT
        position = np.array([_CENTRE * preset.section_length, 0.0, 0.0]) + move

        def hold(_: float, position: Array = position, turn: Array = turn) -> None:
            bench.show_board(position, turn)

        pair = [_corners(detector, picture) for picture in bench.take(hold, 0.0, rng)]
        common = sorted(set(pair[0]) & set(pair[1]))
        if len(common) >= _LEAST_CORNERS:
            left, right = (np.array([found[number] for number in common]) for found in pair)
            seen.append((np.asarray(known)[common], left, right))
    if len(seen) < _LEAST_VIEWS:
        raise InputError(
            f"the calibration board is found in {len(seen)} of {rig.calibration_views} pairs of pictures, at "
            f"least {_LEAST_VIEWS} are needed: less blur, noise or distortion, or more `calibration_views`"
        )
    return _solved(seen, rig.width, rig.height)


def _corners(detector: "cv2.aruco.CharucoDetector", picture: Picture) -> dict[int, Array]:
    """Return the corners (2,) of the board in a picture, by number [pixels]."""
    corners, numbers, _, _ = detector.detectBoard(picture)
    if numbers is None:
        return {}
    return dict(zip(numbers.ravel().tolist(), corners.reshape(-1, 2), strict=True))


def _solved(seen: list[tuple[Array, Array, Array]], width: int, height: int) -> StereoCalibration:
    boards, lefts, rights = ([one.astype(np.float32) for one in part] for part in zip(*seen, strict=True))
    size = (width, height)
    start = np.array([[2.0 * width, 0, width / 2], [0, 2.0 * width, height / 2], [0, 0, 1]])
    cameras = []
    for corners in (lefts, rights):
        flags = _FLAGS | cv2.CALIB_USE_INTRINSIC_GUESS
        _, matrix, distortion, _, _ = cv2.calibrateCamera(
            boards, corners, size, start.copy(), np.zeros(5), flags=flags
        )
        cameras.append((matrix, distortion.ravel()[:5]))
    (left, left_bent), (right, right_bent) = cameras
    found = cv2.stereoCalibrate(
        boards, lefts, rights, left, left_bent, right, right_bent, size, flags=cv2.CALIB_FIX_INTRINSIC
    )
    rms, turn, move = float(found[0]), np.asarray(found[5]), np.asarray(found[6]).ravel()
    return StereoCalibration(
        Optics(_kept(left), _kept(left_bent), np.eye(3), np.zeros(3), width, height),
        Optics(_kept(right), _kept(right_bent), _kept(turn), _kept(move), width, height),
        rms,
        len(seen),
    )


def _kept(numbers: Array) -> Array:
    """Return numbers to a thousand-millionth of the largest.

    The last bits of what OpenCV solves depend on the number of its threads; angles must not.
    """
    digits = 9 - int(np.ceil(np.log10(np.abs(numbers).max() + 1e-30)))
    rounded: Array = np.round(numbers, digits)
    return rounded
