"""Printed targets: the markers on shaft and tip, and the board that cameras are calibrated with."""

import numpy as np
from numpy.typing import NDArray

from twin.physics.drawing.drawn import OUTER, Plate
from twin.preset.preset import Preset
from twin.vision.optics import cv2
from twin.vision.rig import StereoRig

Array = NDArray[np.float64]

DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
BASE, TIP = 0, 1
"""Numbers of the markers on the shaft and on the tip."""

_MODULES, _MARGIN = 6, 1  # of a marker across, its black border included; white ones around it
_MODULE_PIXELS = 32  # printed
_SQUARES, _SQUARE_PIXELS, _SQUARE = (9, 7), 64, 0.125  # of the board; the last in lengths of the section
_INK, _PAPER = 25, 235  # grey levels of print
_FIRST_OF_BOARD = 10  # number of the board's first marker
_STANDOFF = OUTER + 0.35  # of the markers in front of the axis, in distances of the wires


def marker_side(preset: Preset, rig: StereoRig) -> float:
    """Return the side of a marker's black border [m]."""
    return rig.marker_size * preset.section_length


def marker_corners(side: float) -> Array:
    """Return the corners of a marker in its own axes (4, 3), from the upper left one clockwise [m].

    Its axes are x to the right, y down and z into it.
    """
    return side / 2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def marker_plates(preset: Preset, rig: StereoRig) -> list[Plate]:
    """Return the plates of the markers of a rig's method, in front of the shaft and of the tip.

    In a straight endoscope both look alike: rows along the shaft, columns towards wire b.
    """
    link = preset.section_length / preset.vertebrae
    side = marker_side(preset, rig)
    size = side * (_MODULES + 2 * _MARGIN) / _MODULES
    before = -_STANDOFF * preset.wire_offset
    places = {
        BASE: ("base", (-0.7 * size, before, 0.0)),
        TIP: (f"link_{preset.vertebrae - 1}", (link - 0.1 * size, before, 0.0)),
    }
    return [
        Plate(f"marker_{number}", _printed_marker(number), (size, size), body, centre)
        for number, (body, centre) in places.items()
        if number == BASE or rig.method == "markers"
    ]


def board_square(preset: Preset) -> float:
    """Return the side of a square of the calibration board [m]."""
    return _SQUARE * preset.section_length


def charuco_board(square: float) -> "cv2.aruco.CharucoBoard":
    """Return the calibration board of OpenCV: a chessboard of squares [m] with markers in the white ones."""
    count = _SQUARES[0] * _SQUARES[1] // 2
    numbers = np.arange(_FIRST_OF_BOARD, _FIRST_OF_BOARD + count)
    return cv2.aruco.CharucoBoard(_SQUARES, square, 0.72 * square, DICTIONARY, numbers)


def board_plate(square: float) -> Plate:
    """Return the plate of the calibration board, on a body of its own: `board`."""
    across, down = _SQUARES
    size = across * _SQUARE_PIXELS, down * _SQUARE_PIXELS
    picture = charuco_board(square).generateImage(size)
    margin = _SQUARE_PIXELS // 2
    framed = np.pad(picture, margin, constant_values=255)
    return Plate("board", _in_print(framed), ((across + 1) * square, (down + 1) * square))


def _printed_marker(number: int) -> NDArray[np.uint8]:
    marker = cv2.aruco.generateImageMarker(DICTIONARY, number, _MODULES * _MODULE_PIXELS)
    return _in_print(np.pad(marker, _MARGIN * _MODULE_PIXELS, constant_values=255))


def _in_print(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return black and white as ink and paper."""
    return np.where(picture > 127, _PAPER, _INK).astype(np.uint8)
