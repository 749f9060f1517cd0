"""Pictures of episodes for print: poses over one another, one pose, or a contact sheet, with their curves."""

import dataclasses
import io
import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.files.atomic import MADE_BY, write_whole
from twin.rendering.composition import Composition, PlotCell, Rectangle, ViewCell
from twin.rendering.look import Look
from twin.rendering.overlay import Overlay
from twin.rendering.picture import Badge, Label, Layer, Mark, angle, number, on_paper, plot, straight
from twin.rendering.plots import draw_curves, over_time, panel_rectangle

Array = NDArray[np.float64]
USUAL_INCHES = (9.0, 4.1)
LARGEST = (10_000, 10_000)  # largest width and height of a picture [pixels]
FORMATS = (".png", ".svg", ".pdf")  # endings of pictures
MOST_POSES = 60  # most poses of a sheet
_LEAST_SCALE = 0.52  # of text: ticks 6 points high
_PALE_POSE = 0.38
_FINEST_VIEW = 2000  # pixels of a view's longer side beyond which nothing is drawn finer than it is kept
_FINEST_SHEET = 4000
_STRIP_INCHES = 1.75  # height of the bend over time below a sheet


def keyframes(episode: Episode) -> list[int]:
    """Return four samples that show hysteresis: most pulled, two at one pull that differ most, least pulled.

    The two are searched for in the middle of the stroke, and the more bent one comes first.
    """
    pull, bend = episode.pull, episode.bend
    strips = np.linspace(pull.min(), pull.max(), 41)
    best = (0, 0)
    for low, high in itertools.pairwise(strips[13:28]):
        inside = np.flatnonzero((pull >= low) & (pull <= high))
        if inside.size == 0:
            continue
        from_centre = np.abs(pull[inside] - (low + high) / 2)
        is_upper = bend[inside] >= (bend[inside].max() + bend[inside].min()) / 2
        upper, lower = (
            int(inside[np.where(half, from_centre, np.inf).argmin()]) for half in (is_upper, ~is_upper)
        )
        best = max(best, (upper, lower), key=lambda pair: bend[pair[0]] - bend[pair[1]])
    return [int(pull.argmax()), *best, int(pull.argmin())]


def render_picture(
    overlays: Sequence[Overlay], path: Path, look: Look | None = None, time: float | None = None
) -> Path:
    """Render episodes side by side as a .png, or a .svg or .pdf in which curves and text are vectors.

    Without a time since the start [s], an episode is four poses over one another, numbered, next to its loop
    with the same numbers; with a ghost, it is the pose where the two differ most; for a camera that follows
    the tip, the most bent pose.
    """
    look = look or Look()
    inches = USUAL_INCHES
    if look.panels == "both" and (len(overlays) > 1 or len(overlays[0].episode.lateral_bend)):
        inches = inches[0], (0.62 if len(overlays) > 1 else 0.72) * inches[0]
    usual = round(inches[0] * look.dpi), round(inches[1] * look.dpi)
    width, height = look.size_within(usual, LARGEST, even=False)
    for overlay in overlays:
        if time is not None and not 0 <= time <= overlay.seconds + 1e-9:
            raise InputError(
                f"time = {time:g}: must be from 0 to {overlay.seconds:g} s, the length of the record"
            )
    fineness = 2 if max(width, height) <= _FINEST_VIEW else 1
    fine: dict[str, Any] = {"dpi": look.dpi, "least_scale": _LEAST_SCALE, "fineness": fineness}
    composition = Composition(overlays, look, width, height, **fine)
    figure, add_axes = _blank_figure(look, width, height)
    chosen = [_Chosen(overlay, look, time, composition) for overlay in overlays]
    for view in composition.views:
        chosen[view.number].show(view, add_axes(view.box))
    for cell in composition.plots:
        _draw_plot(figure, cell, look, width, height, chosen[cell.number])
    _write_figure(figure, path, look)
    return path


