"""The algebra of Gaussian beliefs that all Kalman filters here share (Kalman 1960), for B filters at once.

The state comes before the batch, (n, B) and (n, n, B): the inner loop of all arithmetic then runs over the
filters, which is many times faster than B small matrix products.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Belief(NamedTuple):
    """Mean and covariance of the state of B filters, and what their model remembers beside it.

    Attributes:
        mean: (n, B); first the bending angle [deg].
        covariance: (n, n, B).
        memory: (m, B) of the model of hysteresis.
    """

    mean: Array
    covariance: Array
    memory: Array


DEVIATIONS_OF_95 = 1.959963984540054
"""Half of the 95 % interval of a normal law, in standard deviations."""


def half_width_of(variance: Array) -> Array:
    """Return half of the 95 % interval of a normal law; a variance below zero is a rounding of zero."""
    half: Array = DEVIATIONS_OF_95 * np.sqrt(np.maximum(variance, 0.0))
    return half


def propagate(covariance: Array, transition: Array, process_covariance: Array) -> Array:
    """Return F P F^T + Q.

    Args:
        covariance: P, (n, n, B).
        transition: F, (n, n, B).
        process_covariance: Q, (n, n) or (n, n, B).
    """
    spread = np.einsum("ijb,jkb->ikb", transition, covariance)
    spread = np.einsum("ijb,kjb->ikb", spread, transition)
    noise = process_covariance if process_covariance.ndim == 3 else process_covariance[:, :, None]
    propagated: Array = spread + noise
    return propagated


def innovation_of(mean: Array, covariance: Array, row: Array, measurement: ArrayLike) -> tuple[Array, Array]:
    """Return what is new in a measurement y = row x + noise, and the variance that the belief gives it.

    Args:
        mean: (n, B).
        covariance: (n, n, B).
        row: (n,).
        measurement: scalar or (B,); NaN where there is none.

    Returns:
        (B,) innovation, NaN where there is no measurement, and (B,) row P row^T without the noise.
    """
    innovation = np.asarray(measurement, dtype=float) - np.einsum("i,ib->b", row, mean)
    return innovation, np.einsum("i,ijb,j->b", row, covariance, row)


def condition(
    mean: Array, covariance: Array, row: Array, measurement: ArrayLike, variance: ArrayLike
) -> tuple[Array, Array]:
    """Condition a belief on one scalar measurement, its covariance in Joseph's form.

    (I - K H) P (I - K H)^T + K R K^T stays symmetric and positive; eq. 9 of the RAM paper as printed does
    not.
    Where the measurement is NaN nothing changes: prediction without update.

    Args:
        mean: (n, B).
        covariance: (n, n, B).
        row: H, (n,): the measurement is H x plus noise.
        measurement: scalar or (B,).
        variance: R, scalar or (B,).

    Returns:
        Mean and covariance.
    """
    cross = np.einsum("ijb,j->ib", covariance, row)  # P H^T
    spread = np.einsum("i,ib->b", row, cross)
    innovation = np.asarray(measurement, dtype=float) - np.einsum("i,ib->b", row, mean)
    gain = cross / (spread + variance)
    missing = np.isnan(innovation)
    if missing.any():
        gain = np.where(missing, 0.0, gain)
        innovation = np.where(missing, 0.0, innovation)
    # With one scalar measurement, (I - K H) P is P minus an outer product; so is what follows it, where
    # (K R - (I - K H) P H^T) K^T is zero but for rounding, which it takes back.
    kept = covariance - gain[:, None] * cross[None]
    rounding = np.asarray(variance) * gain - np.einsum("ijb,j->ib", kept, row)
    kept += rounding[:, None] * gain[None]
    return mean + gain * innovation, (kept + kept.swapaxes(0, 1)) / 2
