"""Tuning the active model on training data: by likelihood of its innovations (Schweppe 1965), or by RMSE.

The paper leaves Q small on purpose. A reader asks what the same filter does when it is tuned, or with the
best constant gain: both are found here, on the training records and the training noise alone.
"""

import dataclasses
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from twin.estimation.active_model import ActiveModel
from twin.estimation.constant_gain import ConstantGain
from twin.estimation.estimator import Sensor, time_first
from twin.estimation.gaussian import innovation_of
from twin.estimation.koopman import KoopmanFilter
from twin.estimation.task import TrainingTask

Array = NDArray[np.float64]
TUNING_DRAWS = 16  # training episodes, with their own noise, that a filter is tuned on
FIRST_STEP = 0.5  # of the search for a constant gain, in actions of [-1, 1]


class TrainingEpisodes(NamedTuple):
    """Training records with noise on them and a wrong first estimate; B of N samples."""

    pull_mm: Array  # (B, N) [mm]
    measurement_deg: Array  # (B, N) [deg]
    initial_bend_deg: Array  # (B,) [deg]
    bend_deg: Array  # (B, N) truth [deg]


@dataclasses.dataclass(frozen=True)
class UntoldActiveModel(ActiveModel):
    """The active model that keeps its own R, whatever the sensor is said to be."""

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return itself."""
        return self


def draw_training_episodes(task: TrainingTask, seed: int, count: int = TUNING_DRAWS) -> TrainingEpisodes:
    """Draw the episodes that all filters of one seed are tuned on."""
    record, measurement, initial = task.draw(count, np.random.default_rng([seed, 1]))
    return TrainingEpisodes(task.pull_mm[record], measurement, initial, task.bend_deg[record])


def tune_active_model(
    active_model: ActiveModel,
    pull_mm: Array,
    measurement_deg: Array,
    initial_bend_deg: Array,
    fit_measurement_variance: bool = False,
) -> ActiveModel:
    """Return the filter with the process and initial variances that make the measurements most likely.

    R is told, at training as under test, unless it is to be fitted: then the filter keeps the one it found.

    Args:
        active_model: where the search begins.
        pull_mm: (B, N) pulling distance [mm].
        measurement_deg: (B, N) measured angle [deg].
        initial_bend_deg: (B,) initial estimates, wrong as they are in training [deg].
        fit_measurement_variance: whether R is fitted too; the result is then an `UntoldActiveModel`.
    """

    def with_variances(logarithms: Array) -> ActiveModel:
        q_bend, q_error, p_bend, p_error, *r = np.exp(np.clip(logarithms, -30, 20)).tolist()
        filter_ = dataclasses.replace(
            active_model, process_variance=(q_bend, q_error), initial_variance=(p_bend, p_error)
        )
        return UntoldActiveModel(**{**vars(filter_), "measurement_variance": r[0]}) if r else filter_

    def cost(logarithms: Array) -> float:
        return -innovation_log_likelihood(
            with_variances(logarithms), pull_mm, measurement_deg, initial_bend_deg
        )

    told = [float(np.asarray(active_model.measurement_variance))] if fit_measurement_variance else []
    start = np.log([*active_model.process_variance, 100.0, 1.0, *told])
    # SciPy's own first simplex hardly moves a logarithm that is zero: the search would end where it starts.
    simplex = np.vstack([start, start + 2 * np.eye(len(start))])
    options = {"xatol": 0.02, "fatol": 0.1, "maxfev": 500, "initial_simplex": simplex}
    return with_variances(minimize(cost, start, method="Nelder-Mead", options=options).x)


def tune_koopman(koopman: KoopmanFilter, episodes: TrainingEpisodes) -> KoopmanFilter:
    """Return the filter with the process and initial variance that make the measurements most likely.

    The residual of its fit is far too small a process variance: it says what one step misses, not that the
    next step misses the same.
    """

    def with_variances(logarithms: Array) -> KoopmanFilter:
        process, initial = np.exp(np.clip(logarithms, -30, 20)).tolist()
        return dataclasses.replace(koopman, process_variance=process, initial_variance=initial)

    def cost(logarithms: Array) -> float:
        return -innovation_log_likelihood(with_variances(logarithms), *episodes[:3])

    start = np.log([koopman.process_variance, koopman.initial_variance])
    simplex = np.vstack([start, start + 2 * np.eye(2)])
    options = {"xatol": 0.02, "fatol": 0.1, "maxfev": 150, "initial_simplex": simplex}
    return with_variances(minimize(cost, start, method="Nelder-Mead", options=options).x)


def innovation_log_likelihood(
    filter_: ActiveModel | KoopmanFilter, pull_mm: Array, measurement_deg: Array, initial_bend_deg: Array
) -> float:
    """Return the log-likelihood of all measurements after the first, summed over (B, N) records."""
    pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
    belief = filter_.start(pull[0], initial)
    newest = np.eye(len(belief.mean))[0]
    total = 0.0
    for k in range(1, len(measurement)):
        belief = filter_.predict(belief, pull[k], pull[k - 1])
        innovation, spread = innovation_of(belief.mean, belief.covariance, newest, measurement[k])
        variance = spread + np.asarray(filter_.measurement_variance, dtype=float)
        missing = np.isnan(innovation)
        terms = innovation**2 / variance + np.log(2 * np.pi * variance)
        total -= 0.5 * float(np.sum(np.where(missing, 0.0, terms)))
        belief = filter_.update(belief, measurement[k])
    return total


def tune_constant_gain(active_model: ActiveModel, task: TrainingTask, seed: int) -> ConstantGain:
    """Return the filter with the constant gain of least RMSE on noisy training records.

    It sees what RAM sees in training, the truth of the training records included. Both gains are searched
    from the middle of [0, 1], as RAM's actions are bounded.

    Args:
        active_model: the filter that the gain is added to.
        task: training records and their noise.
        seed: of the episodes drawn.
    """
    episodes = draw_training_episodes(task, seed)

    def with_gain(action: Array) -> ConstantGain:
        bend, error = ((np.clip(action, -1, 1) + 1) / 2).tolist()
        return ConstantGain(**vars(active_model), gain=(bend, error))

    def cost(action: Array) -> float:
        estimate = with_gain(action).estimate(
            episodes.pull_mm, episodes.measurement_deg, episodes.initial_bend_deg
        )
        rmse = float(np.sqrt(np.mean((estimate - episodes.bend_deg)[:, 1:] ** 2)))
        return rmse + 10 * float(np.maximum(np.abs(action) - 1, 0).sum())  # no way out of the bounds

    simplex = FIRST_STEP * np.array([[0, 0], [1, 0], [0, 1]])
    options = {"xatol": 0.01, "fatol": 1e-4, "maxfev": 120, "initial_simplex": simplex}
    return with_gain(minimize(cost, np.zeros(2), method="Nelder-Mead", options=options).x)
