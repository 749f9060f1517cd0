"""Derivatives of residuals over the scale on which the logs tell the parameters.

Residuals of a twin with dry friction have kinks, where one more hinge or element begins to slide: between
them they are smooth, but a derivative at a point holds for a part of a standard deviation only. It ends a
descent early, and calls parameters better known than they are. Secants along the principal axes of what is
known, one standard deviation to either side, average over the kinks (statistical linearisation).
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHORTEST, LONGEST = 1e-3, 0.3
"""Least and largest reach of a secant to either side, in the parameter that moves most."""


def secants(
    residuals: Callable[[Sequence[Array]], Array],
    numbers: Array,
    around: Array,
    variance: float,
    bounds: tuple[Array, Array],
) -> Array:
    """Return the derivative of the residuals at a point, by secants over what is not told (R, P).

    Args:
        residuals: of points (P,) of the search space, (points, R).
        numbers: the point.
        around: the derivative as far as it is known, which tells the axes (R, P).
        variance: of a residual.
        bounds: lowest and highest point, (P,) each.
    """
    _, told, axes = np.linalg.svd(np.nan_to_num(around), full_matrices=False)
    longest = np.abs(axes).max(axis=1)  # of the unit vectors: between 1 / sqrt(P) and 1
    reach = np.clip(np.sqrt(variance) / np.maximum(told, 1e-300), SHORTEST / longest, LONGEST / longest)
    ways = axes * reach[:, None]
    above, below = np.clip(numbers + ways, *bounds), np.clip(numbers - ways, *bounds)
    off = residuals([*above, *below])
    change: Array = (off[: len(ways)] - off[len(ways) :]).T
    derivative: Array = change @ np.linalg.pinv((above - below).T)
    return derivative


def variance_of(residual: Array, parameters: int) -> float:
    """Return the variance of residuals (R,), as if they were independent of each other.

    Residuals of neighbouring samples are alike, so that there is less information than samples: it is
    inflated by (1 + r) / (1 - r), with r their correlation from one sample to the next (the effective number
    of samples of an AR(1) process, Bayley and Hammersley 1946).
    """
    freedom = max(len(residual) - parameters, 1)
    power = float(residual @ residual)
    r = float(np.clip(residual[1:] @ residual[:-1] / power, 0.0, 0.999)) if power > 0 else 0.0
    return power / freedom * (1 + r) / (1 - r)
