"""Actor: the endoscope of an episode, which stands before a camera as the record says.

An episode holds the angle of every hinge, so nothing is simulated again: the recorded pose is set and drawn.
"""

import numpy as np
from numpy.typing import NDArray

from twin.episode import WIRES, Episode
from twin.physics.drawing.canvas import Layer, View
from twin.physics.drawing.drawn import DrawnEndoscope
from twin.physics.drawing.frames import Frames, link_frames, sheath_frames
from twin.preset.preset import Preset
from twin.rendering.tension_colours import PLAIN, TensionColours

Array = NDArray[np.float64]


class Actor:
    """Endoscope of one episode and its poses.

    Attributes:
        episode: the record.
        preset: shape and size.
        links: frames (N, vertebrae + 1) of the bending section, base to tip.
    """

    def __init__(
        self,
        episode: Episode,
        scene: str = "bench",
        sleeve: str = "cut",
        colours: TensionColours | None = None,
        *,
        pale: bool = False,
    ) -> None:
        """Build what is drawn of the episode's preset.

        Args:
            episode: the record; one without hinge angles (a measured one) stands with a constant curvature.
            scene: as of `DrawnEndoscope`.
            sleeve: likewise.
            colours: of the wires; None: each wire has its own.
            pale: True for light materials, on a dark background.
        """
        self.episode = episode
        joint_angle = hinge_angles_of(episode)
        self.preset = shape_of(episode, joint_angle.shape[1])
        self.links = link_frames(joint_angle, episode.lateral_joint_angle, self.preset.section_length)
        self._is_overview = scene == "overview"
        tension = episode.wire_tension
        self._tension = tension if colours is not None and tension.size else None
        self._colours = colours
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
        """Open the renderer for pictures of a size.

        Raises:
            OSError: nothing on this system can draw without a screen.
        """
        self._drawn.open_canvas(width, height)

    def layer(self, index: int, view: View) -> Layer:
        """Return a picture at sample `index`; the canvas must have been opened."""
        self._drawn.stand(self.links, index)
        if self._tension is not None and self._colours is not None:
            self._drawn.paint_wires(self._colours(self._tension[index]))
        if self._is_overview:
            self._set_drive(index)
        return self._drawn.draw(view)

    def _set_drive(self, index: int) -> None:
        episode = self.episode
        frames = self.sheath(index)
        self._drawn.place_sheath(frames)
        pulls = (episode.pulley if len(episode.pulley) else episode.pull, episode.lateral_pull)
        for plane, pull in enumerate(pulls[: self.preset.bending_planes]):
            self._drawn.turn_wheel(plane, float(pull[index]) if len(pull) else 0.0, frames)


def hinge_angles_of(episode: Episode) -> Array:
    """Return the recorded hinge angles (N, vertebrae) [rad]; without them, a constant curvature."""
    recorded = episode.joint_angle
    if (
        recorded.ndim == 2
        and recorded.shape[1] > 0
        and np.allclose(recorded.sum(axis=1), episode.bend, atol=1e-3)
    ):
        return recorded
    vertebrae = Preset(name="shape").vertebrae
    return np.repeat(episode.bend[:, None] / vertebrae, vertebrae, axis=1)


def shape_of(episode: Episode, vertebrae: int) -> Preset:
    """Return a preset of the shape stated in the metadata of the episode; else one of default size."""
    recorded = episode.metadata.get("preset") or {}
    names = (
        "section_length",
        "wire_offset",
        "sheath_bend",
        "sheath_elements",
        "sheath_length",
        "pulley_radius",
        "bending_planes",
    )
    shape = {name: recorded[name] for name in names if name in recorded}
    return Preset(name="recorded").replace(vertebrae=vertebrae, **shape)
