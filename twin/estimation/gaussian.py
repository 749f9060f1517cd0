"""Gaussian beliefs of B filters: the algebra of all Kalman filters here (Kalman 1960), and their base class.

The state comes before the batch, (n, B) and (n, n, B): the inner loop of all arithmetic then runs over the
filters, which is many times faster than B small matrix products.
"""

import abc
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.estimation.estimator import Estimator

Array = NDArray[np.float64]


class Belief(NamedTuple):
    """Mean and covariance of the state of B filters, and the memory of their model."""

    mean: Array  # (n, B); first the bending angle [deg]
    covariance: Array  # (n, n, B)
    memory: Array  # (m, B) of the model of hysteresis


DEVIATIONS_OF_95 = 1.959963984540054
"""Half of the 95 % interval of a normal distribution, in standard deviations."""


def half_width_of(variance: Array) -> Array:
    """Return half of the 95 % interval of a normal distribution; a variance below zero counts as zero."""
    half: Array = DEVIATIONS_OF_95 * np.sqrt(np.maximum(variance, 0.0))
    return half


def propagate(covariance: Array, transition: Array, process_covariance: Array) -> Array:
    """Return F P F^T + Q for P and F (n, n, B), and Q (n, n) or (n, n, B)."""
    spread = np.einsum("ijb,jkb->ikb", transition, covariance)
    spread = np.einsum("ijb,kjb->ikb", spread, transition)
    noise = process_covariance if process_covariance.ndim == 3 else process_covariance[:, :, None]
    propagated: Array = spread + noise
    return propagated


def innovation_of(mean: Array, covariance: Array, row: Array, measurement: ArrayLike) -> tuple[Array, Array]:
    """Return the (B,) innovation of a measurement y = H x + noise, and its variance H P H^T without noise.

    `mean` is (n, B), `covariance` (n, n, B), H (n,); a measurement that is NaN has an innovation of NaN.
    """
    innovation = np.asarray(measurement, dtype=float) - np.einsum("i,ib->b", row, mean)
    return innovation, np.einsum("i,ijb,j->b", row, covariance, row)


def condition(
    mean: Array, covariance: Array, row: Array, measurement: ArrayLike, variance: ArrayLike
) -> tuple[Array, Array]:
    """Return mean and covariance conditioned on one scalar measurement, the covariance in Joseph's form.

    (I - K H) P (I - K H)^T + K R K^T stays symmetric and positive; eq. 9 of the RAM paper as printed does
    not. Where the measurement is NaN nothing changes: prediction without update. `mean` is (n, B),
    `covariance` (n, n, B), H (n,); measurement and R are scalar or (B,).
    """
    cross = np.einsum("ijb,j->ib", covariance, row)  # P H^T
    spread = np.einsum("i,ib->b", row, cross)
    innovation = np.asarray(measurement, dtype=float) - np.einsum("i,ib->b", row, mean)
    gain = cross / (spread + variance)
    missing = np.isnan(innovation)
    if missing.any():
        gain = np.where(missing, 0.0, gain)
        innovation = np.where(missing, 0.0, innovation)
    # With one scalar measurement, (I - K H) P is P minus an outer product; so is the rest,
    # (K R - (I - K H) P H^T) K^T, which is zero but for rounding and corrects it.
    kept = covariance - gain[:, None] * cross[None]
    rounding = np.asarray(variance) * gain - np.einsum("ijb,j->ib", kept, row)
    kept += rounding[:, None] * gain[None]
    return mean + gain * innovation, (kept + kept.swapaxes(0, 1)) / 2


class GaussianFilter(Estimator[Belief]):
    """A filter with a Gaussian belief whose newest angle is the first state."""

    @property
    @abc.abstractmethod
    def measurement_variance(self) -> ArrayLike:
        """R [deg^2]."""

    @abc.abstractmethod
    def predict(self, belief: Belief, pull_mm: Array, previous_pull_mm: Array) -> Belief:
        """Advance the belief by one sample."""

    @abc.abstractmethod
    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on a measurement of the newest angle."""

    def log_likelihood(self, belief: Belief, measurement_deg: Array) -> Array:
        """Return the (B,) log-likelihood of a measurement of the newest angle, 0 where there is none."""
        newest = np.eye(len(belief.mean))[0]
        innovation, spread = innovation_of(belief.mean, belief.covariance, newest, measurement_deg)
        variance = spread + np.asarray(self.measurement_variance, dtype=float)
        terms = innovation**2 / variance + np.log(2 * np.pi * variance)
        return np.where(np.isnan(innovation), 0.0, -0.5 * terms)

    def step(self, state: Belief, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array) -> Belief:
        """Predict and update by one sample."""
        return self.update(self.predict(state, pull_mm, previous_pull_mm), measurement_deg)

    def bend_deg(self, state: Belief) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        bend: Array = state.mean[0]
        return bend

    def half_width_deg(self, state: Belief) -> Array:
        """Return half of the (B,) 95 % intervals of the angle [deg]."""
        return half_width_of(state.covariance[0, 0])
