"""Marks on a picture: text, lines and a colour bar, described once and drawn by Pillow or by matplotlib.

A film draws them into pixels, a figure for print as vectors. Places and sizes are in pixels of the picture
that they are on, from its upper left corner.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import get_data_path
from matplotlib.axes import Axes
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Array = NDArray[np.float64]


class Label(NamedTuple):
    """Line of text.

    Attributes:
        x: of its anchor [pixels].
        y: of its baseline or middle [pixels].
        text: what is written.
        colour: `#rrggbb`.
        size: height of the font [pixels].
        bold: whether it is.
        anchor: horizontally `l`, `m` or `r`, vertically `s` (baseline) or `m` (middle).
    """

    x: float
    y: float
    text: str
    colour: str
    size: float
    bold: bool = False
    anchor: str = "ls"


class Rule(NamedTuple):
    """Straight line.

    Attributes:
        points: ((x, y), (x, y)) its ends [pixels].
        colour: `#rrggbb`.
        width: of it [pixels].
    """

    points: tuple[tuple[float, float], tuple[float, float]]
    colour: str
    width: float


class Bar(NamedTuple):
    """Level colour bar.

    Attributes:
        x: of its left side [pixels].
        y: of its upper side [pixels].
        width: [pixels].
        height: [pixels].
        colours: (n, 3) from its left to its right end, from 0 to 1.
    """

    x: float
    y: float
    width: float
    height: float
    colours: Array


class Badge(NamedTuple):
    """Number in a round spot.

    Attributes:
        x: of its middle [pixels].
        y: of its middle [pixels].
        text: the number.
        colour: of the spot, `#rrggbb`.
        size: height of the font [pixels].
        ink: of the number and of the spot's edge, `#rrggbb`.
    """

    x: float
    y: float
    text: str
    colour: str
    size: float
    ink: str = "#ffffff"


Mark = Label | Rule | Bar | Badge


def paint(picture: Image.Image, marks: Sequence[Mark]) -> None:
    """Draw marks into a picture."""
    pen = ImageDraw.Draw(picture)
    for mark in marks:
        match mark:
            case Label(x, y, text, colour, size, bold, anchor):
                pen.text((x, y), text, colour, font(size, bold=bold), anchor=anchor)
            case Rule(points, colour, width):
                pen.line(points, colour, max(round(width), 1))
            case Bar(x, y, width, height, colours):
                along = np.linspace(0, len(colours) - 1, max(round(width), 2)).round().astype(int)
                row = np.rint(255 * colours[along]).astype(np.uint8)
                strip = np.repeat(row[None], max(round(height), 1), axis=0)
                picture.paste(Image.fromarray(strip), (round(x), round(y)))
            case Badge(x, y, text, colour, size, ink):
                reach = 0.85 * size
                pen.ellipse(
                    (x - reach, y - reach, x + reach, y + reach), colour, ink, max(round(size / 9), 1)
                )
                pen.text((x, y), text, ink, font(size, bold=True), anchor="mm")


def plot(axes: Axes, marks: Sequence[Mark], points_per_pixel: float) -> None:
    """Draw marks into axes whose units are the pixels of the picture that they show.

    Args:
        axes: its y axis points downwards.
        marks: what to draw.
        points_per_pixel: size of a pixel in the figure, in 1/72 inch.
    """
    sides = {"l": "left", "m": "center", "r": "right"}
    levels = {"s": "baseline", "m": "center"}
    for mark in marks:
        match mark:
            case Label(x, y, text, colour, size, bold, anchor):
                axes.text(
                    x,
                    y,
                    text,
                    color=colour,
                    fontsize=size * points_per_pixel,
                    fontweight="bold" if bold else "normal",
                    ha=sides[anchor[0]],
                    va=levels[anchor[1]],
                    parse_math=False,
                )
            case Rule(points, colour, width):
                xs, ys = zip(*points, strict=True)
                axes.plot(xs, ys, color=colour, linewidth=width * points_per_pixel, solid_capstyle="butt")
            case Bar(x, y, width, height, colours):
                extent = (x, x + width, y + height, y)
                axes.imshow(colours[None], extent=extent, aspect="auto", interpolation="bilinear")
            case Badge(x, y, text, colour, size, ink):
                box = {"boxstyle": "circle,pad=0.22", "facecolor": colour, "edgecolor": ink}
                style: Any = {"color": ink, "fontsize": size * points_per_pixel, "fontweight": "bold"}
                axes.text(x, y, text, ha="center", va="center", bbox=box, **style)


@functools.lru_cache(maxsize=64)
def font(size: float, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return the font of the axes for text that Pillow writes, `size` pixels high."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/{name}", size)
