"""Weights of the channels of logs by the noise of each: generalised least squares, by estimated noise.

An angle off by 1 deg is to cost as much as tensions off by a tenth of their range. That is what a user would
call a good fit, but says nothing about noise: a load cell may tell many times more. Where a fit leaves
nothing but noise, samples of each channel weigh by what is left in it (Zellner 1962), and more is known.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import channels, scales_of

Array = NDArray[np.float64]

MOST = 30.0
"""Largest factor between a scale and the usual one: a channel that is met exactly does not outweigh all."""


def weighed(loops: Sequence[MeasuredLoop], residual: Array) -> list[MeasuredLoop]:
    """Return logs whose samples cost the same by what a fit leaves of each channel, in sum as before.

    Args:
        loops: the logs, with their usual scales.
        residual: what the fit leaves, of `residuals`, (R,).
    """
    places = channels(loops)
    left = np.array([float(residual[place] @ residual[place]) for of_log in places for place in of_log])
    count = np.array([place.stop - place.start for of_log in places for place in of_log])
    total = left.sum()
    if not total > 0:
        return list(loops)
    each = left / np.maximum(count, 1) / (total / count.sum())
    factor = np.clip(np.sqrt(each), 1 / MOST, MOST)
    factor *= np.sqrt((left / factor**2).sum() / total)  # what was clipped would change the sum
    ends = np.cumsum([len(of_log) for of_log in places])[:-1]
    return [
        dataclasses.replace(loop, scales=scales_of(loop) * of_log)
        for loop, of_log in zip(loops, np.split(factor, ends), strict=True)
    ]
