"""Innovations in units of what prediction and sensor together state: 1 in the mean where both hold (NIS)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator
from twin.estimation.gaussian import DEVIATIONS_OF_95

Array = NDArray[np.float64]


def squared_innovations(
    estimator: Estimator[Any],
    pull_mm: Array,
    measurement_deg: Array,
    initial_bend_deg: Array,
    variance: Array,
    first: int = 1,
) -> Array:
    """Return squared innovations over their stated variance (Bar-Shalom et al. 2001), NaN where none is.

    What an estimator says where no measurement comes is its prediction, with an interval of its own.

    Args:
        estimator: that states intervals, and is told of its sensor already.
        pull_mm: (N, B) pulling distance [mm].
        measurement_deg: (N, B) measured angle [deg].
        initial_bend_deg: (B,) initial estimate [deg].
        variance: (B,) R of the sensor [deg^2].
        first: sample that the result begins at, 1 at least.

    Returns:
        (N - first, B) of each sample.
    """
    state = estimator.start(pull_mm[0], initial_bend_deg)
    squares = np.empty((max(len(pull_mm) - first, 0), pull_mm.shape[1]))
    missing = np.full(pull_mm.shape[1], np.nan)
    for k in range(1, len(pull_mm)):
        if k >= first:
            unseen = estimator.step(state, pull_mm[k], pull_mm[k - 1], missing)
            stated = (estimator.half_width_deg(unseen) / DEVIATIONS_OF_95) ** 2 + variance
            squares[k - first] = (measurement_deg[k] - estimator.bend_deg(unseen)) ** 2 / stated
        state = estimator.step(state, pull_mm[k], pull_mm[k - 1], measurement_deg[k])
    return squares
