"""Whether a log shows hysteresis: one that was steered by its own angle, or of a stiff device, may not."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BINS = 24  # of the command
FEWEST = 5  # samples of a bin in either direction
LEAST_SHARE = 0.01  # of the range of the angle
WITHOUT = "shows no hysteresis: friction cannot be known from it; was it steered by its own angle?"


def hysteresis_share(pull: Array, bend: Array) -> tuple[float, float]:
    """Return the width of the loops of a log, as a share of the range of its angle, and its deviation.

    The width is the difference of the angle (N,) between falling and rising commands (N,) of equal size, its
    median over the stroke; NaN where no command occurs in both directions. NaN angles are left out.
    """
    way = np.sign(np.diff(pull, prepend=pull[:1]))
    known = ~np.isnan(bend)
    span = float(np.ptp(bend[known])) if known.any() else 0.0
    if span == 0.0 or np.ptp(pull) == 0.0:
        return np.nan, np.nan
    place = np.minimum((BINS * (pull - pull.min()) / np.ptp(pull)).astype(int), BINS - 1)
    widths, variances = [], []
    for number in range(BINS):
        rising, falling = (bend[known & (place == number) & (way == sign)] for sign in (1, -1))
        if min(len(rising), len(falling)) >= FEWEST:
            widths.append(falling.mean() - rising.mean())
            variances.append(falling.var() / len(falling) + rising.var() / len(rising))
    if not widths:
        return np.nan, np.nan
    along = np.sign(np.polyfit(pull[known], bend[known], 1)[0]) or 1.0
    count = len(widths)
    return float(along * np.median(widths) / span), float(np.sqrt(np.sum(variances)) / count / span)


def without_hysteresis(logs: Iterable[tuple[str, Array, Array]]) -> list[str]:
    """Return a warning for each log (name, command, angle) whose loops have hardly a width."""
    warnings = []
    for name, pull, bend in logs:
        share, deviation = hysteresis_share(pull, bend)
        if share < max(LEAST_SHARE, 2 * deviation):
            warnings.append(f"{name} {WITHOUT}")
    return warnings
