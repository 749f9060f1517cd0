"""Pictures of records for print: poses over one another, one pose, or poses in turn, beside their curves."""

import io
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.atomic import MADE_BY, write_whole
from twin.rendering.composition import Composition, PlotCell, Record, sample_at
from twin.rendering.layers import Layer, on_paper, straight
from twin.rendering.look import Look
from twin.rendering.marks import Badge, Mark, plot
from twin.rendering.telling import farthest_sample, telling_samples
from twin.rendering.trace_panel import draw_curves, panel_rectangle
from twin.rendering.view_cell import Rectangle, ViewCell

Array = NDArray[np.float64]

USUAL_INCHES = (9.0, 4.1)
LARGEST = (10_000, 10_000)
"""Largest width and height of a picture [pixels]."""
FORMATS = (".png", ".svg", ".pdf")
"""Endings of pictures."""
_LEAST_SCALE = 0.52  # of text: ticks 6 points high
_FINENESS = 2
_PALE_POSE = 0.38
_FINEST_VIEW = 2000  # pixels of a view's longer side beyond which nothing is drawn finer than it is kept


def render_picture(
    records: Sequence[Record], path: Path, look: Look | None = None, time: float | None = None
) -> Path:
    """Render records side by side as a picture, written whole or not at all.

    Without a time, a record is four poses over one another, numbered, beside its loop with the same numbers;
    with a ghost, it is the pose where the two differ most, before the ghost's; before a camera that follows
    the tip, the most bent pose.

    Args:
        records: what is shown.
        path: a .png, or a .svg or .pdf, in which curves and text are vectors.
        look: options.
        time: of the pose, since the start of the records [s].

    Returns:
        `path`.

    Raises:
        ValueError: the size is out of range, a time is not in a record, or what is beside a record is not at
            its times.
        OSError: nothing on this system can draw without a screen.
    """
    look = look or Look()
    usual = (round(USUAL_INCHES[0] * look.dpi), round(USUAL_INCHES[1] * look.dpi))
    if len(records) > 1 and look.panels == "both":
        usual = (usual[0], round(0.62 * usual[0]))
    elif len(records) == 1 and len(records[0].episode.lateral_bend) and look.panels == "both":
        usual = (usual[0], round(0.72 * usual[0]))
    width, height = look.size_within(usual, LARGEST, even=False)
    for record in records if time is not None else ():
        check_time(record, float(time or 0.0))
    composition = open_composition(records, look, width, height)
    figure, add_axes = blank_figure(look, width, height)
    chosen = [_Chosen(record, look, time, composition) for record in records]
    for view in composition.views:
        chosen[view.number].show(view, add_axes(view.box))
    for cell in composition.plots:
        _draw_plot(figure, cell, look, width, height, chosen[cell.record])
    write_figure(figure, path, look)
    return path


def open_composition(records: Sequence[Record], look: Look, width: int, height: int) -> Composition:
    """Return the composition of a picture; its views are drawn finer than they are kept, unless too large."""
    fineness = _FINENESS if max(width, height) <= _FINEST_VIEW else 1
    return Composition(
        records, look, width, height, dpi=look.dpi, least_scale=_LEAST_SCALE, fineness=fineness
    )


def check_time(record: Record, time: float) -> None:
    """Refuse a time that is not in a record.

    Raises:
        ValueError: it is before its start or after its end.
    """
    seconds = float(record.episode.time[-1] - record.episode.time[0])
    if not 0 <= time <= seconds + 1e-9:
        raise InputError(f"time = {time:g}: must be from 0 to {seconds:g} s, the length of the record")


