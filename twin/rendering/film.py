"""Frames of an episode: its poses before a camera that keeps all in view, and the panel beside them."""

from typing import Any

import numpy as np
from matplotlib import get_data_path
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from twin.episode import Episode
from twin.errors import InputError
from twin.rendering.actor import Actor
from twin.rendering.beside import NOTHING, Beside
from twin.rendering.loop_panel import LoopPanel
from twin.rendering.time_panel import TimePanel
from twin.rendering.trace_panel import INK, MUTED, TRACE, Picture

Array = NDArray[np.float64]

WIDTH, HEIGHT = 1280, 720
GHOST_INK = 0.3
"""Share of its ink that a ghost is drawn with."""


class Film:
    """Renderer of one episode: endoscope, ghost, camera and panel; each frame is drawn on demand."""

    def __init__(
        self, episode: Episode, width: int = WIDTH, height: int = HEIGHT, beside: Beside = NOTHING
    ) -> None:
        """Build the model of the episode's preset and draw the static parts.

        Args:
            episode: the record; one without hinge angles (a measured one) is drawn with a constant curvature.
            width: of a frame [pixels], even; its left half shows the endoscope, its right half the loop, or
                the course of the bend where a reference is known.
            height: of a frame [pixels], even.
            beside: what is drawn with the episode.

        Raises:
            ValueError: a size is odd or out of range, or what is beside is not at the times of the episode.
            OSError: nothing on this system can draw without a screen.
        """
        if width % 2 or height % 2 or not (160 <= width <= 2560 and 120 <= height <= 1280):
            raise InputError(f"size {width} x {height}: both must be even, from 160 x 120 to 2560 x 1280")
        beside.check(episode)
        self.episode, self.beside = episode, beside
        self.width, self.height = width, height
        self._scene_width = width // 2
        self._actors = [Actor(one) for one in (episode, beside.ghost) if one is not None]
        chains = [actor.chain for actor in self._actors]
        self._centre, self._half_height = _framing(chains, self._scene_width / height)
        for actor in self._actors:
            actor.face(self._centre, self._half_height, self._scene_width, height)
        panel = TimePanel if beside.has_reference else LoopPanel
        self._panel = panel(episode, width - self._scene_width, height, beside)

    def pose(self, index: int) -> Picture:
        """Return a picture of the endoscope alone at sample `index`, on white, (height, width / 2, 3)."""
        return self._actors[0].picture(index)

    def scene(self, index: int) -> Picture:
        """Return `pose(index)` with the pose of the ghost, if there is one, pale behind it."""
        picture = self.pose(index)
        for ghost in self._actors[1:]:
            picture = over(picture, pale(ghost.picture(index), GHOST_INK)).astype(np.uint8)
        return picture

    def tip(self, index: int, actor: int = 0) -> tuple[float, float]:
        """Return the position of the tip in the picture `pose(index)`, as (column, row) [pixels].

        Args:
            index: of the sample.
            actor: 1 for the tip of the ghost.
        """
        column, row = self._pixels(self._actors[actor].chain[index, -1])
        return float(column), float(row)

    def frame(self, index: int) -> Picture:
        """Return the frame of sample `index`, (height, width, 3): endoscope, numbers and panel."""
        scene = Image.fromarray(self.scene(index))
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
        if self.beside.ghost is not None:
            ghost = f"ghost {self.beside.ghost.bend_deg[index]:+z.1f}°"
            pen.text((left, 166 * unit), ghost, MUTED, small)
        length_mm, length = self.scale_bar()
        bottom = self.height - 40 * unit
        pen.line((left, bottom, left + length, bottom), INK, max(round(2 * unit), 1))
        pen.text((left, bottom - 28 * unit), f"{length_mm:g} mm", MUTED, small)

    def _pixels(self, position: Array) -> Array:
        """Project points (..., 2) of the bending plane [m] to pixels (..., 2), as (column, row)."""
        scaled = (position - self._centre) / self._half_height * self.height / 2
        return np.array([self._scene_width / 2, self.height / 2]) + scaled * [1, -1]


def pale(picture: NDArray[Any], ink: float) -> Array:
    """Return a picture on white, (height, width, 3), with a share of its ink."""
    lighter: Array = 255 - ink * (255.0 - picture)
    return lighter


def over(solid: NDArray[Any], behind: NDArray[Any]) -> Array:
    """Return a picture on white, (height, width, 3), in front of another."""
    cover = np.clip((255.0 - solid.min(axis=-1, keepdims=True)) / 25, 0, 1)
    picture: Array = cover * solid + (1 - cover) * behind
    return picture


def font(size: float, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return the font of the axes for text that Pillow writes, `size` pixels high."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/{name}", size)


def _framing(chains: list[Array], aspect: float) -> tuple[Array, float]:
    """Return centre (2,) and half the height [m] of a view of aspect ratio `aspect` that holds every pose."""
    reach = max(np.linalg.norm(np.diff(chain[0], axis=0), axis=1).sum() for chain in chains)
    low = np.min([[-0.22 * reach, -0.30 * reach], *(chain.min(axis=(0, 1)) for chain in chains)], axis=0)
    high = np.max([[0.75 * reach, 0.30 * reach], *(chain.max(axis=(0, 1)) for chain in chains)], axis=0)
    half = (high - low) / 2
    return (high + low) / 2, float(1.16 * max(half[1], half[0] / aspect))
