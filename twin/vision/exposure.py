"""Exposure of a picture: motion while its rows are open, blur of the lens, noise and saturation."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.vision.opencv import cv2
from twin.vision.rig import StereoRig

Array = NDArray[np.float64]
Grey = NDArray[np.float32]

MOST_INSTANTS = 12
"""Most instants at which a moving scene is drawn for one picture."""
_STILL_PX = 0.25  # motion that is not seen
_SHOT_SHARE = 0.7  # of the variance at mid-grey that grows with the light; the rest is that of reading


def instants(rig: StereoRig, speed: float) -> Array:
    """Return the instants at which a scene is drawn for one picture, about its time [s].

    Args:
        rig: exposure and shutter.
        speed: of the picture's content [pixels / s].

    Returns:
        (n,) instants, so close that nothing moves by more than a pixel between two of them.
    """
    span = rig.exposure_s + rig.rolling_shutter_s
    moved = speed * span
    count = 1 if moved < _STILL_PX else min(int(np.ceil(moved)) + 1, MOST_INSTANTS)
    return np.linspace(-span / 2, span / 2, count) if count > 1 else np.zeros(1)


def row_weights(rig: StereoRig, when: Array) -> Array:
    """Return the share that the scene at each instant has in each row of a picture, (instants, rows).

    Row r is open from t_r - exposure / 2 to t_r + exposure / 2, where t_r goes from - rolling / 2 to
    + rolling / 2 down the picture. The scene is taken to be linear between two instants.
    """
    middle = (np.arange(rig.height) / max(rig.height - 1, 1) - 0.5) * rig.rolling_shutter_s
    if len(when) == 1:
        return np.ones((1, rig.height))
    fine = np.linspace(-0.5, 0.5, 33) * rig.exposure_s
    place = np.interp(middle[:, None] + fine, when, np.arange(len(when)))
    hats = np.clip(1 - np.abs(place[..., None] - np.arange(len(when))), 0, 1)
    weights: Array = hats.mean(axis=1).T
    weights /= weights.sum(axis=0)
    return weights


def expose(scene: Callable[[float], Grey], when: Sequence[float] | Array, weights: Array) -> Grey:
    """Return the mean of a scene (height, width) over instants, row by row."""
    picture: Grey | None = None
    for instant, rows in zip(when, weights, strict=True):
        part = scene(float(instant)) * rows[:, None].astype(np.float32)
        picture = part if picture is None else picture + part
    assert picture is not None
    return picture


def develop(picture: Grey, rig: StereoRig, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return the grey levels that a sensor gives for the light on it: blur, gain, noise, and saturation.

    The variance of the noise is that of reading and that of counting photons, which grows with the light.

    Args:
        picture: (height, width) light, 0 to 255.
        rig: parameters.
        rng: source of random numbers.
    """
    if rig.blur_px > 0:
        picture = cv2.GaussianBlur(picture, (0, 0), rig.blur_px)
    light = rig.brightness * np.clip(picture, 0, None)
    variance = rig.pixel_noise**2 * (1 - _SHOT_SHARE + _SHOT_SHARE * light / 128)
    noisy = light + np.sqrt(variance) * rng.standard_normal(light.shape, dtype=np.float32)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
