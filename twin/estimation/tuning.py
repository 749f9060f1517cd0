"""Tuning the active model by maximum likelihood of its innovations on training data (Schweppe 1965).

The paper leaves Q small on purpose. A reader asks what the same filter does when it is tuned: this is it,
tuned on the training records and the training noise alone.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from twin.estimation.active_model import ActiveModel, initial_belief, predict, update

Array = NDArray[np.float64]


def tune_active_model(
    active_model: ActiveModel, pull_mm: Array, measurement_deg: Array, initial_bend_deg: Array
) -> ActiveModel:
    """Return the filter with the process and initial variances that make the measurements most likely.

    R is not tuned: it is told, at training as under test.

    Args:
        active_model: where the search begins.
        pull_mm: (B, N) pulling distance [mm].
        measurement_deg: (B, N) measured angle [deg].
        initial_bend_deg: (B,) initial estimates, wrong as they are in training [deg].
    """

    def with_variances(logarithms: Array) -> ActiveModel:
        q_bend, q_error, p_bend, p_error = np.exp(np.clip(logarithms, -30, 20)).tolist()
        return dataclasses.replace(
            active_model, process_variance=(q_bend, q_error), initial_variance=(p_bend, p_error)
        )

    def cost(logarithms: Array) -> float:
        return -innovation_log_likelihood(
            with_variances(logarithms), pull_mm, measurement_deg, initial_bend_deg
        )

    start = np.log([*active_model.process_variance, 100.0, 1.0])
    options = {"xatol": 0.02, "fatol": 0.1, "maxfev": 300}
    return with_variances(minimize(cost, start, method="Nelder-Mead", options=options).x)


def innovation_log_likelihood(
    active_model: ActiveModel, pull_mm: Array, measurement_deg: Array, initial_bend_deg: Array
) -> float:
    """Return the log-likelihood of all measurements after the first, summed over (B, N) records."""
    belief = initial_belief(active_model, initial_bend_deg)
    total = 0.0
    for k in range(1, measurement_deg.shape[1]):
        belief = predict(active_model, belief, pull_mm[:, k], pull_mm[:, k - 1])
        innovation = measurement_deg[:, k] - belief.mean[:, 0]
        variance = belief.covariance[:, 0, 0] + active_model.measurement_variance
        total -= 0.5 * float(np.sum(innovation**2 / variance + np.log(2 * np.pi * variance)))
        belief = update(active_model, belief, measurement_deg[:, k])
    return total