class _Chosen:
    def __init__(self, overlay: Overlay, look: Look, time: float | None, composition: Composition) -> None:
        episode = overlay.episode
        self.overlay, self._look, theme = overlay, look, look.theme
        self.colours = [theme.ink, theme.trace, theme.trace, theme.ink]  # the two at one pull are coloured
        self.ink = theme.paper if theme.is_dark else "#ffffff"
        self.poses: list[int] = []
        if time is not None:
            self.sample = overlay.sample_at(time)
        elif overlay.ghost is not None:
            self.sample = int(np.abs(episode.bend - overlay.ghost.bend).argmax())
        elif any(view.shot.follows or view.shot.scene == "overview" for view in composition.views):
            self.sample = int(np.abs(episode.bend).argmax())
        else:
            self.poses = keyframes(episode)
            self.sample = self.poses[0]

    def show(self, view: ViewCell, axes: Axes) -> None:
        """Show the poses, or the pose, in axes, with their marks."""
        marks = view.marks(self.sample, moving=not self.poses)
        if self.poses:
            most, upper, lower, least = self.poses
            layer = view.poses([upper, lower], [most, least], _PALE_POSE)
            marks += self._badges(view)
        else:
            layer, ghost = view.scene(self.sample), self.overlay.ghost
            if ghost is not None and not view.is_lateral:
                apart = self.overlay.episode.truth_deg[self.sample] - ghost.truth_deg[self.sample]
                marks.append(view.line_below_numbers(f"{abs(apart):.1f}° apart"))
        _show_layer(axes, layer, self._look, marks)

    def _badges(self, view: ViewCell) -> list[Mark]:
        box, size = view.box, 15 * view.unit
        tips = [view.tip(sample) for sample in self.poses]
        levels = spread([row for _, row in tips], apart=2.1 * size)
        badges: list[Mark] = []
        for place, ((column, _), level, colour) in enumerate(zip(tips, levels, self.colours, strict=True)):
            left = min(column + 0.05 * box.height, box.width - size)
            badges.append(Badge(left, level, f"{place + 1}", colour, size, self.ink))
        return badges


def spread(levels: Sequence[float], apart: float) -> list[float]:
    """Spread numbers to be at least `apart`, in their order and about their common middle."""
    order = np.argsort(levels, kind="stable")
    moved = np.array(levels, dtype=float)
    for before, after in itertools.pairwise(order):
        moved[after] = max(moved[after], moved[before] + apart)
    return [float(level) for level in moved - (moved - levels).mean()]


def _draw_plot(figure: Figure, cell: PlotCell, look: Look, width: int, height: int, chosen: _Chosen) -> None:
    box, theme, curves, scale = cell.box, look.theme, cell.plot.still, cell.scale
    inside = panel_rectangle(curves, box.width / look.dpi, box.height / look.dpi, scale)
    left, bottom = box.left / width, 1 - (box.top + box.height) / height
    across, along = box.width / width, box.height / height
    axes = figure.add_axes(
        (left + inside[0] * across, bottom + inside[1] * along, inside[2] * across, inside[3] * along)
    )
    if not chosen.poses:
        draw_curves(axes, cell.plot, curves, theme, scale)
        _mark_sample(axes, cell, chosen, theme.muted, theme.trace)
        return
    pale = [curve._replace(colour=theme.ghost, width=1.4) for curve in curves]
    draw_curves(axes, cell.plot, pale, theme, scale)
    x, bend = cell.plot.x, cell.plot.bend_deg
    if cell.plot.is_main:
        upper, lower = chosen.poses[1:3]
        line: Any = {"color": theme.trace, "linewidth": 1.9 * scale, "linestyle": (0, (3, 2))}
        axes.plot(x[[upper, lower]], bend[[upper, lower]], **line)
        apart = f"{bend[upper] - bend[lower]:.1f}° apart\nat the same pull"
        _write_in_free_corner(axes, apart, x, bend, color=theme.trace, fontsize=11.5 * scale)
    for place, (sample, colour) in enumerate(zip(chosen.poses, chosen.colours, strict=True)):
        number(axes, x[sample], bend[sample], f"{place + 1}", colour, chosen.ink, 11 * scale)


def _write_in_free_corner(axes: Axes, text: str, x: Array, y: Array, **style: Any) -> None:
    """Write into the lower right corner of axes, or the upper left one where fewer points of a curve are."""
    shares = axes.transAxes.inverted().transform(axes.transData.transform(np.column_stack([x, y])))
    right, left = (((of[:, 0] > 0.55) & (of[:, 1] < 0.25)).sum() for of in (shares, 1 - shares))
    place: tuple[float, float, str, str] = (0.97, 0.06, "right", "bottom")
    if left < right:
        place = (0.03, 0.94, "left", "top")
    axes.text(*place[:2], text, ha=place[2], va=place[3], transform=axes.transAxes, **style)


def _mark_sample(axes: Axes, cell: PlotCell, chosen: _Chosen, pale: str, colour: str) -> None:
    sample, ghost = chosen.sample, chosen.overlay.ghost
    x, bend = cell.plot.x[sample], cell.plot.bend_deg[sample]
    spot: dict[str, Any] = {"markersize": 8.5 * cell.scale, "markeredgecolor": "white", "zorder": 4}
    if ghost is not None and cell.plot.is_main:
        along = (ghost.time if cell.plot.over == "time" else ghost.pull_mm)[sample]
        axes.plot(
            [along, x], [ghost.truth_deg[sample], bend], color=pale, linewidth=1.2 * cell.scale, zorder=3
        )
        axes.plot(along, ghost.truth_deg[sample], "o", color=pale, **spot)
    axes.plot(x, bend, "o", color=colour, **spot)


