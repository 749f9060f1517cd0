"""Composition of a picture: where the views of records and their plots stand, and what each of them shows."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from twin.episode import Episode
from twin.errors import InputError
from twin.rendering.actor import Actor
from twin.rendering.beside import NOTHING, Beside
from twin.rendering.cameras import Shot, scene_of, shot
from twin.rendering.look import Look
from twin.rendering.plots import lateral_loop, on_common_axes, plot_of
from twin.rendering.tension_colours import TensionColours
from twin.rendering.trace_panel import Plot
from twin.rendering.view_cell import Rectangle, ViewCell

MOST_RECORDS = 6
"""Most records that have room side by side."""
_VIEW_SHARE = 0.56  # of the height, where records stand side by side


@dataclasses.dataclass(frozen=True)
class Record:
    """Episode in a composition.

    Attributes:
        episode: the record.
        beside: what is drawn with it.
        title: above it, where there are several.
    """

    episode: Episode
    beside: Beside = NOTHING
    title: str = ""


class PlotCell(NamedTuple):
    """Plot in a composition.

    Attributes:
        box: where it stands.
        plot: what it shows.
        record: whose it is, counted from 0.
        scale: of text and lines, in a figure of the composition's resolution.
    """

    box: Rectangle
    plot: Plot
    record: int
    scale: float


class Composition:
    """Views and plots of records, of which each is drawn on demand.

    Attributes:
        records: what is shown.
        width: of it [pixels].
        height: of it [pixels].
        views: of the endoscopes.
        plots: of the curves.
    """

    def __init__(
        self,
        records: Sequence[Record],
        look: Look,
        width: int,
        height: int,
        *,
        dpi: float,
        least_scale: float = 0.0,
        fineness: int = 1,
    ) -> None:
        """Build the actors, place the cameras and open the renderer.

        Args:
            records: one, or several side by side.
            look: options.
            width: of the composition [pixels].
            height: of the composition [pixels].
            dpi: pixels per inch, which say how large text is.
            least_scale: of text, so that it can be read in print.
            fineness: pixels that are drawn for each that is kept, along a side.

        Raises:
            ValueError: there are too many records, or what is beside one is not at its times.
            OSError: nothing on this system can draw without a screen.
        """
        if not 1 <= len(records) <= MOST_RECORDS:
            raise InputError(f"{len(records)} records: from 1 to {MOST_RECORDS} have room side by side")
        for record in records:
            record.beside.check(record.episode)
        self.records, self.width, self.height = list(records), width, height
        self._look, self._dpi, self._least_scale, self._fineness = look, dpi, least_scale, fineness
        planes = _planes(records)
        views, plots = _arrangement(len(records), planes, look, width, height)
        self.views = self._view_cells(views)
        self.plots = self._plot_cells(plots)

    def _view_cells(self, places: Sequence[tuple[Rectangle, int, str]]) -> list[ViewCell]:
        if not places:
            return []
        look, theme = self._look, self._look.theme
        episodes = [record.episode for record in self.records]
        colours = TensionColours.of(*episodes)
        actors = []
        for record in self.records:
            shown = [record.episode] + ([record.beside.ghost] if record.beside.ghost else [])
            scene = scene_of(look.camera)
            actors.append([Actor(one, scene, look.sleeve, colours, pale=theme.is_dark) for one in shown])
        everyone = [actor for group in actors for actor in group]
        first = places[0][0]
        for actor in everyone:
            actor.open_canvas(first.width * self._fineness, first.height * self._fineness)
        shots: dict[str, Shot] = {}
        for box, _, camera in places:
            if camera not in shots:
                shots[camera] = shot(camera, everyone, box.width / box.height)
        return [
            ViewCell(
                box,
                self.records[number],
                number,
                shots[camera],
                actors[number],
                look,
                colours,
                self.scale_of(box) * self._dpi / 100,
                self._fineness,
                is_first=place == 0 or places[place - 1][1] != number,
                lateral=camera == "top" and _planes(self.records) == 2,
            )
            for place, (box, number, camera) in enumerate(places)
        ]

    def _plot_cells(self, places: Sequence[tuple[Rectangle, int, int]]) -> list[PlotCell]:
        theme = self._look.theme
        plots = []
        for _, number, plane in places:
            record = self.records[number]
            plots.append(
                lateral_loop(record.episode, theme)
                if plane
                else plot_of(record.episode, record.beside, theme)
            )
        if len(self.records) > 1 and plots:
            plots = on_common_axes(plots)
        return [
            PlotCell(box, plot, number, self.scale_of(box))
            for (box, number, _), plot in zip(places, plots, strict=True)
        ]

    def scale_of(self, box: Rectangle) -> float:
        """Return the scale of text in a cell: 1 has labels 13 points high."""
        wide, high = box.width / self._dpi / 4.5, box.height / self._dpi / 4.1
        return max(0.72 * min(wide, 1.25 * high), self._least_scale)


def _planes(records: Sequence[Record]) -> int:
    """Return the number of bending planes that are shown: both where there is room for them."""
    return 2 if len(records) == 1 and len(records[0].episode.lateral_bend) else 1


def _arrangement(
    records: int, planes: int, look: Look, width: int, height: int
) -> tuple[list[tuple[Rectangle, int, str]], list[tuple[Rectangle, int, int]]]:
    """Return the boxes of views, with record and camera, and those of plots, with record and plane."""
    has_views, has_plots = look.panels != "curves", look.panels != "view"
    cameras = [look.camera]
    if planes == 2 and look.camera in ("side", "top"):
        cameras = ["side", "top"]
    if records > 1:
        columns = _split(0, width, records)
        share = _VIEW_SHARE if has_plots and has_views else 1.0
        cut = round(share * height)
        views = [
            (Rectangle(left, 0, wide, cut), number, look.camera)
            for number, (left, wide) in enumerate(columns)
        ]
        top = cut if has_views else 0
        plots = [
            (Rectangle(left, top, wide, height - top), number, 0)
            for number, (left, wide) in enumerate(columns)
        ]
        return (views if has_views else []), (plots if has_plots else [])
    if not has_plots or not has_views:
        boxes = _side_by_side(width, height, len(cameras) if has_views else planes)
        if has_views:
            return [(box, 0, camera) for box, camera in zip(boxes, cameras, strict=True)], []
        return [], [(box, 0, plane) for plane, box in enumerate(boxes)]
    half = width // 2
    views = [
        (Rectangle(0, top, half, high), 0, camera)
        for camera, (top, high) in zip(cameras, _split(0, height, len(cameras)), strict=True)
    ]
    plots = [
        (Rectangle(half, top, width - half, high), 0, plane)
        for plane, (top, high) in enumerate(_split(0, height, planes))
    ]
    return views, plots


def _side_by_side(width: int, height: int, count: int) -> list[Rectangle]:
    """Return boxes beside one another in a wide picture, below one another in a high one."""
    if width >= height:
        return [Rectangle(left, 0, wide, height) for left, wide in _split(0, width, count)]
    return [Rectangle(0, top, width, high) for top, high in _split(0, height, count)]


def _split(start: int, length: int, count: int) -> list[tuple[int, int]]:
    """Return starts and lengths of equal parts; what is left over is left free at the end."""
    part = length // count
    return [(start + part * number, part) for number in range(count)]


def sample_at(episode: Episode, time: float) -> int:
    """Return the sample of an episode that is the first at or after a time, or its last one."""
    since = episode.time[0] + time
    return int(np.clip(np.searchsorted(episode.time, since - 1e-9), 0, len(episode.time) - 1))
