"""Gaussian filter: what all filters have in common whose belief is a mean and a covariance."""

import abc

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.estimation.estimator import Estimator
from twin.estimation.gaussian import Belief, half_width_of, innovation_of

Array = NDArray[np.float64]


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

    @property
    def states_interval(self) -> bool:
        """True: its covariance says how sure it is, if its model and what it is told hold."""
        return True

    def half_width_deg(self, state: Belief) -> Array:
        """Return half of the (B,) 95 % intervals that the belief in the angle states [deg]."""
        return half_width_of(state.covariance[0, 0])
