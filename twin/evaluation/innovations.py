"""Innovations in units of what prediction and sensor together state: 1 in the mean where both hold (NIS)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator
from twin.estimation.gaussian import DEVIATIONS_OF_95

Array = NDArray[np.float64]


class Innovated(NamedTuple):
    """Estimates of N samples of B runs, and their innovations.

    Attributes:
        bend_deg: (N, B) [deg].
        half_width_deg: (N, B) half of the 95 % intervals [deg].
        squares: (S, B) squared innovations over their stated variance at S samples, NaN where none is.
    """

    bend_deg: Array
    half_width_deg: Array
    squares: Array


def squared_innovations(
    estimator: Estimator[Any],
    pull_mm: Array,
    measurement_deg: Array,
    initial_bend_deg: Array,
    variance: Array,
    first: int = 1,
) -> Array:
    """Return the `squares` of `with_innovations` at every sample from `first` on, 1 at least."""
    samples = range(first, len(pull_mm))
    return with_innovations(estimator, pull_mm, measurement_deg, initial_bend_deg, variance, samples).squares


def with_innovations(
    estimator: Estimator[Any],
    pull_mm: Array,
    measurement_deg: Array,
    initial_bend_deg: Array,
    variance: Array,
    samples: range,
) -> Innovated:
    """Filter whole records, and square innovations over their stated variance (Bar-Shalom et al. 2001).

    What an estimator says where no measurement comes is its prediction, with an interval of its own.

    Args:
        estimator: that states intervals, and is told of its sensor already.
        pull_mm: (N, B) pulling distance [mm].
        measurement_deg: (N, B) measured angle [deg].
        initial_bend_deg: (B,) initial estimate [deg].
        variance: (B,) R of the sensor [deg^2].
        samples: at which innovations are found, from 1 on; each takes a further step.
    """
    state = estimator.start(pull_mm[0], initial_bend_deg)
    bend, half_width = np.empty_like(measurement_deg), np.empty_like(measurement_deg)
    bend[0], half_width[0] = initial_bend_deg, estimator.half_width_deg(state)
    squares = np.empty((len(samples), pull_mm.shape[1]))
    missing = np.full(pull_mm.shape[1], np.nan)
    for k in range(1, len(pull_mm)):
        if k in samples:
            unseen = estimator.step(state, pull_mm[k], pull_mm[k - 1], missing)
            stated = (estimator.half_width_deg(unseen) / DEVIATIONS_OF_95) ** 2 + variance
            squares[samples.index(k)] = (measurement_deg[k] - estimator.bend_deg(unseen)) ** 2 / stated
        state = estimator.step(state, pull_mm[k], pull_mm[k - 1], measurement_deg[k])
        bend[k], half_width[k] = estimator.bend_deg(state), estimator.half_width_deg(state)
    return Innovated(bend, half_width, squares)
