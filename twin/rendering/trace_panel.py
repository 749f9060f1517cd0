"""Animated plot of a curve: static axes by matplotlib, the moving trace by Pillow."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from twin.rendering.layers import Picture
from twin.rendering.theme import WHITE, Theme

Array = NDArray[np.float64]

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


class Plot(NamedTuple):
    """Bending angle over something else: what moves, what stands still, and the axes.

    Attributes:
        x: (N,) of the trace, in the unit of the horizontal axis.
        bend_deg: (N,) bending angle of the trace [deg].
        x_label: quantity and unit of the horizontal axis.
        y_label: the same of the vertical one.
        moving: curves that stand still behind a trace that moves.
        still: curves that tell all where nothing moves.
        over: what is along the horizontal axis: `pull` or `time`.
        is_main: whether it is of the plane of wires a and b.
        limits: ((low, high), (low, high)) of the axes; None: those of the curves.
    """

    x: Array
    bend_deg: Array
    x_label: str
    y_label: str
    moving: tuple[Curve, ...]
    still: tuple[Curve, ...]
    over: str = "pull"
    is_main: bool = True
    limits: tuple[tuple[float, float], tuple[float, float]] | None = None


class TracePanel:
    """Plot of bending angle over something else that can be drawn up to any sample."""

    def __init__(self, plot: Plot, width: int, height: int, theme: Theme = WHITE) -> None:
        """Draw the static parts: axes, labels, legend and the curves that stand still.

        Args:
            plot: what is shown.
            width: of the panel [pixels].
            height: of the panel [pixels].
            theme: colours.
        """
        figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=theme.paper)
        canvas = FigureCanvasAgg(figure)
        size = min(height / 720, width / 560)  # text and lines grow with the picture
        axes = figure.add_axes(
            panel_rectangle(width / _DPI, height / _DPI, size, legend=_has_names(plot.moving))
        )
        draw_curves(axes, plot, plot.moving, theme, size)
        canvas.draw()
        self._background = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
        self._colour = theme.trace
        pixels = axes.transData.transform(np.column_stack([plot.x, plot.bend_deg]))
        self._points = np.column_stack([pixels[:, 0], height - pixels[:, 1]]) * _OVERSAMPLING
        self._line = max(round(2.4 * size * _OVERSAMPLING), 2)
        self._dot = 7.0 * size * _OVERSAMPLING
        self._mask = Image.new("L", (width * _OVERSAMPLING, height * _OVERSAMPLING))
        self._traced, self._drawn = self._background.copy(), 0

    def draw(self, index: int) -> Picture:
        """Return the panel (height, width, 3) with the trace up to and including sample `index`."""
        if index < self._drawn:
            self._mask.paste(0, (0, 0, *self._mask.size))
            self._traced, self._drawn = self._background.copy(), 0
        self._trace_on(index)
        panel = self._traced.copy()
        self._paste_dot(panel, index)
        return np.asarray(panel)

    def _trace_on(self, index: int) -> None:
        """Draw the trace on to a sample: where the rest of it is, nothing is drawn again."""
        new = self._points[self._drawn : index + 1]
        self._drawn = index  # the next line begins where this one ends
        if len(new) < 2:
            return
        ImageDraw.Draw(self._mask).line([tuple(point) for point in new], 255, self._line, joint="curve")
        reach = self._line + _OVERSAMPLING
        low = np.maximum((new.min(axis=0) - reach) // _OVERSAMPLING, 0).astype(int)
        high = np.minimum((new.max(axis=0) + reach) // _OVERSAMPLING + 1, self._background.size).astype(int)
        box = (*low.tolist(), *high.tolist())
        fine = tuple(_OVERSAMPLING * edge for edge in box)
        self._traced.paste(self._background.crop(box), box)
        self._traced.paste(self._colour, box, self._mask.crop(fine).reduce(_OVERSAMPLING))

    def _paste_dot(self, panel: Image.Image, index: int) -> None:
        """Draw the spot at the end of the trace, at the precision of the line."""
        x, y = self._points[index]
        reach = int(self._dot / _OVERSAMPLING) + 2
        left, top = int(x / _OVERSAMPLING) - reach, int(y / _OVERSAMPLING) - reach
        side = 2 * reach + 1
        spot = Image.new("L", (side * _OVERSAMPLING, side * _OVERSAMPLING))
        x, y = x - left * _OVERSAMPLING, y - top * _OVERSAMPLING
        ImageDraw.Draw(spot).ellipse((x - self._dot, y - self._dot, x + self._dot, y + self._dot), 255)
        panel.paste(self._colour, (left, top, left + side, top + side), spot.reduce(_OVERSAMPLING))


def panel_rectangle(
    width: float, height: float, size: float, *, legend: bool
) -> tuple[float, float, float, float]:
    """Return the rectangle of axes (left, bottom, width, height) that leaves room for their labels.

    Args:
        width: of the panel [inch].
        height: of the panel [inch].
        size: scale of text; 1 has labels 13 points high.
        legend: whether there is one above the axes.
    """
    left, bottom, right = 1.02 * size / width, 0.80 * size / height, 0.30 * size / width
    top = (0.62 if legend else 0.36) * size / height
    return left, bottom, max(1 - left - right, 0.1), max(1 - bottom - top, 0.1)


def draw_curves(axes: Axes, plot: Plot, curves: Sequence[Curve], theme: Theme, size: float = 1.0) -> None:
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
    style_axes(axes, plot, theme, size)
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
        labelcolor=theme.ink,
        borderaxespad=0.3,
        borderpad=0.2,
        handlelength=2.2,
        handletextpad=0.5,
        columnspacing=1.6,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)  # a name comes out of a file


def style_axes(axes: Axes, plot: Plot, theme: Theme, size: float = 1.0) -> None:
    """Style the axes of a bending angle: labels, a faint grid, no frame; `size` scales text and lines."""
    axes.set_facecolor("none")
    axes.set_xlabel(plot.x_label, fontsize=13 * size, color=theme.ink, labelpad=7 * size)
    axes.set_ylabel(plot.y_label, fontsize=13 * size, color=theme.ink, labelpad=5 * size)
    axes.tick_params(labelsize=11 * size, colors=theme.muted, length=0, pad=6 * size)
    axes.locator_params(nbins=7)
    axes.grid(color=theme.grid, linewidth=0.9 * size)
    axes.set_axisbelow(True)
    axes.margins(0.06)
    if plot.limits is not None:
        axes.set(xlim=plot.limits[0], ylim=plot.limits[1])
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color=theme.spine, linewidth=0.9 * size)


def _has_names(curves: Sequence[Curve]) -> bool:
    return any(curve.name for curve in curves)