class _Chosen:
    """Samples of a record that a picture shows, and how they are marked."""

    def __init__(self, record: Record, look: Look, time: float | None, composition: Composition) -> None:
        episode, ghost = record.episode, record.beside.ghost
        self.record, self._look, self._theme = record, look, look.theme
        follows = any(view.shot.follows or view.shot.scene == "overview" for view in composition.views)
        self.poses: list[int] = []
        if time is not None:
            self.sample = sample_at(episode, time)
        elif ghost is not None:
            self.sample = farthest_sample(episode, ghost)
        elif follows:
            self.sample = int(np.abs(episode.bend).argmax())
        else:
            self.poses = telling_samples(episode)
            self.sample = self.poses[0]

    @property
    def colours(self) -> list[str]:
        """Colours of the poses' numbers: the two at one pull stand out."""
        theme = self._theme
        return [theme.ink, theme.trace, theme.trace, theme.ink]

    def show(self, view: ViewCell, axes: Axes) -> None:
        """Show the poses, or the pose, in axes, with their marks."""
        marks = view.marks(self.sample, moving=not self.poses)
        if self.poses:
            most, upper, lower, least = self.poses
            layer = view.poses([upper, lower], [most, least], _PALE_POSE)
            marks += self._badges(view)
        else:
            layer = view.scene(self.sample)
            marks += self._apart(view)
        show_layer(axes, layer, self._look, marks)

    def _badges(self, view: ViewCell) -> list[Mark]:
        """Return the numbers of the poses beside their tips, which are in the order of their heights."""
        height, size = view.box.height, 15 * view.unit
        tips = [view.tip(sample) for sample in self.poses]
        levels = spread([row for _, row in tips], apart=2.1 * size)
        ink = "#ffffff" if not self._theme.is_dark else self._theme.paper
        return [
            Badge(
                min(column + 0.05 * height, view.box.width - size), level, f"{number + 1}", colour, size, ink
            )
            for number, ((column, _), level, colour) in enumerate(
                zip(tips, levels, self.colours, strict=True)
            )
        ]

    def _apart(self, view: ViewCell) -> list[Mark]:
        """Return how far the pose is from that of the ghost."""
        ghost = self.record.beside.ghost
        if ghost is None or view.is_lateral:
            return []
        apart = abs(self.record.episode.truth_deg[self.sample] - ghost.truth_deg[self.sample])
        return [view.line_below_numbers(f"{apart:.1f}° apart")]


def _draw_plot(figure: Figure, cell: PlotCell, look: Look, width: int, height: int, chosen: _Chosen) -> None:
    """Draw the curves of a record, and mark the samples that the picture shows."""
    box, theme, curves, scale = cell.box, look.theme, cell.plot.still, cell.scale
    inside = panel_rectangle(
        box.width / look.dpi, box.height / look.dpi, scale, legend=any(curve.name for curve in curves)
    )
    left, bottom = box.left / width, 1 - (box.top + box.height) / height
    across, along = box.width / width, box.height / height
    axes = figure.add_axes(
        (left + inside[0] * across, bottom + inside[1] * along, inside[2] * across, inside[3] * along)
    )
    x, bend = cell.plot.x, cell.plot.bend_deg
    if not chosen.poses:
        draw_curves(axes, cell.plot, curves, theme, scale)
        _mark_sample(axes, cell, chosen, theme.muted, theme.trace)
        return
    whole = [curve._replace(colour=theme.ghost, width=1.4) for curve in curves]
    draw_curves(axes, cell.plot, whole, theme, scale)
    _, upper, lower, _ = chosen.poses
    if cell.plot.is_main:
        line: Any = {"color": theme.trace, "linewidth": 1.9 * scale, "linestyle": (0, (3, 2))}
        axes.plot(x[[upper, lower]], bend[[upper, lower]], **line)
        apart = f"{bend[upper] - bend[lower]:.1f}° apart\nat the same pull"
        _write_in_free_corner(axes, apart, x, bend, color=theme.trace, fontsize=11.5 * scale)
    ink = theme.paper if theme.is_dark else "#ffffff"
    for number, (sample, colour) in enumerate(zip(chosen.poses, chosen.colours, strict=True)):
        box_style = {"boxstyle": "circle,pad=0.22", "facecolor": colour, "edgecolor": ink}
        style: Any = {"ha": "center", "va": "center", "color": ink, "fontweight": "bold", "bbox": box_style}
        axes.text(x[sample], bend[sample], f"{number + 1}", fontsize=11 * scale, **style)


