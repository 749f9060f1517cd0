"""Bench in front of the cameras: endoscope, calibration board, a passing rod, exposure of pictures."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.mechanics.kinematics import Frames, link_frames
from twin.physics.drawing.drawn import AWAY, OUTER, DrawnEndoscope, Plate, add_plate, add_rod
from twin.physics.drawing.surfaces import sheath_frames
from twin.preset.preset import Preset
from twin.rendering.actor import hinge_angles_of
from twin.vision.optics import Lens, cv2, mounted_cameras
from twin.vision.rig import StereoRig

Array = NDArray[np.float64]
DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
BASE, TIP = 0, 1  # numbers of the markers on the shaft and on the tip
_MODULES, _MARGIN = 6, 1  # of a marker across, its black border included; white ones around it
_MODULE_PIXELS = 32  # printed
_SQUARES, _SQUARE_PIXELS, _SQUARE = (9, 7), 64, 0.125  # of the board; the last in lengths of the section
_INK, _PAPER = 25, 235  # grey levels of print
_FIRST_OF_BOARD = 10  # number of the board's first marker
_STANDOFF = OUTER + 0.35  # of the markers in front of the axis, in distances of the wires
Picture = NDArray[np.uint8]  # (height, width) grey levels
Grey = NDArray[np.float32]
Pair = tuple[Picture, Picture]  # left and right picture
_BACKDROP = 190.0  # grey level of the background
_ROD = (0.06, 4.0)  # radius and length, in lengths of the section
_LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)
MOST_INSTANTS = 12  # most instants at which a moving scene is drawn for one picture
_STILL_PX = 0.25  # motion that is not seen
_SHOT_SHARE = 0.7  # of the variance at mid-grey that grows with the light; the rest is that of reading
_SECONDS = (0.4, 2.5)  # that a pass takes
_NEARNESS = (0.1, 0.5)  # of the rod, from what it hides to the cameras
_SWEEP = 0.8  # half of its path, in lengths of the section
_OFF_TARGET = 0.12  # by which it misses the middle of what it hides, likewise


def marker_side(preset: Preset, rig: StereoRig) -> float:
    """Return the side of a marker's black border [m]."""
    return rig.marker_size * preset.section_length


def marker_corners(side: float) -> Array:
    """Return the corners of a marker in its own axes (4, 3), from the upper left one clockwise [m].

    Its axes are x to the right, y down and z into it.
    """
    return side / 2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def marker_plates(preset: Preset, rig: StereoRig) -> list[Plate]:
    """Return the plates of the markers of a rig's method, in front of the shaft and of the tip."""
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
    return np.where(picture > 127, _PAPER, _INK).astype(np.uint8)


class Bench:
    """Scene of a rig, which its two cameras take pictures of; `optics` are the true ones, left and right."""

    def __init__(self, preset: Preset, rig: StereoRig) -> None:
        self.rig, self.preset = rig, preset
        self.optics = mounted_cameras(preset, rig)
        self._lenses = [Lens(one) for one in self.optics]
        plates = [board_plate(board_square(preset))]
        plates += marker_plates(preset, rig)

        def add(spec: Any) -> None:
            for plate in plates:
                add_plate(spec, plate)
            radius, length = (share * preset.section_length for share in _ROD)
            add_rod(spec, "rod", radius, length)

        self._drawn = DrawnEndoscope(preset, sleeve="whole", more=add)
        self._drawn.open_canvas(self._lenses[0].width, self._lenses[0].height)

    def take(self, scene: Callable[[float], None], speed: float, rng: np.random.Generator) -> Pair:
        """Take a picture with each camera, at the same time, of a motion at a speed [pixels / s].

        `scene` places everything as at a time relative to that of the picture [s].
        """
        when = instants(self.rig, speed)
        weights = row_weights(self.rig, when)
        pictures = []
        for lens in self._lenses:

            def light(instant: float, lens: Lens = lens) -> Grey:
                scene(instant)
                return lens.bend(self._light(lens))

            pictures.append(develop(expose(light, when, weights), self.rig, rng))
        return pictures[0], pictures[1]

    def stand(self, links: Frames, index: int) -> None:
        """Place the endoscope in a pose, frames as in `link_frames`, without board and rod."""
        self._drawn.stand(links, index)
        self._drawn.place("rod", AWAY, np.eye(3))

    def set_up(self) -> None:
        """Place the shaft, and take the board away."""
        self._drawn.hide()
        self._drawn.place("base", np.zeros(3), np.eye(3))
        self._drawn.place_sheath(sheath_frames(self.preset, 0.0))

    def pass_rod(self, middle: Array, along: Array) -> None:
        """Place the rod: its middle (3,) [m], and the unit vector (3,) along it."""
        across = np.cross(along, [0.0, 1.0, 0.0])
        across /= np.linalg.norm(across)
        self._drawn.place("rod", middle, np.column_stack([along, across, np.cross(along, across)]))

    def show_board(self, position: Array, rotation: Array) -> None:
        """Show the calibration board alone: its middle (3,) [m], and its axes (3, 3)."""
        self._drawn.hide()
        self._drawn.place("board", position, rotation)

    def _light(self, lens: Lens) -> Grey:
        layer = self._drawn.draw(lens.view)
        through = 1 - layer[..., 3].astype(np.float32) / 255
        picture = layer[..., :3].astype(np.float32) @ _LUMA + np.float32(_BACKDROP) * through
        return picture.astype(np.float32)


