"""Descent of a search: least squares in a trust region on the reduced twin, and its derivatives."""

import threading
from collections.abc import Sequence
from concurrent.futures import CancelledError

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import penalised
from twin.calibration.parameters import FreeParameters
from twin.calibration.secants import secants, variance_of
from twin.calibration.valley import Valley

Array = NDArray[np.float64]

STRIDE = 1e-3
"""Stride of differences, with which a descent begins."""
ROUGH, SMOOTH = (1e-5, 1e-4), (1e-5, 1e-5)
"""Relative change of the cost, and of the point, at which a descent ends: by differences, and by secants."""


def descend(
    free: FreeParameters,
    loops: Sequence[MeasuredLoop],
    start: Array,
    steps: int,
    weight: float,
    *,
    smooth: bool,
    threads: int,
    stopped: threading.Event,
) -> Array:
    """Return the cost that least squares (SciPy's `trf`) reaches from a point, and where, (1 + P,).

    Args:
        free: the fitted parameters.
        loops: the logs.
        start: where it begins, (P,).
        steps: most steps.
        weight: of the first guess, of `prior_weight`.
        smooth: derivatives are `secants`, and it goes to the bottom; else one-sided differences, at half the
            cost.
        threads: number of threads of the derivatives; 0 for one per core.
        stopped: ends it early.

    Raises:
        CancelledError: it was stopped.
    """
    valley = Valley(free)
    margin = 1e-6
    last: list[Array] = []

    def of_one(straight: Array) -> Array:
        if stopped.is_set():
            raise CancelledError
        residual: Array = penalised(free, [valley.within(straight)], loops, "reduced", weight, threads=1)[0]
        return residual

    def slope(straight: Array) -> Array:
        numbers = valley.within(straight)
        if not smooth:
            return valley.slope(differences(free, loops, numbers, weight, threads=threads), numbers)
        last[:] = [
            over_what_is_told(free, loops, numbers, weight, last[0] if last else None, threads=threads)
        ]
        return valley.slope(last[0], numbers)

    of_cost, of_point = SMOOTH if smooth else ROUGH
    result = least_squares(
        of_one,
        valley.straight(np.clip(start, free.lower + margin, free.upper - margin)),
        jac=slope,
        bounds=valley.bounds(),
        max_nfev=steps,
        x_scale="jac",
        ftol=of_cost,
        xtol=of_point,
    )
    return np.array([2 * result.cost, *valley.within(result.x)])


def over_what_is_told(
    free: FreeParameters,
    loops: Sequence[MeasuredLoop],
    numbers: Array,
    weight: float,
    around: Array | None = None,
    *,
    threads: int = 0,
) -> Array:
    """Return the derivative of the residuals (R, P) at a point, over the scale on which the logs tell it.

    Args:
        free: the fitted parameters.
        loops: the logs.
        numbers: the point, (P,).
        weight: of the first guess.
        around: the derivative nearby, which tells that scale; `differences` if not given.
        threads: number of threads; 0 for one per core.
    """
    if around is None:
        around = differences(free, loops, numbers, weight, threads=threads)
    here = penalised(free, [numbers], loops, "reduced", weight, threads)[0]
    return secants(
        lambda points: penalised(free, points, loops, "reduced", weight, threads),
        numbers,
        around,
        variance_of(here, len(numbers)),
        (free.lower, free.upper),
    )


def differences(
    free: FreeParameters, loops: Sequence[MeasuredLoop], numbers: Array, weight: float, *, threads: int = 0
) -> Array:
    """Return the derivative of the residuals (R, P) at a point, by differences to one side."""
    steps = np.where(numbers + STRIDE <= free.upper, STRIDE, -STRIDE)
    off = penalised(free, [numbers, *(numbers + np.diag(steps))], loops, "reduced", weight, threads)
    derivative: Array = ((off[1:] - off[0]) / steps[:, None]).T
    return derivative
