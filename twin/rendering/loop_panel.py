"""Animated hysteresis loop: static axes by matplotlib, the moving trace by Pillow."""

import numpy as np
from matplotlib import get_data_path
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

INK = "#1d232c"
MUTED = "#7a838f"
TRACE = "#b3261e"
_WHOLE_LOOP = "#d3d8de"
_DPI = 100
_OVERSAMPLING = 3  # Pillow's lines have hard edges: they are drawn larger, and reduced


class LoopPanel:
    """Plot of bending angle over pulling distance that can be drawn up to any sample."""

    def __init__(self, pull_mm: Array, bend_deg: Array, width: int, height: int) -> None:
        """Draw the static parts: axes, labels and, pale, the whole loop.

        Args:
            pull_mm: (N,) pulling distance [mm].
            bend_deg: (N,) bending angle [deg].
            width: of the panel [pixels].
            height: of the panel [pixels].
        """
        figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
        canvas = FigureCanvasAgg(figure)
        size = height / 720  # text and lines grow with the picture
        axes = figure.add_axes((0.15, 0.13, 0.77, 0.77))
        axes.plot(pull_mm, bend_deg, color=_WHOLE_LOOP, linewidth=1.6 * size, solid_joinstyle="round")
        style_axes(axes, size)
        canvas.draw()
        self._background = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
        pixels = axes.transData.transform(np.column_stack([pull_mm, bend_deg]))
        self._points = np.column_stack([pixels[:, 0], height - pixels[:, 1]]) * _OVERSAMPLING
        self._line = round(2.4 * size * _OVERSAMPLING)
        self._dot = 7.0 * size * _OVERSAMPLING

    def draw(self, index: int) -> Picture:
        """Return the panel (height, width, 3) with the loop up to and including sample `index`."""
        width, height = self._background.size
        mask = Image.new("L", (width * _OVERSAMPLING, height * _OVERSAMPLING))
        pen = ImageDraw.Draw(mask)
        pen.line([tuple(point) for point in self._points[: index + 1]], 255, self._line, joint="curve")
        x, y = self._points[index]
        pen.ellipse((x - self._dot, y - self._dot, x + self._dot, y + self._dot), 255)
        panel = self._background.copy()
        panel.paste(TRACE, (0, 0, width, height), mask.reduce(_OVERSAMPLING))
        return np.asarray(panel)


def style_axes(axes: Axes, size: float = 1.0) -> None:
    """Style the axes of a loop: labels, a faint grid and no frame; `size` scales text and lines."""
    axes.set_xlabel("pulling distance [mm]", fontsize=13 * size, color=INK, labelpad=7 * size)
    axes.set_ylabel("bending angle [deg]", fontsize=13 * size, color=INK, labelpad=5 * size)
    axes.tick_params(labelsize=11 * size, colors=MUTED, length=0, pad=6 * size)
    axes.grid(color="#edf0f3", linewidth=0.9 * size)
    axes.set_axisbelow(True)
    axes.margins(0.06)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color="#c3c9d0", linewidth=0.9 * size)


def font(size: float, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return the font of the axes for text that Pillow writes, `size` pixels high."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/{name}", size)