def instants(rig: StereoRig, speed: float) -> Array:
    """Return the instants (n,) at which a scene is drawn for one picture, relative to its time [s]."""
    span = rig.exposure_s + rig.rolling_shutter_s
    moved = speed * span
    count = 1 if moved < _STILL_PX else min(int(np.ceil(moved)) + 1, MOST_INSTANTS)
    return np.linspace(-span / 2, span / 2, count) if count > 1 else np.zeros(1)


def row_weights(rig: StereoRig, when: Array) -> Array:
    """Return the share that the scene at each instant has in each row of a picture, (instants, rows).

    Row r is open from t_r - exposure / 2 to t_r + exposure / 2, where t_r goes from - rolling / 2 to
    + rolling / 2 down the picture. The scene is taken to be linear between two instants.
    """
    middle = (np.arange(rig.height) / max(rig.height - 1, 1) - 0.5) * rig.rolling_shutter_s
    if len(when) == 1:
        return np.ones((1, rig.height))
    fine = np.linspace(-0.5, 0.5, 33) * rig.exposure_s
    place = np.interp(middle[:, None] + fine, when, np.arange(len(when)))
    hats = np.clip(1 - np.abs(place[..., None] - np.arange(len(when))), 0, 1)
    weights: Array = hats.mean(axis=1).T
    weights /= weights.sum(axis=0)
    return weights


def expose(scene: Callable[[float], Grey], when: Sequence[float] | Array, weights: Array) -> Grey:
    """Return the mean of a scene (height, width) over instants, row by row."""
    parts = (
        scene(float(instant)) * rows[:, None].astype(np.float32)
        for instant, rows in zip(when, weights, strict=True)
    )
    return functools.reduce(np.add, parts)


def develop(picture: Grey, rig: StereoRig, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return the grey levels that a sensor gives for light (height, width), 0 to 255.

    Blur, gain, noise and saturation; the variance of the noise is that of reading and that of counting
    photons, which grows with the light.
    """
    if rig.blur_px > 0:
        picture = cv2.GaussianBlur(picture, (0, 0), rig.blur_px)
    light = rig.brightness * np.clip(picture, 0, None)
    variance = rig.pixel_noise**2 * (1 - _SHOT_SHARE + _SHOT_SHARE * light / 128)
    noisy = light + np.sqrt(variance) * rng.standard_normal(light.shape, dtype=np.float32)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


class Motion:
    """Poses of an episode at any time, linear between samples; `tip` (N, 3) is its place at each [m]."""

    def __init__(self, episode: Episode, preset: Preset) -> None:
        self._time, self._length = episode.time, preset.section_length
        self._own, self._lateral = hinge_angles_of(episode), episode.lateral_joint_angle
        self.tip = link_frames(self._own, self._lateral, self._length).position[:, -1]

    def links_at(self, time: float) -> Frames:
        """Return the frames of the links at a time [s], (1, vertebrae + 1)."""
        own = self._at(self._own, time)
        lateral = self._at(self._lateral, time) if len(self._lateral) else self._lateral
        return link_frames(own, lateral, self._length)

    def speed(self, sample: int) -> float:
        """Return the speed of the tip about a sample [m / s]."""
        before, after = max(sample - 1, 0), min(sample + 1, len(self._time) - 1)
        travel = np.linalg.norm(self.tip[after] - self.tip[before])
        return float(travel / (self._time[after] - self._time[before]))

    def _at(self, values: Array, instant: float) -> Array:
        """Return values (N, columns) at an instant, (1, columns); outside, those of the ends."""
        time = self._time
        after = int(np.clip(np.searchsorted(time, instant), 1, len(time) - 1))
        share = np.clip((instant - time[after - 1]) / (time[after] - time[after - 1]), 0.0, 1.0)
        between: Array = (1 - share) * values[after - 1 : after] + share * values[after : after + 1]
        return between


@dataclasses.dataclass(frozen=True)
class Pass:
    """Pass of the rod."""

    start: float  # when it comes into sight [s]
    end: float  # when it is gone [s]
    entry: Array  # (3,) place of its middle at the start [m]
    exit: Array  # (3,) place of its middle at the end [m]
    along: Array  # (3,) unit vector along it

    def middle(self, time: float) -> Array | None:
        """Return the place of its middle at a time [s]; None where it is not in sight."""
        if not self.start <= time <= self.end:
            return None
        share = (time - self.start) / (self.end - self.start)
        place: Array = self.entry + share * (self.exit - self.entry)
        return place


def draw_passes(
    rig: StereoRig, time: Array, tip: Array, section_length: float, rng: np.random.Generator
) -> list[Pass]:
    """Draw the passes of an episode, a Poisson process; each crosses in front of the tip or of the shaft.

    `time` (N,) is that of the samples [s], `tip` (N, 3) the place of the tip and `section_length` in [m].
    """
    seconds = float(time[-1] - time[0])
    count = int(rng.poisson(rig.occlusions_per_minute * seconds / 60))
    passes = []
    for start in np.sort(rng.uniform(0, seconds, count)) + time[0]:
        end = start + rng.uniform(*_SECONDS)
        at = int(np.clip(np.searchsorted(time, (start + end) / 2), 0, len(time) - 1))
        hidden = tip[at] if rng.uniform() < 0.7 else np.array([-0.2 * section_length, 0.0, 0.0])
        hidden = hidden + _OFF_TARGET * section_length * rng.standard_normal(3)
        towards = np.array([0.0, -rig.distance * section_length, 0.0])
        centre = hidden + rng.uniform(*_NEARNESS) * towards
        angle = rng.uniform(0, 2 * np.pi)
        along = np.array([np.cos(angle), 0.0, np.sin(angle)])
        travel = _SWEEP * section_length * np.array([-along[2], 0.0, along[0]])
        passes.append(Pass(float(start), float(end), centre - travel, centre + travel, along))
    return passes
