"""Actor: the endoscope of an episode, which stands before a camera as the record says.

An episode holds the angle of every hinge, so nothing is simulated again: the recorded pose is set and drawn.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from twin.episode import Episode
from twin.physics.endoscope import Endoscope
from twin.physics.view import SideView
from twin.preset.preset import Preset
from twin.rendering.trace_panel import Picture

Array = NDArray[np.float64]


class Actor:
    """Endoscope of one episode, its poses and the camera before it.

    Attributes:
        chain: (N, vertebrae + 1, 2) ends of the links, base to tip, as seen from the side: (x, z) [m].
    """

    def __init__(self, episode: Episode) -> None:
        """Build the model of the episode's preset.

        Args:
            episode: the record; one without hinge angles (a measured one) stands with a constant curvature.
        """
        self._joint_angle = _joint_angle(episode)
        self._lateral = episode.lateral_joint_angle
        preset = _preset(episode, self._joint_angle.shape[1])
        self._endoscope = Endoscope.from_preset(preset)
        self.chain = _chain(self._joint_angle, self._lateral, preset.section_length)

    def face(self, centre: Array, half_height: float, width: int, height: int) -> None:
        """Place the camera, as of `SideView`.

        Raises:
            OSError: nothing on this system can draw without a screen.
        """
        self._view = SideView(self._endoscope, centre, half_height, width, height)

    def picture(self, index: int) -> Picture:
        """Return a picture at sample `index`, on white; the camera must have been placed."""
        self._endoscope.set_pose(
            self._joint_angle[index], self._lateral[index] if len(self._lateral) else None
        )
        return self._view.picture()


def _joint_angle(episode: Episode) -> Array:
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


def _preset(episode: Episode, vertebrae: int) -> Preset:
    """Return a preset of the shape stated in the metadata of the episode; else one of default size."""
    recorded = episode.metadata.get("preset") or {}
    shape = {
        name: recorded[name]
        for name in ("section_length", "wire_offset", "sheath_length", "bending_planes")
        if name in recorded
    }
    return Preset(name="recorded").replace(vertebrae=vertebrae, **shape)


def _chain(joint_angle: Array, lateral: Array, section_length: float) -> Array:
    """Return the ends of the links, base to tip, as seen from the side: (N, vertebrae + 1, 2) as (x, z) [m].

    Every hinge turns the link after it about -y, and then, with two bending planes, about z.
    """
    count, vertebrae = joint_angle.shape
    lateral = lateral if len(lateral) else np.zeros_like(joint_angle)
    turned = Rotation.identity(count)
    ends = np.zeros((count, vertebrae + 1, 2))
    for index in range(vertebrae):
        hinges = np.stack([-joint_angle[:, index], lateral[:, index]], axis=1)
        turned = turned * Rotation.from_euler("YZ", hinges)
        along = turned.apply([1.0, 0.0, 0.0]) * section_length / vertebrae
        ends[:, index + 1] = ends[:, index] + along[:, [0, 2]]
    return ends
