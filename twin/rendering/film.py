"""Frames of an episode: the recorded poses before a camera that keeps all of them in view, and the loop.

An episode holds the angle of every hinge, so nothing is simulated again: the recorded pose is set and drawn.
"""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.spatial.transform import Rotation

from twin.episode import Episode
from twin.errors import InputError
from twin.physics.endoscope import Endoscope
from twin.physics.view import SideView
from twin.preset.preset import Preset
from twin.rendering.loop_panel import INK, MUTED, TRACE, LoopPanel, Picture, font

Array = NDArray[np.float64]

WIDTH, HEIGHT = 1280, 720


class Film:
    """Renderer of one episode: endoscope, camera and loop panel; each frame is drawn on demand."""

    def __init__(self, episode: Episode, width: int = WIDTH, height: int = HEIGHT) -> None:
        """Build the model of the episode's preset and draw the static parts.

        Args:
            episode: the record; one without hinge angles (a measured one) is drawn with a constant curvature.
            width: of a frame [pixels], even; its left half shows the endoscope, its right half the loop.
            height: of a frame [pixels], even.

        Raises:
            ValueError: a size is odd or out of range.
            OSError: nothing on this system can draw without a screen.
        """
        if width % 2 or height % 2 or not (160 <= width <= 2560 and 120 <= height <= 1280):
            raise InputError(f"size {width} x {height}: both must be even, from 160 x 120 to 2560 x 1280")
        self.episode = episode
        self.width, self.height = width, height
        self._scene_width = width // 2
        self._joint_angle = _joint_angle(episode)
        preset = _preset(episode, self._joint_angle.shape[1])
        self._endoscope = Endoscope.from_preset(preset)
        self._chain = _chain(self._joint_angle, episode.lateral_joint_angle, preset.section_length)
        self._centre, self._half_height = _framing(self._chain, self._scene_width / height)
        self._view = SideView(self._endoscope, self._centre, self._half_height, self._scene_width, height)
        self._panel = LoopPanel(episode.pull_mm, episode.bend_deg, width - self._scene_width, height)

    def pose(self, index: int) -> Picture:
        """Return a picture of the endoscope alone at sample `index`, on white, (height, width / 2, 3)."""
        lateral = self.episode.lateral_joint_angle
        self._endoscope.set_pose(self._joint_angle[index], lateral[index] if len(lateral) else None)
        return self._view.picture()

    def tip(self, index: int) -> tuple[float, float]:
        """Return the position of the tip in the picture `pose(index)`, as (column, row) [pixels]."""
        column, row = self._pixels(self._chain[index, -1])
        return float(column), float(row)

    def frame(self, index: int) -> Picture:
        """Return the frame of sample `index`, (height, width, 3): endoscope, numbers and loop."""
        scene = Image.fromarray(self.pose(index))
        self._write_numbers(ImageDraw.Draw(scene), index)
        return np.concatenate([np.asarray(scene), self._panel.draw(index)], axis=1)

    def scale_bar(self) -> tuple[float, float]:
        """Return the length of a scale bar that fits the picture: (millimetres, pixels)."""
        visible_mm = 2e3 * self._half_height
        length_mm = max(step for step in (1, 2, 5, 10, 20, 50, 100) if step <= max(visible_mm / 5, 1))
        return length_mm, length_mm / visible_mm * self.height

    def _write_numbers(self, pen: ImageDraw.ImageDraw, index: int) -> None:
        unit = self.height / 720  # text grows with the picture
        left, small = 36 * unit, font(17 * unit)
        pen.text((left, 32 * unit), "bending angle", MUTED, small)
        bend = f"{self.episode.bend_deg[index]:+z.1f}°"
        pen.text((left, 54 * unit), bend, TRACE, font(46 * unit, bold=True))
        pull = f"pull {self.episode.pull_mm[index]:+z.2f} mm"
        pen.text((left, 114 * unit), pull, INK, small)
        pen.text((left, 140 * unit), f"time {self.episode.time[index]:.1f} s", MUTED, small)
        length_mm, length = self.scale_bar()
        bottom = self.height - 40 * unit
        pen.line((left, bottom, left + length, bottom), INK, max(round(2 * unit), 1))
        pen.text((left, bottom - 28 * unit), f"{length_mm:g} mm", MUTED, small)

    def _pixels(self, position: Array) -> Array:
        """Project points (..., 2) of the bending plane [m] to pixels (..., 2), as (column, row)."""
        scaled = (position - self._centre) / self._half_height * self.height / 2
        return np.array([self._scene_width / 2, self.height / 2]) + scaled * [1, -1]


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


def _framing(chain: Array, aspect: float) -> tuple[Array, float]:
    """Return centre (2,) and half the height [m] of a view of aspect ratio `aspect` that holds every pose."""
    reach = np.linalg.norm(np.diff(chain[0], axis=0), axis=1).sum()
    low = np.minimum(chain.min(axis=(0, 1)), [-0.22 * reach, -0.30 * reach])
    high = np.maximum(chain.max(axis=(0, 1)), [0.75 * reach, 0.30 * reach])
    half = (high - low) / 2
    return (high + low) / 2, float(1.16 * max(half[1], half[0] / aspect))
