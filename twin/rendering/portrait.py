"""Portraits of an endoscope alone, on white: of a record, or while it is simulated, by either twin."""

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.mechanics.kinematics import link_frames
from twin.physics.drawing.canvas import View
from twin.physics.drawing.drawn import DrawnEndoscope
from twin.preset.preset import Preset
from twin.rendering.actor import PLAIN, Actor, TensionColours
from twin.rendering.cameras import shot
from twin.rendering.look import WHITE
from twin.rendering.picture import Picture, on_paper

SIZE = 480
"""Width and height of a picture of a simulation [pixels]."""
_AHEAD, _HALF_HEIGHT = 0.35, 0.9
"""Centre of the view in front of the base, and half its height, in lengths of the section.

They hold every arc of constant curvature, whose tip goes from -0.22 to 1 lengths ahead and 0.73 to a side.
"""


class EpisodePortrait:
    """Side view of the endoscope of an episode, in a frame that holds all of its poses."""

    def __init__(self, episode: Episode, width: int, height: int) -> None:
        """Place the camera, for pictures of a size [pixels]."""
        self._actor = Actor(episode, colours=TensionColours.of(episode))
        self._view = shot("side", [self._actor], width / height).view
        self._actor.open_canvas(width, height)

    def picture(self, index: int) -> Picture:
        """Return a picture on white at a sample, (height, width, 3)."""
        return on_paper(self._actor.layer(index, self._view(self._actor, index)), WHITE)


class Portrait:
    """Drawing of a simulated endoscope in its pose; only the hinge angles are read."""

    def __init__(self, preset: Preset) -> None:
        """Build the double and place the camera."""
        self._drawn = DrawnEndoscope(preset)
        self._drawn.paint_wires(PLAIN[: preset.wires, None])
        length = preset.section_length
        self._view = View(
            position=np.array([_AHEAD * length, -4 * length, 0.0]),
            forward=np.array([0.0, 1.0, 0.0]),
            up=np.array([0.0, 0.0, 1.0]),
            half_height=_HALF_HEIGHT * length,
            parallel=True,
        )
        self._drawn.open_canvas(SIZE, SIZE)

    def picture(self, joint_angle: NDArray[np.float64]) -> Picture:
        """Return a picture on white, (`SIZE`, `SIZE`, 3), at hinge angles (vertebrae,) [rad]."""
        length = self._drawn.preset.section_length
        self._drawn.stand(link_frames(joint_angle[None], np.empty(0), length), 0)
        return on_paper(self._drawn.draw(self._view), WHITE)
