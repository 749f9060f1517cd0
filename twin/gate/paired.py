"""Paired comparison of two estimators on the same runs, with a hierarchical bootstrap.

Runs are nested: a twin (or log) along its command, and draws of the noise on it. Twins are drawn with
replacement, and draws within each (Davison and Hinkley 1997, section 3.8; Saravanan et al. 2020). Both
estimators see the same runs, so that their difference is free of what twin and noise have in common.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RESAMPLES = 2000
LOW, HIGH = 2.5, 97.5  # percentiles of a 95 % interval


class Paired(NamedTuple):
    """Root mean square errors of two estimators, and how far the first is above the second.

    Attributes:
        rmse_deg: of the first [deg].
        rival_deg: of the second [deg].
        difference_deg: first minus second [deg].
        low_deg: lower end of the 95 % interval of that [deg].
        high_deg: upper end of it [deg].
    """

    rmse_deg: float
    rival_deg: float
    difference_deg: float
    low_deg: float
    high_deg: float

    @property
    def relative_high(self) -> float:
        """Upper end of the interval in units of the second's error: below 0, the first is better."""
        return self.high_deg / max(self.rival_deg, 1e-9)


def compare_paired(squares: Array, rival: Array, rng: np.random.Generator) -> Paired:
    """Compare two estimators by their root mean square errors.

    Args:
        squares: (units, draws) mean square error of each run of the first [deg^2].
        rival: the same runs by the second [deg^2].
        rng: of the resampling.

    Raises:
        ValueError: the shapes differ, or there is no run.
    """
    first, second = _resampled(squares, rival, rng)
    low, high = np.percentile(first - second, [LOW, HIGH])
    whole, other = (float(np.sqrt(of.mean())) for of in (squares, rival))
    return Paired(whole, other, whole - other, float(low), float(high))


def reduction_interval(squares: Array, rival: Array, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of how much smaller the first's error is, as a share of the second's.

    Arguments and errors as in `compare_paired`.
    """
    first, second = _resampled(squares, rival, rng)
    low, high = np.percentile(1 - first / np.maximum(second, 1e-9), [LOW, HIGH])
    return float(low), float(high)


def _resampled(squares: Array, rival: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return root mean square errors of both, (RESAMPLES,) each."""
    if squares.shape != rival.shape or squares.ndim != 2 or not squares.size:
        raise ValueError(f"runs of shapes {squares.shape} and {rival.shape}: must be the same, and not empty")
    units, draws = squares.shape
    unit = rng.integers(units, size=(RESAMPLES, units, 1))
    draw = rng.integers(draws, size=(RESAMPLES, units, draws))
    first, second = (np.sqrt(of[unit, draw].mean(axis=(1, 2))) for of in (squares, rival))
    return first, second
