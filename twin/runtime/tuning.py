"""Tuning of the fallback: the Q and the first P that make noisy records most likely (Schweppe 1965).

As `twin.estimation.tuning` does, but over many candidates at once: the cross-entropy method (Rubinstein 1999)
finds them within a second, so that every training can afford it.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.tuning import draw_training_episodes
from twin.estimation.two_states import predicted, updated
from twin.hysteresis import ColemanHodgdon
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
CANDIDATES, BEST, ROUNDS = 64, 8, 12
MIDDLE = np.log([1e-3, 1e-2, 100.0, 1.0])  # Q and the first P, each of angle and error
SPREAD = np.array([4.0, 4.0, 2.0, 3.0])  # of their logarithms: the search begins wide
LEAST_SPREAD = 0.02
EPISODES = 8


def tune_fallback(
    active_model: ActiveModel, records: Sequence[tuple[Array, Array]], seed: int
) -> ActiveModel:
    """Return the filter with the variances that make its innovations most likely.

    Args:
        active_model: its model, sample time and R.
        records: `(pull_mm (N,), true bend_deg (N,))`: noise of R and wrong first estimates are drawn on them.
        seed: of these draws and of the search.
    """
    task = TrainingTask(
        *stack_records(records), noise_level=float(np.asarray(active_model.measurement_variance))
    )
    episodes = draw_training_episodes(task, seed, EPISODES)
    rng = random_stream(seed, SeedUse.LIKELIHOOD_SEARCH)
    middle, spread = MIDDLE, SPREAD
    for _ in range(ROUNDS):
        candidates = middle + spread * rng.standard_normal((CANDIDATES, len(MIDDLE)))
        candidates[0] = middle
        likelihood = log_likelihoods(active_model, np.exp(candidates), *episodes[:3])
        elite = candidates[np.argsort(-likelihood)[:BEST]]
        middle, spread = elite.mean(axis=0), np.maximum(elite.std(axis=0), LEAST_SPREAD)
    q_bend, q_error, p_bend, p_error = np.exp(middle).tolist()
    return dataclasses.replace(
        active_model, process_variance=(q_bend, q_error), initial_variance=(p_bend, p_error)
    )


def log_likelihoods(
    active_model: ActiveModel,
    variances: Array,
    pull_mm: Array,
    measurement_deg: Array,
    initial_bend_deg: Array,
) -> Array:
    """Return the (C,) log-likelihoods of all measurements after the first.

    Args:
        active_model: on a model of Coleman and Hodgdon.
        variances: (C, 4) diagonals of Q and of the first P.
        pull_mm: (E, N) [mm].
        measurement_deg: (E, N), none missing [deg].
        initial_bend_deg: (E,) [deg].
    """
    model = active_model.model
    assert isinstance(model, ColemanHodgdon)
    T, variance = active_model.sample_time, float(np.asarray(active_model.measurement_variance))
    increment = np.diff(pull_mm, axis=1)
    forget = np.asarray(model.a_per_mm) * np.abs(increment)
    drive = (
        forget * np.asarray(model.b_deg_per_mm) * pull_mm[:, 1:] + np.asarray(model.c_deg_per_mm) * increment
    )
    q_bend, q_error, p, q = (column[:, None] for column in variances.T)
    shape = (len(variances), len(pull_mm))
    p, r, q = np.broadcast_to(p, shape), np.zeros(shape), np.broadcast_to(q, shape)
    bend, error = np.broadcast_to(initial_bend_deg, shape), np.zeros(shape)
    total = np.zeros(shape)
    for k in range(increment.shape[1]):
        keep = 1 - forget[:, k]
        bend = keep * bend + drive[:, k] + T * error
        p, r, q = predicted(p, r, q, keep, T, (q_bend, q_error))
        of_bend, of_error, p, r, q, expected = updated(p, r, q, variance)
        innovation = measurement_deg[:, k + 1] - bend
        total -= 0.5 * (innovation**2 / expected + np.log(2 * np.pi * expected))
        bend, error = bend + of_bend * innovation, error + of_error * innovation
    likelihood: Array = total.sum(axis=1)
    return np.where(np.isfinite(likelihood), likelihood, -np.inf)
