"""Layers of a picture: colours with transparency that lie over one another, and the paper below them.

A layer is (height, width, 4), red, green, blue and alpha from 0 to 255; its colours are multiplied by alpha.
Pillow does the arithmetic, in bytes.
"""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops

from twin.rendering.theme import Theme

Layer = NDArray[np.uint8]
Picture = NDArray[np.uint8]
"""(height, width, 3) red, green and blue."""


def over(front: Layer, behind: Layer) -> Layer:
    """Return a layer over another (Porter and Duff 1984)."""
    image = Image.fromarray(front)
    through = ImageChops.invert(image.getchannel("A"))
    seen = ImageChops.multiply(Image.fromarray(behind), Image.merge("RGBA", [through] * 4))
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
    """Return a layer reduced by a whole factor, each pixel the mean of those that it covers."""
    bands = [Image.fromarray(layer[..., band]).reduce(factor) for band in range(4)]
    return np.stack([np.asarray(band) for band in bands], axis=-1)
