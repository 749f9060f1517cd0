"""Soft shadows of the endoscope: its centre line, thrown onto a wall or a floor and blurred.

What is blurred needs no edges: the shadow is drawn from the centre line and the thickness alone, which costs
the renderer nothing and goes on any background.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter

from twin.physics.drawing.canvas import View
from twin.rendering.layers import Layer

Array = NDArray[np.float64]

_REDUCED = 2  # a blurred picture is as good at half its size


class Caster(NamedTuple):
    """Something that throws a shadow.

    Attributes:
        line: (n, 3) its centre line [m].
        radius: half its thickness [m].
    """

    line: Array
    radius: float


class Screen(NamedTuple):
    """Plane on which a shadow falls.

    Attributes:
        point: (3,) on it [m].
        normal: (3,) unit vector.
        light: (3,) way of the light.
        blur: standard deviation of the soft edge [m].
    """

    point: Array
    normal: Array
    light: Array
    blur: float


def shadow(
    casters: Sequence[Caster], screen: Screen, view: View, width: int, height: int, darkness: float
) -> Layer:
    """Return the shadow of casters as a black layer, (height, width, 4).

    Args:
        casters: what throws it.
        screen: where it falls.
        view: camera that sees it.
        width: of the picture [pixels].
        height: of the picture [pixels].
        darkness: alpha of its middle, from 0 to 1.
    """
    size = (-(-width // _REDUCED), -(-height // _REDUCED))
    mask = Image.new("L", size)
    pen = ImageDraw.Draw(mask)
    scale = 1.0
    for caster in casters:
        away = (screen.point - caster.line) @ screen.normal / (screen.light @ screen.normal)
        fallen = caster.line + away[:, None] * screen.light
        points = view.project(fallen, width, height) / _REDUCED
        scale = _pixels_per_metre(fallen, view, height) / _REDUCED
        thick = max(round(2 * caster.radius * scale), 1)
        pen.line([tuple(point) for point in points], 255, thick, joint="curve")
    soft = mask.filter(ImageFilter.GaussianBlur(screen.blur * scale)).resize(
        (width, height), Image.Resampling.BILINEAR
    )
    layer = np.zeros((height, width, 4), dtype=np.uint8)
    layer[..., 3] = np.rint(np.asarray(soft) * darkness)
    return layer


def _pixels_per_metre(points: Array, view: View, height: int) -> float:
    """Return the scale of a picture at the middle of points (n, 3)."""
    depth = 1.0 if view.parallel else float((points.mean(axis=0) - view.position) @ view.forward)
    return height / 2 / view.half_height / depth