def _write_in_free_corner(axes: Axes, text: str, x: Array, y: Array, **style: Any) -> None:
    """Write into the lower right corner of axes, or the upper left one where fewer points of a curve are."""
    shares = axes.transAxes.inverted().transform(axes.transData.transform(np.column_stack([x, y])))
    right, left = ((side > 0.5).sum() for side in (_in_corner(shares), _in_corner(1 - shares)))
    place: tuple[float, float, str, str] = (0.97, 0.06, "right", "bottom")
    if left < right:
        place = (0.03, 0.94, "left", "top")
    axes.text(*place[:2], text, ha=place[2], va=place[3], transform=axes.transAxes, **style)


def _in_corner(shares: Array) -> Array:
    """Return 1 for each point (n, 2) in the lower right corner of axes, else 0."""
    inside: Array = ((shares[:, 0] > 0.55) & (shares[:, 1] < 0.25)).astype(float)
    return inside


def _mark_sample(axes: Axes, cell: PlotCell, chosen: _Chosen, pale: str, colour: str) -> None:
    """Draw a spot on the curve at the sample of the picture, and one on the ghost's."""
    sample, ghost = chosen.sample, chosen.record.beside.ghost
    x, bend = cell.plot.x[sample], cell.plot.bend_deg[sample]
    spot: dict[str, Any] = {"markersize": 8.5 * cell.scale, "markeredgecolor": "white", "zorder": 4}
    if ghost is not None and cell.plot.is_main:
        along = ghost.time if cell.plot.over == "time" else ghost.pull_mm
        places = [along[sample], x], [ghost.truth_deg[sample], bend]
        axes.plot(*places, color=pale, linewidth=1.2 * cell.scale, zorder=3)
        axes.plot(along[sample], ghost.truth_deg[sample], "o", color=pale, **spot)
    axes.plot(x, bend, "o", color=colour, **spot)


def blank_figure(look: Look, width: int, height: int) -> tuple[Figure, Callable[[Rectangle], Axes]]:
    """Return a figure of a size [pixels], and what adds axes whose units are the pixels of a box in it."""
    figure = Figure(figsize=(width / look.dpi, height / look.dpi), dpi=look.dpi)
    figure.set_facecolor("none" if look.theme.is_transparent else look.theme.paper)

    def add_axes(box: Rectangle) -> Axes:
        bottom = 1 - (box.top + box.height) / height
        axes = figure.add_axes((box.left / width, bottom, box.width / width, box.height / height))
        axes.set(xlim=(-0.5, box.width - 0.5), ylim=(box.height - 0.5, -0.5))
        axes.set_axis_off()
        return axes

    return figure, add_axes


def show_layer(axes: Axes, layer: Layer, look: Look, marks: Sequence[Mark]) -> None:
    """Show a layer in axes of its pixels, on the paper of the look, with marks over it."""
    theme = look.theme
    limits = axes.get_xlim(), axes.get_ylim()
    picture = straight(layer) if theme.is_transparent else on_paper(layer, theme)
    axes.imshow(picture, interpolation="none", aspect="auto")
    plot(axes, marks, 72 / look.dpi)
    axes.set(xlim=limits[0], ylim=limits[1])


def write_figure(figure: Figure, path: Path, look: Look) -> None:
    """Write a figure in the format of the path's ending, the same bytes each time."""
    buffer = io.BytesIO()
    ending = path.suffix.lower()
    if ending == ".png":
        FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": MADE_BY})
    elif ending in FORMATS:
        told = {
            ".svg": {"Date": None, "Creator": MADE_BY},
            ".pdf": {"CreationDate": None, "Creator": MADE_BY},
        }
        with matplotlib.rc_context({"svg.hashsalt": MADE_BY, "svg.fonttype": "none", "pdf.compression": 6}):
            figure.savefig(buffer, format=ending[1:], metadata=told[ending], dpi=look.dpi)
    else:
        raise InputError(f"{path}: must end in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
    write_whole(path, buffer.getvalue())


def spread(levels: Sequence[float], apart: float) -> list[float]:
    """Spread numbers to be at least `apart`, in their order and about their common middle."""
    order = np.argsort(levels, kind="stable")
    moved = np.array(levels, dtype=float)
    for before, after in itertools.pairwise(order):
        moved[after] = max(moved[after], moved[before] + apart)
    return [float(level) for level in moved - (moved - levels).mean()]
