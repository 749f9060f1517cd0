"""Composition of a picture: places of the views of episodes and of their plots, and what each view shows."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from twin.errors import InputError
from twin.rendering.actor import Actor, TensionColours
from twin.rendering.cameras import Shot, rounded, scene_of, shadow, shot
from twin.rendering.look import Look
from twin.rendering.overlay import Overlay
from twin.rendering.picture import Bar, Label, Layer, Mark, Rule, angle, faded, over, reduced, signed
from twin.rendering.plots import Plot, lateral_loop, on_common_axes, plot_of

MOST_EPISODES = 6  # most episodes that have room side by side
GHOST_INK = 0.34  # share of its ink that a ghost is drawn with
_VIEW_SHARE = 0.56  # of the height, where episodes are side by side
_SCALES_MM = (0.5, 1, 2, 5, 10, 20, 50, 100, 200)


class Rectangle(NamedTuple):
    """Rectangle in a composition [pixels]."""

    left: int
    top: int
    width: int
    height: int


class PlotCell(NamedTuple):
    """Plot in a composition, of an episode counted from 0; `scale` is that of text and lines."""

    box: Rectangle
    plot: Plot
    number: int
    scale: float


@dataclasses.dataclass
class ViewCell:
    """View of one episode: its pose with ghost and shadow, and the marks on it."""

    box: Rectangle
    overlay: Overlay
    number: int  # of the episode in the composition
    shot: Shot
    actors: Sequence[Actor]  # the endoscope, and its ghost if there is one
    look: Look
    colours: TensionColours | None  # of the wires; None where no tension is known
    unit: float  # size of a pixel of text, in pixels of a composition that is 720 high
    fineness: int  # pixels drawn for each that is kept, along a side
    is_first: bool  # view of its episode, which has the marks of the episode
    is_lateral: bool  # shows the second bending plane

    def __post_init__(self) -> None:
        self._theme, self._left = self.look.theme, 36 * self.unit

    def scene(self, index: int) -> Layer:
        """Return the endoscope at a sample, over its ghost and its shadow, (height, width, 4)."""
        picture = self.pose(index)
        for ghost in self.actors[1:]:
            picture = over(picture, faded(self._layer(ghost, index), GHOST_INK))
        return picture if self.shot.is_round else over(picture, self._shadow([index]))

    def poses(self, solid: Sequence[int], pale: Sequence[int], ink: float) -> Layer:
        """Return poses over one another: the first solid one in front, pale ones below."""
        front = self.pose(solid[0])
        for index in solid[1:]:
            front = over(front, self.pose(index))
        below = np.zeros_like(front)
        for index in pale:
            below = over(below, self.pose(index))
        return over(over(front, faded(below, ink)), self._shadow(solid))

    def pose(self, index: int) -> Layer:
        """Return the endoscope alone at a sample, (height, width, 4)."""
        return self._layer(self.actors[0], index)

    def _layer(self, actor: Actor, index: int) -> Layer:
        # A ghost is seen by the camera of the endoscope itself.
        layer = actor.layer(index, self.shot.view(self.actors[0], index))
        if self.fineness > 1:
            layer = reduced(layer, self.fineness)
        return rounded(layer) if self.shot.is_round else layer

    def _shadow(self, samples: Sequence[int]) -> Layer:
        size, actor = (self.box.width, self.box.height), self.actors[0]
        if self.shot.screen is None:
            return np.zeros((*size[::-1], 4), dtype=np.uint8)
        casters = [caster for index in samples for caster in self.shot.casters(actor, index)]
        view = self.shot.view(actor, samples[0])
        return shadow(casters, self.shot.screen, view, *size, self._theme.shadow)

    def tip(self, index: int, actor: int = 0) -> tuple[float, float]:
        """Return the place of the tip (1: of the ghost) at a sample, as (column, row) [pixels]."""
        view = self.shot.view(self.actors[0], index)
        tip = view.project(self.actors[actor].chain[index, -1], self.box.width, self.box.height)
        return float(tip[0]), float(tip[1])

    def marks(self, index: int, *, moving: bool = True) -> list[Mark]:
        """Return title, scale bar and colour bar, and, where `moving`, the numbers of a sample."""
        marks: list[Mark] = []
        if self.overlay.title:
            place = self._left, 30 * self.unit
            marks.append(Label(*place, self.overlay.title, self._theme.ink, 17 * self.unit, bold=True))
        if moving:
            marks += self._numbers(index)
        if self.shot.has_scale:
            marks += self._scale_bar()
        if self.shot.scene == "overview":
            marks.append(self._sheath_note(index))
        hidden = self.shot.scene == "lumen" or (self.shot.scene == "bench" and self.look.sleeve == "whole")
        if self.is_first and self.colours is not None and not hidden:
            marks += self._colour_bar(self.colours)
        return marks

    def _numbers(self, index: int) -> list[Mark]:
        episode, unit, theme = self.overlay.episode, self.unit, self._theme
        top = 30 * unit if self.overlay.title else 0.0
        if self.is_lateral:
            bend = float(np.degrees(episode.lateral_bend[index]))
            caption, pull_mm = "lateral bending angle", episode.lateral_pull * 1e3
        else:
            caption, bend, pull_mm = "bending angle", float(episode.truth_deg[index]), episode.pull_mm
        lines = [(f"pull {signed(float(pull_mm[index]), 2)} mm", theme.ink)] if len(pull_mm) else []
        if self.is_first:
            lines.append((f"time {episode.time[index]:.1f} s", theme.muted))
        if self.overlay.ghost is not None and not self.is_lateral:
            ghost = self.overlay.ghost.truth_deg[index]
            lines.append((f"{self.overlay.short_name} {angle(ghost)}", theme.muted))
        self._below = top + (128 + 26 * len(lines)) * unit
        below = [
            self._line(top + (128 + 26 * row) * unit, *line, 17 * unit) for row, line in enumerate(lines)
        ]
        large = self._line(top + 98 * unit, angle(bend), theme.trace, 46 * unit, bold=True)
        return [self._line(top + 46 * unit, caption, theme.muted, 17 * unit), large, *below]

    def line_below_numbers(self, text: str) -> Mark:
        """Return one more line below the numbers that `marks` returned last."""
        return self._line(self._below, text, self._theme.muted, 17 * self.unit)

    def _line(self, y: float, text: str, colour: str, size: float, *, bold: bool = False) -> Label:
        """Return a line of the numbers: on the right if the camera follows the tip, whose shaft is left."""
        if self.shot.follows and not self.shot.is_round:
            return Label(self.box.width - self._left, y, text, colour, size, bold, "rs")
        return Label(self._left, y, text, colour, size, bold)

    def _scale_bar(self) -> list[Mark]:
        seen_mm = 2e3 * self.shot.view(self.actors[0], 0).half_height
        length_mm = max(step for step in _SCALES_MM if step <= max(seen_mm / 5, _SCALES_MM[0]))
        length = length_mm / seen_mm * self.box.height
        left, bottom, unit = self._left, self.box.height - 32 * self.unit, self.unit
        return [
            Rule(((left, bottom), (left + length, bottom)), self._theme.ink, 2.4 * unit),
            Label(left, bottom - 9 * unit, f"{length_mm:g} mm", self._theme.muted, 16 * unit),
        ]

    def _colour_bar(self, colours: TensionColours) -> list[Mark]:
        """Return the bar of tensions where no pose reaches: over the scale bar, else lower right."""
        unit, muted = self.unit, self._theme.muted
        width, height = 130 * unit, 8 * unit
        left, bottom = self._left, self.box.height - 94 * unit
        if self.shot.scene == "overview" or self.shot.follows:
            left, bottom = self.box.width - self._left - width, self.box.height - 46 * unit
        steps, ends = colours(np.linspace(0, colours.highest_n, 64)), bottom + 17 * unit
        return [
            Bar(left, bottom - height, width, height, steps),
            Label(left, bottom - height - 8 * unit, "wire tension [N]", muted, 16 * unit),
            Label(left, ends, "0", muted, 14 * unit),
            Label(left + width, ends, f"{colours.highest_n:g}", muted, 14 * unit, anchor="rs"),
        ]

    def _sheath_note(self, index: int) -> Mark:
        preset, bend = self.actors[0].preset, self.overlay.episode.sheath_bend
        bent = float(np.degrees(bend[index] if len(bend) else preset.sheath_bend))
        text = f"sheath bent by {bent:.0f}° ({1e3 * preset.sheath_length:g} mm, drawn shorter)"
        return Label(self._left, self.box.height - 32 * self.unit, text, self._theme.muted, 16 * self.unit)


class Composition:
    """Views and plots of episodes, each of which is drawn on demand, in a size [pixels]."""

    def __init__(
        self,
        overlays: Sequence[Overlay],
        look: Look,
        width: int,
        height: int,
        *,
        dpi: float,
        least_scale: float = 0.0,
        fineness: int = 1,
    ) -> None:
        if not 1 <= len(overlays) <= MOST_EPISODES:
            raise InputError(f"{len(overlays)} records: from 1 to {MOST_EPISODES} have room side by side")
        for overlay in overlays:
            overlay.check()
        self.overlays, self.width, self.height = list(overlays), width, height
        self._look, self._dpi, self._least_scale, self._fineness = look, dpi, least_scale, fineness
        # Both bending planes are shown where there is room for them.
        self._planes = 2 if len(overlays) == 1 and len(overlays[0].episode.lateral_bend) else 1
        views, plots = _arrangement(len(overlays), self._planes, look, width, height)
        self.views = self._view_cells(views) if views else []
        self.plots = self._plot_cells(plots)

    def _view_cells(self, places: Sequence[tuple[Rectangle, int, str]]) -> list[ViewCell]:
        look, first = self._look, places[0][0]
        colours = TensionColours.of(*(overlay.episode for overlay in self.overlays))
        scene, pale = scene_of(look.camera), look.theme.is_dark
        groups = [
            [Actor(one, scene, look.sleeve, colours, pale=pale) for one in (of.episode, of.ghost) if one]
            for of in self.overlays
        ]
        actors = [actor for group in groups for actor in group]
        for actor in actors:
            actor.open_canvas(first.width * self._fineness, first.height * self._fineness)
        shots = {camera: shot(camera, actors, box.width / box.height) for box, _, camera in reversed(places)}
        return [
            ViewCell(
                box,
                self.overlays[number],
                number,
                shots[camera],
                groups[number],
                look,
                colours,
                self.scale_of(box) * self._dpi / 100,
                self._fineness,
                is_first=place == 0 or places[place - 1][1] != number,
                is_lateral=camera == "top" and self._planes == 2,
            )
            for place, (box, number, camera) in enumerate(places)
        ]

    def _plot_cells(self, places: Sequence[tuple[Rectangle, int, int]]) -> list[PlotCell]:
        theme = self._look.theme
        of = [(self.overlays[number], plane) for _, number, plane in places]
        plots = [lateral_loop(one.episode, theme) if plane else plot_of(one, theme) for one, plane in of]
        if len(self.overlays) > 1 and plots:
            plots = on_common_axes(plots)
        cells = zip(places, plots, strict=True)
        return [PlotCell(box, plot, number, self.scale_of(box)) for (box, number, _), plot in cells]

    def scale_of(self, box: Rectangle) -> float:
        """Return the scale of text in a cell: 1 has labels 13 points high."""
        wide, high = box.width / self._dpi / 4.5, box.height / self._dpi / 4.1
        return max(0.72 * min(wide, 1.25 * high), self._least_scale)


def _arrangement(
    episodes: int, planes: int, look: Look, width: int, height: int
) -> tuple[list[tuple[Rectangle, int, str]], list[tuple[Rectangle, int, int]]]:
    has_views, has_plots = look.panels != "curves", look.panels != "view"
    if episodes > 1:
        cut = round(_VIEW_SHARE * height) if has_plots and has_views else height
        top = cut if has_views else 0
        columns = list(enumerate(_split(width, episodes)))
        views = [(Rectangle(left, 0, wide, cut), number, look.camera) for number, (left, wide) in columns]
        plots = [(Rectangle(left, top, wide, height - top), number, 0) for number, (left, wide) in columns]
        return (views if has_views else []), (plots if has_plots else [])
    cameras = ["side", "top"] if planes == 2 and look.camera in ("side", "top") else [look.camera]
    if not has_plots or not has_views:
        boxes = _side_by_side(width, height, len(cameras) if has_views else planes)
        if has_views:
            return [(box, 0, camera) for box, camera in zip(boxes, cameras, strict=True)], []
        return [], [(box, 0, plane) for plane, box in enumerate(boxes)]
    half = width // 2
    rows = zip(cameras, _split(height, len(cameras)), strict=True)
    views = [(Rectangle(0, top, half, high), 0, camera) for camera, (top, high) in rows]
    halves = enumerate(_split(height, planes))
    plots = [(Rectangle(half, top, width - half, high), 0, plane) for plane, (top, high) in halves]
    return views, plots


def _side_by_side(width: int, height: int, count: int) -> list[Rectangle]:
    if width >= height:
        return [Rectangle(left, 0, wide, height) for left, wide in _split(width, count)]
    return [Rectangle(0, top, width, high) for top, high in _split(height, count)]


def _split(length: int, count: int) -> list[tuple[int, int]]:
    """Return starts and lengths of equal parts; the rest is left free at the end."""
    part = length // count
    return [(part * number, part) for number in range(count)]
