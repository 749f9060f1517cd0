"""Plots of the bending angle over pull (the loop) or time, still or traced sample by sample."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from twin.episode import Episode
from twin.rendering.look import WHITE, Theme
from twin.rendering.overlay import Overlay, controller_of
from twin.rendering.picture import Picture

Array = NDArray[np.float64]
PULL_LABEL, TIME_LABEL, BEND_LABEL = "pulling distance [mm]", "time [s]", "bending angle [deg]"
_DASHED = (0, (3.2, 2.0))
_DPI = 100
_OVERSAMPLING = 3  # Pillow's lines have hard edges: they are drawn larger, and reduced


class Curve(NamedTuple):
    """Curve that does not move, in the units of the axes; named in the legend."""

    x: Array
    y: Array
    colour: str
    dashed: bool = False
    name: str = ""
    width: float = 1.6


class Plot(NamedTuple):
    """Bending angle over pull or time."""

    x: Array  # (N,) of the trace, in the unit of the horizontal axis
    bend_deg: Array  # (N,) of the trace [deg]
    x_label: str
    y_label: str
    moving: tuple[Curve, ...]  # below a trace that moves
    still: tuple[Curve, ...]  # where nothing moves
    over: str = "pull"  # or "time"
    is_main: bool = True  # of the plane of wires a and b
    limits: tuple[tuple[float, float], tuple[float, float]] | None = None  # of the axes; None: of the curves


def plot_of(overlay: Overlay, theme: Theme) -> Plot:
    """Return the bend over time where a reference is known, else the loop."""
    return over_time(overlay, theme) if overlay.has_reference else loop(overlay, theme)


def loop(overlay: Overlay, theme: Theme) -> Plot:
    """Return bending angle over pulling distance; the complete loop is pale below its trace."""
    moving, still = (tuple(_curves("pull_mm", overlay, theme, moving=moves)) for moves in (True, False))
    episode = overlay.episode
    return Plot(episode.pull_mm, episode.truth_deg, PULL_LABEL, BEND_LABEL, moving, still)


def lateral_loop(episode: Episode, theme: Theme) -> Plot:
    """Return the loop of the second bending plane, of wires c and d."""
    pull_mm, bend_deg = episode.lateral_pull * 1e3, np.degrees(episode.lateral_bend)
    if len(pull_mm) == 0:  # wire c is held
        pull_mm = np.zeros(len(bend_deg))
    moving, still = (Curve(pull_mm, bend_deg, colour) for colour in (theme.pale, theme.trace))
    labels = f"lateral {PULL_LABEL}", f"lateral {BEND_LABEL}"
    return Plot(pull_mm, bend_deg, *labels, (moving,), (still,), is_main=False)


def over_time(overlay: Overlay, theme: Theme) -> Plot:
    """Return bending angle over time: the reference, and the complete bend pale below its trace."""
    episode, known = overlay.episode, []
    if overlay.has_reference:
        known = [Curve(episode.time, overlay.reference_deg, theme.ink, True, "reference", 1.3)]
    moving, still = ((*_curves("time", overlay, theme, moving=moves), *known) for moves in (True, False))
    return Plot(episode.time, episode.truth_deg, TIME_LABEL, BEND_LABEL, moving, still, "time")


def _curves(over: str, overlay: Overlay, theme: Theme, *, moving: bool) -> list[Curve]:
    """Return the bend of an episode, and of its ghost below it, over an array of theirs."""
    episode, ghost = overlay.episode, overlay.ghost
    x, bend_deg, name, curves = getattr(episode, over), episode.truth_deg, "", []
    if ghost is not None or overlay.has_reference:
        name = controller_of(episode) or ("twin" if overlay.ghost_name else "bend")
    if ghost is not None:
        along = getattr(ghost, over)
        curves = [Curve(along, ghost.truth_deg, theme.ghost, dashed=True, name=overlay.legend)]
    if not moving:
        return [*curves, Curve(x, bend_deg, theme.trace, name=name)]
    key = [Curve(x[:0], bend_deg[:0], theme.trace, name=name)] if name else []  # the trace to come
    return [*curves, Curve(x, bend_deg, theme.pale), *key]


def on_common_axes(plots: Sequence[Plot]) -> list[Plot]:
    """Return plots whose axes have the limits that hold all of them."""
    curves = [curve for plot in plots for curve in (*plot.still, *plot.moving) if len(curve.x)]
    columns = ([curve.x for curve in curves], [curve.y for curve in curves])
    limits = [_with_margin(np.concatenate(column)) for column in columns]
    return [plot._replace(limits=(limits[0], limits[1])) for plot in plots]


def _with_margin(values: Array) -> tuple[float, float]:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.06 * max(high - low, 1e-9)
    return low - margin, high + margin


class TracePanel:
    """Plot that can be drawn up to any sample: static axes by matplotlib, the moving trace by Pillow."""

    def __init__(self, plot: Plot, width: int, height: int, theme: Theme = WHITE) -> None:
        """Draw the static parts of a panel of a size [pixels]: axes, labels, legend and curves."""
        figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=theme.paper)
        canvas = FigureCanvasAgg(figure)
        size = min(height / 720, width / 560)  # text and lines grow with the picture
        axes = figure.add_axes(panel_rectangle(plot.moving, width / _DPI, height / _DPI, size))
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
        x, y = self._points[index]
        reach = int(self._dot / _OVERSAMPLING) + 2
        left, top = int(x / _OVERSAMPLING) - reach, int(y / _OVERSAMPLING) - reach
        side = 2 * reach + 1
        spot = Image.new("L", (side * _OVERSAMPLING, side * _OVERSAMPLING))
        x, y = x - left * _OVERSAMPLING, y - top * _OVERSAMPLING
        ImageDraw.Draw(spot).ellipse((x - self._dot, y - self._dot, x + self._dot, y + self._dot), 255)
        panel.paste(self._colour, (left, top, left + side, top + side), spot.reduce(_OVERSAMPLING))


def panel_rectangle(
    curves: Sequence[Curve], width: float, height: float, size: float
) -> tuple[float, float, float, float]:
    """Return the rectangle of axes (left, bottom, width, height) that leaves room for labels and legend.

    Width and height are those of the panel [inch]; text of size 1 has labels 13 points high.
    """
    left, bottom, right = 1.02 * size / width, 0.80 * size / height, 0.30 * size / width
    top = (0.62 if any(curve.name for curve in curves) else 0.36) * size / height
    return left, bottom, max(1 - left - right, 0.1), max(1 - bottom - top, 0.1)


def draw_curves(axes: Axes, plot: Plot, curves: Sequence[Curve], theme: Theme, size: float = 1.0) -> None:
    """Draw curves over one another, with a legend above them of those that have a name."""
    lines = []
    for curve in curves:
        line: dict[str, Any] = {"color": curve.colour, "linestyle": _DASHED if curve.dashed else "-"}
        line |= {"linewidth": curve.width * size, "solid_joinstyle": "round"}
        lines += axes.plot(curve.x, curve.y, **line)
    _style_axes(axes, plot, theme, size)
    # What is drawn last, and lies in front, is named first.
    named = [(line, curve.name) for line, curve in zip(lines, curves, strict=True) if curve.name][::-1]
    if not named:
        return
    spacing: dict[str, Any] = {"borderaxespad": 0.3, "borderpad": 0.2, "handlelength": 2.2}
    spacing |= {"handletextpad": 0.5, "columnspacing": 1.6}
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": len(named)}
    style: dict[str, Any] = {"frameon": False, "fontsize": 11 * size, "labelcolor": theme.ink}
    for text in axes.legend(*zip(*named, strict=True), **place, **style, **spacing).get_texts():
        text.set_parse_math(False)  # a name comes out of a file


def _style_axes(axes: Axes, plot: Plot, theme: Theme, size: float) -> None:
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
