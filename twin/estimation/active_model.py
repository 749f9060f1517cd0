"""The active model (AM): an extended Kalman filter of the bending angle and of the model's error, eqs. 4-9.

The state is X = [theta, f]: the bending angle [deg] and the error of the Coleman-Hodgdon model [deg / s],
a random walk. Everything is batched over a leading axis of filters, which may differ in command, noise and
initial estimate.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class ActiveModel:
    """Everything that the filter is told before it runs."""

    model: ColemanHodgdon
    """The reference model."""
    sample_time: float
    """T [s]."""
    process_variance: tuple[float, float] = (1e-3, 1e-3)
    """Diagonal of Q: of the angle [deg^2] and of the error [deg^2 / s^2] per sample; small as the paper's."""
    measurement_variance: float = 0.1
    """R [deg^2]."""
    initial_variance: tuple[float, float] = (1e-2, 1e-2)
    """Diagonal of P at the first sample; not published, so small as Q: the first estimate is trusted."""


class Belief(NamedTuple):
    """Mean and covariance of the state of B filters."""

    mean: Array  # (B, 2) [deg, deg / s]
    covariance: Array  # (B, 2, 2)


def initial_belief(active_model: ActiveModel, bend_deg: ArrayLike) -> Belief:
    """Return the belief at the first sample, with no known error of the model.

    Args:
        active_model: gives P at the first sample.
        bend_deg: (B,) initial estimate of the angle [deg].
    """
    bend = np.atleast_1d(np.asarray(bend_deg, dtype=float))
    covariance = np.broadcast_to(np.diag(active_model.initial_variance), (bend.size, 2, 2)).copy()
    return Belief(np.stack([bend, np.zeros_like(bend)], axis=-1), covariance)


def predict(
    active_model: ActiveModel, belief: Belief, pull_mm: ArrayLike, previous_pull_mm: ArrayLike
) -> Belief:
    """Advance the belief by one sample (eqs. 6-8).

    Args:
        active_model: model, sample time and Q.
        belief: after the previous sample.
        pull_mm: scalar or (B,) pulling distance at this sample [mm].
        previous_pull_mm: the same at the previous sample [mm].
    """
    T = active_model.sample_time
    bend, error = belief.mean[:, 0], belief.mean[:, 1]
    next_bend = active_model.model.step(bend, np.asarray(pull_mm), previous_pull_mm) + error * T
    mean = np.stack([next_bend, error], axis=-1)

    # Sigma = dF / dX (eq. 7): T a |v| is a |increment|
    transition = np.zeros_like(belief.covariance)
    increment = np.asarray(pull_mm, dtype=float) - np.asarray(previous_pull_mm, dtype=float)
    transition[:, 0, 0] = 1 - np.asarray(active_model.model.a_per_mm) * np.abs(increment)
    transition[:, 0, 1] = T
    transition[:, 1, 1] = 1
    covariance = transition @ belief.covariance @ transition.swapaxes(-1, -2)
    return Belief(mean, covariance + np.diag(active_model.process_variance))


def update(active_model: ActiveModel, belief: Belief, measurement_deg: ArrayLike) -> Belief:
    """Condition the belief on one measurement of the angle (eqs. 8-9), with the covariance in Joseph's form.

    P - P K Omega as printed is not (I - K Omega) P and loses symmetry; Joseph's form keeps P symmetric and
    positive.

    Args:
        active_model: gives R.
        belief: predicted for this sample.
        measurement_deg: scalar or (B,) measured angle [deg].
    """
    R = active_model.measurement_variance
    P = belief.covariance
    gain = P[:, :, 0] / (P[:, 0, 0] + R)[:, None]  # K, with Omega = [1, 0]
    innovation = np.asarray(measurement_deg, dtype=float) - belief.mean[:, 0]
    mean = belief.mean + gain * innovation[:, None]

    keep = np.broadcast_to(np.eye(2), P.shape).copy()
    keep[:, :, 0] -= gain  # I - K Omega
    covariance = keep @ P @ keep.swapaxes(-1, -2) + R * gain[:, :, None] * gain[:, None, :]
    return Belief(mean, (covariance + covariance.swapaxes(-1, -2)) / 2)


def active_model_step(
    active_model: ActiveModel,
    belief: Belief,
    pull_mm: ArrayLike,
    previous_pull_mm: ArrayLike,
    measurement_deg: ArrayLike,
) -> Belief:
    """Predict and update by one sample: the online form."""
    return update(active_model, predict(active_model, belief, pull_mm, previous_pull_mm), measurement_deg)


def estimate_active_model(
    active_model: ActiveModel, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike
) -> Array:
    """Filter whole records.

    Args:
        active_model: model, sample time, Q, R and the first P.
        pull_mm: (N,) pulling distance [mm].
        measurement_deg: (B, N) measured angle [deg]; the first sample is not used: the estimate is given.
        initial_bend_deg: scalar or (B,) initial estimate [deg].

    Returns:
        (B, N) estimated angle [deg].
    """
    measurement = np.atleast_2d(measurement_deg)
    count, samples = measurement.shape
    belief = initial_belief(active_model, np.broadcast_to(initial_bend_deg, (count,)))
    estimate = np.empty((count, samples))
    estimate[:, 0] = belief.mean[:, 0]
    for k in range(1, samples):
        belief = active_model_step(active_model, belief, pull_mm[k], pull_mm[k - 1], measurement[:, k])
        estimate[:, k] = belief.mean[:, 0]
    return estimate
