"""Actor: the endoscope of an episode in its recorded poses, its wires coloured by their tension.

An episode holds the angle of every hinge, so nothing is simulated: the recorded pose is set and drawn.
"""

import dataclasses

import matplotlib
import numpy as np
from numpy.typing import NDArray

from twin.episode import WIRE_COLOURS, WIRES, Episode
from twin.mechanics.kinematics import Frames, link_frames
from twin.physics.drawing.canvas import Layer, View
from twin.physics.drawing.drawn import DrawnEndoscope
from twin.physics.drawing.surfaces import sheath_frames
from twin.preset.preset import Preset

Array = NDArray[np.float64]
PLAIN = np.array(WIRE_COLOURS)
_MAP, _DARK, _BRIGHT = "inferno", 0.28, 0.93
_SHAPE = "section_length wire_offset sheath_bend sheath_elements sheath_length pulley_radius bending_planes"


@dataclasses.dataclass(frozen=True)
class TensionColours:
    """Scale of colours from no tension to the highest [N]: brighter where pulled, also in greyscale."""

    highest_n: float

    @classmethod
    def of(cls, *episodes: Episode) -> "TensionColours | None":
        """Return the scale that holds every tension of episodes; None where none was recorded in any."""
        top = max(
            (episode.wire_tension.max() for episode in episodes if episode.wire_tension.size), default=0.0
        )
        if top <= 0:
            return None
        steps = np.array([1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10]) * 10.0 ** np.floor(np.log10(top))
        return cls(float(steps[np.searchsorted(steps, top * (1 - 1e-9))]))

    def __call__(self, tension: Array) -> Array:
        """Return red, green and blue (..., 3), from 0 to 1, of tensions (...) [N]."""
        share = np.clip(tension / self.highest_n, 0.0, 1.0)
        colours: Array = matplotlib.colormaps[_MAP](_DARK + share * (_BRIGHT - _DARK))[..., :3]
        return colours


class Actor:
    """Endoscope of an episode and its poses, `links` (N, vertebrae + 1); an arc where none is recorded."""

    def __init__(
        self,
        episode: Episode,
        scene: str = "bench",
        sleeve: str = "cut",
        colours: TensionColours | None = None,
        *,
        pale: bool = False,
    ) -> None:
        self.episode = episode
        joint_angle = hinge_angles_of(episode)
        self.preset = shape_of(episode, joint_angle.shape[1])
        self.links = link_frames(joint_angle, episode.lateral_joint_angle, self.preset.section_length)
        self._is_overview = scene == "overview"
        self._colours = colours if episode.wire_tension.size else None
        self._drawn = DrawnEndoscope(self.preset, scene, sleeve, pale=pale)
        self._drawn.paint_wires(PLAIN[: len(WIRES[: self.preset.wires]), None])

    @property
    def chain(self) -> Array:
        """(N, vertebrae + 1, 3) ends of the links, base to tip [m]."""
        return self.links.position

    def sheath(self, index: int) -> Frames:
        """Return the frames along the drawn sheath at a sample, from the base to the pulley."""
        bend = self.episode.sheath_bend
        return sheath_frames(self.preset, bend[index] if len(bend) else self.preset.sheath_bend)

    def open_canvas(self, width: int, height: int) -> None:
        """Open the renderer for pictures of a size [pixels]."""
        self._drawn.open_canvas(width, height)

    def layer(self, index: int, view: View) -> Layer:
        """Return a picture at sample `index`; the canvas must have been opened."""
        self._drawn.stand(self.links, index)
        if self._colours is not None:
            self._drawn.paint_wires(self._colours(self.episode.wire_tension[index]))
        if self._is_overview:
            self._set_drive(index)
        return self._drawn.draw(view)

    def _set_drive(self, index: int) -> None:
        episode, frames = self.episode, self.sheath(index)
        self._drawn.place_sheath(frames)
        pulls = (episode.pulley if len(episode.pulley) else episode.pull, episode.lateral_pull)
        for plane, pull in enumerate(pulls[: self.preset.bending_planes]):
            self._drawn.turn_wheel(plane, float(pull[index]) if len(pull) else 0.0, frames)


def hinge_angles_of(episode: Episode) -> Array:
    """Return the recorded hinge angles (N, vertebrae) [rad]; without them, a constant curvature."""
    recorded = episode.joint_angle
    is_complete = recorded.ndim == 2 and recorded.shape[1] > 0
    if is_complete and np.allclose(recorded.sum(axis=1), episode.bend, atol=1e-3):
        return recorded
    vertebrae = Preset(name="shape").vertebrae
    return np.repeat(episode.bend[:, None] / vertebrae, vertebrae, axis=1)


def shape_of(episode: Episode, vertebrae: int) -> Preset:
    """Return a preset of the shape stated in the metadata of the episode; else one of default size."""
    recorded = episode.metadata.get("preset") or {}
    shape = {name: recorded[name] for name in _SHAPE.split() if name in recorded}
    return Preset(name="recorded").replace(vertebrae=vertebrae, **shape)
