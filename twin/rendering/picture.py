"""Pictures: layers over one another, marks on them, and numbers as they are written.

A layer is (height, width, 4), red, green, blue and alpha from 0 to 255; its colours are multiplied by alpha.
Marks are described once: a film paints them into pixels, a figure for print plots them as vectors. Places and
sizes are in pixels of the picture, from its upper left corner.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import get_data_path
from matplotlib.axes import Axes
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw, ImageFont

from twin.rendering.look import Theme

Array = NDArray[np.float64]
Layer = NDArray[np.uint8]
Picture = NDArray[np.uint8]  # (height, width, 3) red, green and blue
MINUS = "\N{MINUS SIGN}"


def over(front: Layer, below: Layer) -> Layer:
    """Return a layer over another (Porter and Duff 1984)."""
    image = Image.fromarray(front)
    through = ImageChops.invert(image.getchannel("A"))
    seen = ImageChops.multiply(Image.fromarray(below), Image.merge("RGBA", [through] * 4))
    return np.asarray(ImageChops.add(image, seen))


def faded(layer: Layer, share: float) -> Layer:
    """Return a layer with a share of its ink."""
    return np.asarray(Image.fromarray(layer).point([round(share * level) for level in range(256)] * 4))


def on_paper(layer: Layer, theme: Theme) -> Picture:
    """Return a layer on the paper of a theme, without transparency."""
    image = Image.fromarray(layer)
    through = ImageChops.invert(image.getchannel("A"))
    paper = Image.new("RGB", image.size, theme.paper)
    seen = ImageChops.multiply(paper, Image.merge("RGB", [through] * 3))
    # Without `convert`, which would divide by alpha.
    return np.asarray(ImageChops.add(Image.merge("RGB", image.split()[:3]), seen))


def straight(layer: Layer) -> Layer:
    """Return a layer whose colours are not multiplied by alpha, as files hold them."""
    alpha = layer[..., 3:].astype(float)
    colour = np.divide(255.0 * layer[..., :3], alpha, out=np.zeros(layer[..., :3].shape), where=alpha > 0)
    return np.concatenate([np.clip(np.rint(colour), 0, 255).astype(np.uint8), layer[..., 3:]], axis=-1)


def reduced(layer: Layer, factor: int) -> Layer:
    """Return a layer reduced by an integer factor, each pixel the mean of those that it covers."""
    bands = [Image.fromarray(layer[..., band]).reduce(factor) for band in range(4)]
    return np.stack([np.asarray(band) for band in bands], axis=-1)


class Label(NamedTuple):
    """Line of text at (x, y): `anchor` is l, m or r horizontally, s (baseline) or m vertically."""

    x: float
    y: float
    text: str
    colour: str
    size: float
    bold: bool = False
    anchor: str = "ls"


class Rule(NamedTuple):
    """Straight line between two points."""

    points: tuple[tuple[float, float], tuple[float, float]]
    colour: str
    width: float


class Bar(NamedTuple):
    """Level colour bar from its upper left corner: colours (n, 3) from left to right, from 0 to 1."""

    x: float
    y: float
    width: float
    height: float
    colours: Array


class Badge(NamedTuple):
    """Number in a round spot about (x, y)."""

    x: float
    y: float
    text: str
    colour: str
    size: float
    ink: str = "#ffffff"


Mark = Label | Rule | Bar | Badge


def paint(picture: Image.Image, marks: Sequence[Mark]) -> None:
    """Draw marks into the pixels of a picture."""
    pen = ImageDraw.Draw(picture)
    for mark in marks:
        match mark:
            case Label(x, y, text, colour, size, bold, anchor):
                pen.text((x, y), text, colour, _font(size, bold=bold), anchor=anchor)
            case Rule(points, colour, width):
                pen.line(points, colour, max(round(width), 1))
            case Bar(x, y, width, height, colours):
                along = np.linspace(0, len(colours) - 1, max(round(width), 2)).round().astype(int)
                row = np.rint(255 * colours[along]).astype(np.uint8)
                strip = np.repeat(row[None], max(round(height), 1), axis=0)
                picture.paste(Image.fromarray(strip), (round(x), round(y)))
            case Badge(x, y, text, colour, size, ink):
                reach = 0.85 * size
                box = (x - reach, y - reach, x + reach, y + reach)
                pen.ellipse(box, colour, ink, max(round(size / 9), 1))
                pen.text((x, y), text, ink, _font(size, bold=True), anchor="mm")


def plot(axes: Axes, marks: Sequence[Mark], points_per_pixel: float) -> None:
    """Draw marks into axes whose units are the pixels of the picture that they show, y downwards."""
    sides = {"l": "left", "m": "center", "r": "right"}
    levels = {"s": "baseline", "m": "center"}
    for mark in marks:
        match mark:
            case Label(x, y, text, colour, size, bold, anchor):
                style: dict[str, Any] = {"fontsize": size * points_per_pixel, "parse_math": False}
                style |= {"fontweight": "bold" if bold else "normal", "ha": sides[anchor[0]]}
                axes.text(x, y, text, color=colour, va=levels[anchor[1]], **style)
            case Rule(points, colour, width):
                xs, ys = zip(*points, strict=True)
                axes.plot(xs, ys, color=colour, linewidth=width * points_per_pixel, solid_capstyle="butt")
            case Bar(x, y, width, height, colours):
                extent = (x, x + width, y + height, y)
                axes.imshow(colours[None], extent=extent, aspect="auto", interpolation="bilinear")
            case Badge(x, y, text, colour, size, ink):
                number(axes, x, y, text, colour, ink, size * points_per_pixel)


def number(
    axes: Axes, x: float, y: float, text: str, colour: str, ink: str, size: float, pad: float = 0.22
) -> None:
    """Write a number in a round spot into axes; its font is `size` points high."""
    box = {"boxstyle": f"circle,pad={pad}", "facecolor": colour, "edgecolor": ink}
    axes.text(x, y, text, color=ink, fontsize=size, fontweight="bold", ha="center", va="center", bbox=box)


@functools.lru_cache(maxsize=64)
def _font(size: float, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/{name}", size)


def signed(value: float, digits: int = 1) -> str:
    """Return a number with its sign, by a true minus sign; one that rounds to zero has none."""
    text = f"{value:+z.{digits}f}"
    return text[1:] if float(text) == 0 else text.replace("-", MINUS)


def angle(value_deg: float, digits: int = 1) -> str:
    """Return an angle with its sign, as in `+12.3°`."""
    return f"{signed(value_deg, digits)}°"


def times_real(speed: float) -> str:
    """Return the speed of a film, as in `4x`, or `real time`."""
    return "real time" if speed == 1 else f"{speed:.3g}\N{MULTIPLICATION SIGN}"