def render_sheet(overlay: Overlay, path: Path, poses: int, look: Look | None = None) -> Path:
    """Render a contact sheet: poses at even times, numbered, over the bend with the same numbers."""
    look = look or Look()
    if not 2 <= poses <= MOST_POSES:
        raise InputError(f"sheet = {poses}: must be from 2 to {MOST_POSES} pictures")
    columns = min(poses, max(2, round(math.sqrt(1.6 * poses))))
    rows = math.ceil(poses / columns)
    strip = 0.0 if look.panels == "view" else _STRIP_INCHES
    inches = USUAL_INCHES[0], USUAL_INCHES[0] / columns * 0.72 * rows + strip
    usual = round(inches[0] * look.dpi), round(inches[1] * look.dpi)
    width, height = look.size_within(usual, LARGEST, even=False)
    below = round(strip / inches[1] * height)
    cell = Rectangle(0, 0, width // columns, (height - below) // rows)
    fineness = 2 if width < _FINEST_SHEET else 1
    fine: dict[str, Any] = {"dpi": look.dpi, "least_scale": _LEAST_SCALE, "fineness": fineness}
    alone = dataclasses.replace(look, panels="view")
    composition = Composition([overlay], alone, cell.width, cell.height, **fine)
    view, episode, theme = composition.views[0], overlay.episode, look.theme
    samples = [overlay.sample_at(time) for time in np.linspace(0, overlay.seconds, poses)]
    figure, add_axes = _blank_figure(look, width, height)
    badge = theme.paper if theme.is_dark else "#ffffff"
    for place, sample in enumerate(samples):
        row, column = divmod(place, columns)
        size = 21 * composition.scale_of(cell) * look.dpi / 100
        caption = f"{episode.time[sample]:.1f} s   {angle(float(episode.truth_deg[sample]))}"
        marks: list[Mark] = [
            Badge(1.9 * size, 1.9 * size, f"{place + 1}", theme.ink, 0.95 * size, badge),
            Label(3.3 * size, 1.9 * size, caption, theme.ink, size, anchor="lm"),
        ]
        if place == 0:
            marks += view.marks(sample, moving=False)
        box = cell._replace(left=column * cell.width, top=row * cell.height)
        _show_layer(add_axes(box), view.scene(sample), look, marks)
    if below:
        scale = max(0.62 * width / look.dpi / USUAL_INCHES[0], _LEAST_SCALE)
        course = over_time(overlay, theme)
        named = course.still if overlay.ghost is not None else ()
        inside = panel_rectangle(named, width / look.dpi, below / look.dpi, scale)
        share = below / height
        axes = figure.add_axes((inside[0], inside[1] * share, inside[2], inside[3] * share))
        curves = [curve if curve.name else curve._replace(colour=theme.ghost) for curve in course.still]
        draw_curves(axes, course, curves, theme, scale)
        for place, sample in enumerate(samples):
            spot = episode.time[sample], episode.truth_deg[sample]
            number(axes, *spot, f"{place + 1}", theme.ink, badge, 9 * scale, pad=0.18)
    _write_figure(figure, path, look)
    return path


def _blank_figure(look: Look, width: int, height: int) -> tuple[Figure, Callable[[Rectangle], Axes]]:
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


def _show_layer(axes: Axes, layer: Layer, look: Look, marks: Sequence[Mark]) -> None:
    limits = axes.get_xlim(), axes.get_ylim()
    picture = straight(layer) if look.theme.is_transparent else on_paper(layer, look.theme)
    axes.imshow(picture, interpolation="none", aspect="auto")
    plot(axes, marks, 72 / look.dpi)
    axes.set(xlim=limits[0], ylim=limits[1])


def _write_figure(figure: Figure, path: Path, look: Look) -> None:
    buffer, ending = io.BytesIO(), path.suffix.lower()
    if ending == ".png":
        FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": MADE_BY})
    else:
        date = "Date" if ending == ".svg" else "CreationDate"
        with matplotlib.rc_context({"svg.hashsalt": MADE_BY, "svg.fonttype": "none", "pdf.compression": 6}):
            metadata = {date: None, "Creator": MADE_BY}
            figure.savefig(buffer, format=ending[1:], metadata=metadata, dpi=look.dpi)
    write_whole(path, buffer.getvalue())
