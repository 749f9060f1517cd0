"""Animated plot of a curve: static axes by matplotlib, the moving trace by Pillow."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

INK = "#1d232c"
MUTED = "#7a838f"
TRACE = "#b3261e"
GHOST = "#9aa3ae"
PALE = "#d3d8de"
DASHED = (0, (3.2, 2.0))
_DPI = 100
_OVERSAMPLING = 3  # Pillow's lines have hard edges: they are drawn larger, and reduced


class Curve(NamedTuple):
    """Curve that stands still, in the units of the axes.

    Attributes:
        x: (N,) along the horizontal axis.
        y: (N,) along the vertical one; a gap where it is NaN.
        colour: of its line.
        dashed: whether its line is.
        name: of it in the legend; none without.
        width: of its line, where text has a height of 13.
    """

    x: Array
    y: Array
    colour: str
    dashed: bool = False
    name: str = ""
    width: float = 1.6


class TracePanel:
    """Plot of bending angle over something else that can be drawn up to any sample."""

    def __init__(
        self, x: Array, bend_deg: Array, x_label: str, still: Sequence[Curve], width: int, height: int
    ) -> None:
        """Draw the static parts: axes, labels, legend and the curves that stand still.

        Args:
            x: (N,) of the trace, in the unit of the horizontal axis.
            bend_deg: (N,) bending angle of the trace [deg].
            x_label: quantity and unit of the horizontal axis.
            still: curves that stand still behind the trace.
            width: of the panel [pixels].
            height: of the panel [pixels].
        """
        figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
        canvas = FigureCanvasAgg(figure)
        size = height / 720  # text and lines grow with the picture
        axes = figure.add_axes((0.15, 0.13, 0.77, 0.77))
        draw_curves(axes, still, x_label, size)
        canvas.draw()
        self._background = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
        pixels = axes.transData.transform(np.column_stack([x, bend_deg]))
        self._points = np.column_stack([pixels[:, 0], height - pixels[:, 1]]) * _OVERSAMPLING
        self._line = round(2.4 * size * _OVERSAMPLING)
        self._dot = 7.0 * size * _OVERSAMPLING

    def draw(self, index: int) -> Picture:
        """Return the panel (height, width, 3) with the trace up to and including sample `index`."""
        width, height = self._background.size
        mask = Image.new("L", (width * _OVERSAMPLING, height * _OVERSAMPLING))
        pen = ImageDraw.Draw(mask)
        pen.line([tuple(point) for point in self._points[: index + 1]], 255, self._line, joint="curve")
        x, y = self._points[index]
        pen.ellipse((x - self._dot, y - self._dot, x + self._dot, y + self._dot), 255)
        panel = self._background.copy()
        panel.paste(TRACE, (0, 0, width, height), mask.reduce(_OVERSAMPLING))
        return np.asarray(panel)


def draw_curves(axes: Axes, curves: Sequence[Curve], x_label: str, size: float = 1.0) -> None:
    """Draw curves over one another, with a legend above them of those that have a name."""
    lines = [
        axes.plot(
            curve.x,
            curve.y,
            color=curve.colour,
            linewidth=curve.width * size,
            linestyle=DASHED if curve.dashed else "-",
            solid_joinstyle="round",
        )[0]
        for curve in curves
    ]
    style_axes(axes, size, x_label)
    # What is drawn last, and lies in front, is named first.
    named = [(line, curve.name) for line, curve in zip(lines, curves, strict=True) if curve.name][::-1]
    if not named:
        return
    legend = axes.legend(
        *zip(*named, strict=True),
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=len(named),
        frameon=False,
        fontsize=11 * size,
        labelcolor=INK,
        borderaxespad=0.3,
        borderpad=0.2,
        handlelength=2.2,
        handletextpad=0.5,
        columnspacing=1.6,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)  # a name comes out of a file


def style_axes(axes: Axes, size: float = 1.0, x_label: str = "pulling distance [mm]") -> None:
    """Style the axes of a bending angle: labels, a faint grid, no frame; `size` scales text and lines."""
    axes.set_xlabel(x_label, fontsize=13 * size, color=INK, labelpad=7 * size)
    axes.set_ylabel("bending angle [deg]", fontsize=13 * size, color=INK, labelpad=5 * size)
    axes.tick_params(labelsize=11 * size, colors=MUTED, length=0, pad=6 * size)
    axes.grid(color="#edf0f3", linewidth=0.9 * size)
    axes.set_axisbelow(True)
    axes.margins(0.06)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color="#c3c9d0", linewidth=0.9 * size)
