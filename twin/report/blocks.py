"""Block diagrams: boxes on a grid, and arrows between them, by matplotlib alone."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from twin.report.figures import INK, MUTED

Place = tuple[float, float]
LINE_HEIGHT = 0.155
"""Height of a line of text in a box, in units of the grid."""


@dataclasses.dataclass(frozen=True)
class Block:
    """A box of a diagram.

    Attributes:
        title: its first line.
        lines: below it, in small letters.
        place: of its middle, in columns from the left and rows from the top.
        width: in columns.
        shaded: whether it stands out: what is learned.
    """

    title: str
    lines: tuple[str, ...]
    place: Place
    width: float = 1.7
    shaded: bool = False

    @property
    def height(self) -> float:
        """Height of the box, in rows."""
        return 0.34 + LINE_HEIGHT * len(self.lines)

    def edge(self, towards: Place) -> Place:
        """Return the middle of the side that faces a place."""
        x, y = self.place
        right, down = towards[0] - x, towards[1] - y
        if abs(right) * self.height >= abs(down) * self.width:
            return x + (self.width / 2 if right > 0 else -self.width / 2), y
        return x, y + (self.height / 2 if down > 0 else -self.height / 2)


@dataclasses.dataclass(frozen=True)
class Flow:
    """An arrow of a diagram.

    Attributes:
        begin: name of a block, or a place.
        end: the same.
        label: beside it.
        through: places that it goes by, each in a straight line.
        label_at: place of the label; the middle of the arrow, if not given.
    """

    begin: str | Place
    end: str | Place
    label: str = ""
    through: tuple[Place, ...] = ()
    label_at: Place | None = None


def block_diagram(blocks: Mapping[str, Block], flows: Sequence[Flow], size: Place) -> Figure:
    """Draw boxes and the arrows between them.

    Args:
        blocks: by name.
        flows: between them.
        size: columns and rows of the grid; a column is an inch on a full page.
    """
    figure = Figure(figsize=(size[0] * 1.02, size[1] * 1.02), layout="constrained")
    axes = figure.subplots()
    axes.set_xlim(0, size[0])
    axes.set_ylim(size[1], 0)
    axes.set_axis_off()
    axes.set_aspect("equal")
    for flow in flows:
        _draw_flow(axes, flow, blocks)
    for block in blocks.values():
        _draw_block(axes, block)
    return figure


def _draw_block(axes: Axes, block: Block) -> None:
    (x, y), height = block.place, block.height
    axes.add_patch(
        FancyBboxPatch(
            (x - block.width / 2, y - height / 2),
            block.width,
            height,
            boxstyle="round,pad=0,rounding_size=0.06",
            facecolor="#f3dedc" if block.shaded else "#eef1f4",
            edgecolor=INK,
            linewidth=1.0,
            zorder=3,
        )
    )
    top = y - LINE_HEIGHT * len(block.lines) / 2
    middle: dict[str, Any] = {"ha": "center", "va": "center", "color": INK, "zorder": 4}
    axes.text(x, top, block.title, fontsize=9, fontweight="bold", **middle)
    for number, line in enumerate(block.lines, start=1):
        at = top + 0.02 + LINE_HEIGHT * number
        axes.text(x, at, line, fontsize=7.5, **middle)


def _draw_flow(axes: Axes, flow: Flow, blocks: Mapping[str, Block]) -> None:
    ends = [blocks[end].place if isinstance(end, str) else end for end in (flow.begin, flow.end)]
    way = [ends[0], *flow.through, ends[1]]
    if isinstance(flow.begin, str):
        way[0] = blocks[flow.begin].edge(way[1])
    if isinstance(flow.end, str):
        way[-1] = blocks[flow.end].edge(way[-2])
    for begin, end in itertools.pairwise(way[:-1]):
        axes.plot([begin[0], end[0]], [begin[1], end[1]], color=INK, linewidth=1.0, zorder=2)
    axes.add_patch(
        FancyArrowPatch(
            way[-2], way[-1], arrowstyle="-|>", mutation_scale=9, color=INK, linewidth=1.0, zorder=2,
            shrinkA=0, shrinkB=0,
        )
    )  # fmt: skip
    if flow.label:
        longest = max(range(len(way) - 1), key=lambda k: _length(way[k], way[k + 1]))
        a, b = way[longest], way[longest + 1]
        level = abs(b[0] - a[0]) > abs(b[1] - a[1])
        middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
        x, y = flow.label_at or ((middle[0], middle[1] - 0.1) if level else (middle[0] + 0.07, middle[1]))
        axes.text(
            x,
            y,
            flow.label,
            ha="center" if level else "left",
            va="center",
            fontsize=7.5,
            color=MUTED,
            zorder=4,
        )


def _length(a: Place, b: Place) -> float:
    return float(abs(b[0] - a[0]) + abs(b[1] - a[1]))
