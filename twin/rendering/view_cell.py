"""View of an endoscope in a composition: its pose with ghost and shadow, and the marks on it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from twin.rendering.actor import Actor
from twin.rendering.cameras import Shot, rounded
from twin.rendering.layers import Layer, faded, over, reduced
from twin.rendering.look import Look
from twin.rendering.marks import Bar, Label, Mark, Rule
from twin.rendering.numbers import angle, signed
from twin.rendering.shadow import shadow
from twin.rendering.tension_colours import TensionColours

if TYPE_CHECKING:
    from twin.rendering.composition import Record

GHOST_INK = 0.34
"""Share of its ink that a ghost is drawn with."""
_SCALES_MM = (0.5, 1, 2, 5, 10, 20, 50, 100, 200)


class Rectangle(NamedTuple):
    """Rectangle in a composition [pixels].

    Attributes:
        left: of its left side.
        top: of its upper side.
        width: of it.
        height: of it.
    """

    left: int
    top: int
    width: int
    height: int


class ViewCell:
    """View of one record.

    Attributes:
        box: where it stands in the composition.
        record: what it shows.
        number: of the record in the composition.
        shot: its camera.
        actors: the endoscope, and its ghost if there is one.
        unit: size of a pixel of text, in pixels of a composition that is 720 high.
        is_lateral: whether it shows the second bending plane.
    """

    def __init__(
        self,
        box: Rectangle,
        record: "Record",
        number: int,
        shot: Shot,
        actors: Sequence[Actor],
        look: Look,
        colours: TensionColours | None,
        unit: float,
        fineness: int,
        *,
        is_first: bool,
        lateral: bool,
    ) -> None:
        """Say what is seen.

        Args:
            box: where it stands in the composition.
            record: what it shows.
            number: of the record in the composition.
            shot: its camera.
            actors: of the record and its ghost, whose canvases are open.
            look: options.
            colours: of the wires; None where no tension is known.
            unit: size of a pixel of text, in pixels of a composition that is 720 high.
            fineness: pixels that are drawn for each that is kept, along a side.
            is_first: whether it is the first view of its record, which has the marks of the record.
            lateral: whether it shows the second bending plane.
        """
        self.box, self.record, self.number, self.shot, self.actors = box, record, number, shot, actors
        self._look, self._theme, self._colours = look, look.theme, colours
        self.unit, self._fineness = unit, fineness
        self._is_first, self.is_lateral = is_first, lateral

    def scene(self, index: int) -> Layer:
        """Return the endoscope at a sample, before its ghost and its shadow, (height, width, 4)."""
        picture = self.pose(index)
        for ghost in self.actors[1:]:
            picture = over(picture, faded(self._layer(ghost, index), GHOST_INK))
        return picture if self.shot.is_round else over(picture, self._shadow([index]))

    def poses(self, solid: Sequence[int], pale: Sequence[int], ink: float) -> Layer:
        """Return poses of the record over one another: the first solid one in front, pale ones behind."""
        front = self.pose(solid[0])
        for index in solid[1:]:
            front = over(front, self.pose(index))
        behind = np.zeros_like(front)
        for index in pale:
            behind = over(behind, self.pose(index))
        return over(over(front, faded(behind, ink)), self._shadow(solid))

    def pose(self, index: int) -> Layer:
        """Return the endoscope alone at a sample, (height, width, 4)."""
        return self._layer(self.actors[0], index)

    def tip(self, index: int, actor: int = 0) -> tuple[float, float]:
        """Return where the tip is in the picture, as (column, row) [pixels].

        Args:
            index: of the sample.
            actor: 1 for the tip of the ghost.
        """
        who = self.actors[actor]
        tip = self.shot.view(self.actors[0], index).project(who.chain[index, -1], *self._size)
        return float(tip[0]), float(tip[1])

    def marks(self, index: int, *, moving: bool = True) -> list[Mark]:
        """Return the numbers of a sample, scale bar and colour bar.

        Args:
            index: of the sample.
            moving: False leaves the numbers out.
        """
        marks = self._caption()
        if moving:
            marks += self._numbers(index)
        if self.shot.has_scale:
            marks += self._scale_bar()
        if self.shot.scene == "overview":
            marks.append(self._sheath_note(index))
        hidden = self.shot.scene == "lumen" or (self.shot.scene == "bench" and self._look.sleeve == "whole")
        if self._is_first and self._colours is not None and not hidden:
            marks += self._colour_bar(self._colours)
        return marks

    @property
    def _size(self) -> tuple[int, int]:
        return self.box.width, self.box.height

    @property
    def _left(self) -> float:
        return 36 * self.unit

    def _layer(self, actor: Actor, index: int) -> Layer:
        # A ghost is seen by the camera of the endoscope itself.
        layer = actor.layer(index, self.shot.view(self.actors[0], index))
        if self._fineness > 1:
            layer = reduced(layer, self._fineness)
        return rounded(layer) if self.shot.is_round else layer

    def _shadow(self, samples: Sequence[int]) -> Layer:
        if self.shot.screen is None:
            return np.zeros((self.box.height, self.box.width, 4), dtype=np.uint8)
        actor = self.actors[0]
        casters = [caster for index in samples for caster in self.shot.casters(actor, index)]
        view = self.shot.view(actor, samples[0])
        return shadow(casters, self.shot.screen, view, *self._size, self._theme.shadow)

    def _caption(self) -> list[Mark]:
        """Return the title of a record among several."""
        if not self.record.title:
            return []
        return [
            Label(self._left, 30 * self.unit, self.record.title, self._theme.ink, 17 * self.unit, bold=True)
        ]

    def _numbers(self, index: int) -> list[Mark]:
        episode, unit, theme = self.record.episode, self.unit, self._theme
        top, small = (30 * unit if self.record.title else 0.0), 17 * unit
        if self.is_lateral:
            bend = float(np.degrees(episode.lateral_bend[index]))
            caption, pull_mm = "lateral bending angle", episode.lateral_pull * 1e3
        else:
            caption, bend, pull_mm = "bending angle", float(episode.truth_deg[index]), episode.pull_mm
        lines = [(f"pull {signed(float(pull_mm[index]), 2)} mm", theme.ink)] if len(pull_mm) else []
        if self._is_first:
            lines.append((f"time {episode.time[index]:.1f} s", theme.muted))
        if self.record.beside.ghost is not None and not self.is_lateral:
            ghost = self.record.beside.ghost.truth_deg[index]
            lines.append((f"{self.record.beside.short_name} {angle(ghost)}", theme.muted))
        self._below = top + (128 + 26 * len(lines)) * unit
        marks: list[Mark] = [
            self._line(top + 46 * unit, caption, theme.muted, small),
            self._line(top + 98 * unit, angle(bend), theme.trace, 46 * unit, bold=True),
        ]
        for row, (text, colour) in enumerate(lines):
            marks.append(self._line(top + (128 + 26 * row) * unit, text, colour, small))
        return marks

    def line_below_numbers(self, text: str) -> Mark:
        """Return one more line below the numbers that `marks` returned last."""
        return self._line(self._below, text, self._theme.muted, 17 * self.unit)

    def _line(self, y: float, text: str, colour: str, size: float, *, bold: bool = False) -> Label:
        """Return a line of the numbers: on the right if the camera follows the tip, whose shaft is left."""
        if self.shot.follows and not self.shot.is_round:
            return Label(self.box.width - self._left, y, text, colour, size, bold, "rs")
        return Label(self._left, y, text, colour, size, bold)

    def _scale_bar(self) -> list[Mark]:
        length_mm, length = self.scale_bar()
        left, bottom, unit = self._left, self.box.height - 32 * self.unit, self.unit
        return [
            Rule(((left, bottom), (left + length, bottom)), self._theme.ink, 2.4 * unit),
            Label(left, bottom - 9 * unit, f"{length_mm:g} mm", self._theme.muted, 16 * unit),
        ]

    def scale_bar(self) -> tuple[float, float]:
        """Return the length of a scale bar that fits the picture: (millimetres, pixels)."""
        seen_mm = 2e3 * self.shot.view(self.actors[0], 0).half_height
        length_mm = max(step for step in _SCALES_MM if step <= max(seen_mm / 5, _SCALES_MM[0]))
        return length_mm, length_mm / seen_mm * self.box.height

    def _colour_bar(self, colours: TensionColours) -> list[Mark]:
        """Return the bar of tensions where no pose reaches: over the scale bar, else lower right."""
        unit, theme = self.unit, self._theme
        width, height = 130 * unit, 8 * unit
        left, bottom = self._left, self.box.height - 94 * unit
        if self.shot.scene == "overview" or self.shot.follows:
            left, bottom = self.box.width - self._left - width, self.box.height - 46 * unit
        steps = colours(np.linspace(0, colours.highest_n, 64))
        ends = bottom + 17 * unit
        return [
            Bar(left, bottom - height, width, height, steps),
            Label(left, bottom - height - 8 * unit, "wire tension [N]", theme.muted, 16 * unit),
            Label(left, ends, "0", theme.muted, 14 * unit),
            Label(left + width, ends, f"{colours.highest_n:g}", theme.muted, 14 * unit, anchor="rs"),
        ]

    def _sheath_note(self, index: int) -> Mark:
        actor, bend = self.actors[0], self.record.episode.sheath_bend
        bent = float(np.degrees(bend[index] if len(bend) else actor.preset.sheath_bend))
        length_mm = 1e3 * actor.preset.sheath_length
        text = f"sheath bent by {bent:.0f}° ({length_mm:g} mm, drawn shorter)"
        return Label(self._left, self.box.height - 32 * self.unit, text, self._theme.muted, 16 * self.unit)
