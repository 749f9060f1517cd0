"""Weights of the channels of logs by the noise of each: generalised least squares, as far as it is known.

An angle off by 1 deg is to cost as much as tensions off by a tenth of their range. That is what a user would
call a good fit, but says nothing about noise: a load cell may tell many times more. Where a fit leaves
nothing but noise, each channel weighs by what is left in it (Zellner 1962), and parameters are known better.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import channels, scales_of

Array = NDArray[np.float64]

MOST = 30.0
"""Largest change of a scale: a channel that is met exactly does not outweigh all others."""


def weighed(loops: Sequence[MeasuredLoop], residual: Array) -> list[MeasuredLoop]:
    """Return logs with scales by which what a fit leaves of each channel costs the same, in sum as before.

    Args:
        loops: the logs.
        residual: what the fit leaves, of `residuals`, (R,).
    """
    places = channels(loops)
    left = [np.array([float(residual[place] @ residual[place]) for place in of_log]) for of_log in places]
    mean = float(np.mean(np.concatenate(left)))
    if not mean > 0:
        return list(loops)
    return [
        dataclasses.replace(loop, scales=scales_of(loop) * np.clip(np.sqrt(of_log / mean), 1 / MOST, MOST))
        for loop, of_log in zip(loops, left, strict=True)
    ]
