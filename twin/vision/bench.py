"""Bench before the cameras: the endoscope with its markers, the calibration board, a rod that passes by."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.physics.drawing.drawn import DrawnEndoscope
from twin.physics.drawing.frames import Frames, sheath_frames
from twin.physics.drawing.targets import AWAY, add_plate, add_rod
from twin.preset.preset import Preset
from twin.vision.cameras import mounted_cameras
from twin.vision.exposure import Grey, develop, expose, instants, row_weights
from twin.vision.optics import Lens
from twin.vision.rig import StereoRig
from twin.vision.targets import board_plate, board_square, marker_plates

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
"""(height, width) grey levels."""
Pair = tuple[Picture, Picture]
"""Left and right picture."""

_BACKDROP = 190.0  # grey level behind everything
_ROD = (0.06, 4.0)  # radius and length, in lengths of the section
_LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)


class Bench:
    """Scene of a rig, which its two cameras take pictures of.

    Attributes:
        optics: the true cameras, left and right.
    """

    def __init__(self, preset: Preset, rig: StereoRig) -> None:
        """Build the scene and mount the cameras.

        Args:
            preset: the endoscope.
            rig: of the cameras; its seed draws the tolerances of their mounting.

        Raises:
            OSError: nothing on this system can draw without a screen.
        """
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
        """Take a picture with each camera, at the same time.

        Args:
            scene: places everything as it is at an instant about that of the picture [s].
            speed: of what moves, in the picture [pixels / s].
            rng: noise of the pixels.
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
        """Place the endoscope in a pose, as of `frames.link_frames`, without board and rod."""
        self._drawn.stand(links, index)
        self._drawn.place("rod", AWAY, np.eye(3))

    def set_up(self) -> None:
        """Place the shaft, and take the board away."""
        self._drawn.hide()
        self._drawn.place("base", np.zeros(3), np.eye(3))
        self._drawn.place_sheath(sheath_frames(self.preset, 0.0))

    def pass_rod(self, middle: Array, along: Array) -> None:
        """Hold the rod before the cameras: its middle (3,) [m], and the unit vector (3,) along it."""
        across = np.cross(along, [0.0, 1.0, 0.0])
        across /= np.linalg.norm(across)
        self._drawn.place("rod", middle, np.column_stack([along, across, np.cross(along, across)]))

    def show_board(self, position: Array, rotation: Array) -> None:
        """Hold the calibration board alone before the cameras: its middle (3,) [m], and its axes (3, 3)."""
        self._drawn.hide()
        self._drawn.place("board", position, rotation)

    def _light(self, lens: Lens) -> Grey:
        """Return the grey picture of a pinhole, on the backdrop."""
        layer = self._drawn.draw(lens.view)
        through = 1 - layer[..., 3].astype(np.float32) / 255
        picture = layer[..., :3].astype(np.float32) @ _LUMA + np.float32(_BACKDROP) * through
        return picture.astype(np.float32)
