"""Contact sheet of a record: poses at even times in a grid, over the course of the bend."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.rendering.composition import Composition, Record, sample_at
from twin.rendering.look import Look
from twin.rendering.marks import Badge, Label, Mark
from twin.rendering.numbers import angle
from twin.rendering.plots import over_time
from twin.rendering.still import LARGEST, USUAL_INCHES, blank_figure, show_layer, write_figure
from twin.rendering.trace_panel import draw_curves, panel_rectangle
from twin.rendering.view_cell import Rectangle

MOST_PICTURES = 60
"""Most pictures of a sheet."""
_STRIP_INCHES = 1.75  # height of the course below the pictures
_LEAST_SCALE = 0.52


def render_sheet(record: Record, path: Path, pictures: int, look: Look | None = None) -> Path:
    """Render poses of a record at even times, numbered, over the bend with the same numbers.

    Args:
        record: what is shown.
        path: a .png, .svg or .pdf.
        pictures: number of poses, from 2 to `MOST_PICTURES`.
        look: options; of `panels`, `view` leaves the course out.

    Returns:
        `path`.

    Raises:
        ValueError: the number or the size is out of range, or what is beside the record is not at its times.
        OSError: nothing on this system can draw without a screen.
    """
    look = look or Look()
    if not 2 <= pictures <= MOST_PICTURES:
        raise InputError(f"sheet = {pictures}: must be from 2 to {MOST_PICTURES} pictures")
    columns = min(pictures, max(2, round(math.sqrt(1.6 * pictures))))
    rows = math.ceil(pictures / columns)
    strip = 0.0 if look.panels == "view" else _STRIP_INCHES
    inches = USUAL_INCHES[0], USUAL_INCHES[0] / columns * 0.72 * rows + strip
    usual = round(inches[0] * look.dpi), round(inches[1] * look.dpi)
    width, height = look.size_within(usual, LARGEST, even=False)
    below = round(strip / inches[1] * height)
    cell = Rectangle(0, 0, width // columns, (height - below) // rows)
    alone = dataclasses.replace(look, panels="view")
    composition = Composition(
        [record],
        alone,
        cell.width,
        cell.height,
        dpi=look.dpi,
        least_scale=_LEAST_SCALE,
        fineness=2 if width < 4000 else 1,
    )
    view = composition.views[0]
    episode, theme = record.episode, look.theme
    seconds = float(episode.time[-1] - episode.time[0])
    samples = [sample_at(episode, time) for time in np.linspace(0, seconds, pictures)]
    figure, add_axes = blank_figure(look, width, height)
    badge = theme.paper if theme.is_dark else "#ffffff"
    for number, sample in enumerate(samples):
        row, column = divmod(number, columns)
        box = Rectangle(column * cell.width, row * cell.height, cell.width, cell.height)
        unit = composition.scale_of(cell) * look.dpi / 100
        size = 21 * unit
        told = f"{episode.time[sample]:.1f} s   {angle(float(episode.truth_deg[sample]))}"
        marks: list[Mark] = [
            Badge(1.9 * size, 1.9 * size, f"{number + 1}", theme.ink, 0.95 * size, badge),
            Label(3.3 * size, 1.9 * size, told, theme.ink, size, anchor="lm"),
        ]
        if number == 0:
            marks += view.marks(sample, moving=False)
        show_layer(add_axes(box), view.scene(sample), look, marks)
    if below:
        scale = max(0.62 * width / look.dpi / USUAL_INCHES[0], _LEAST_SCALE)
        inside = panel_rectangle(
            width / look.dpi, below / look.dpi, scale, legend=record.beside.ghost is not None
        )
        share = below / height
        axes = figure.add_axes((inside[0], inside[1] * share, inside[2], inside[3] * share))
        course = over_time(episode, record.beside, theme)
        curves = [curve._replace(colour=theme.ghost) if not curve.name else curve for curve in course.still]
        draw_curves(axes, course, curves, theme, scale)
        for number, sample in enumerate(samples):
            spot = {"boxstyle": "circle,pad=0.18", "facecolor": theme.ink, "edgecolor": badge}
            style: Any = {"ha": "center", "va": "center", "color": badge, "fontweight": "bold", "bbox": spot}
            place = episode.time[sample], episode.truth_deg[sample]
            axes.text(*place, f"{number + 1}", fontsize=9 * scale, **style)
    write_figure(figure, path, look)
    return path
