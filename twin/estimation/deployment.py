"""Deployment of a trained estimator, as its file contains it: a fallback, and the ranges of its training.

Q and the first P of the fallback maximise the likelihood of noisy records (Schweppe 1965), as in
`twin.estimation.tuning`, but for many candidates at once: the cross-entropy method (Rubinstein 1999) finds
them within a second.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned.step import affine_steps
from twin.estimation.learned.trained_file import TrainedFile
from twin.estimation.two_states import predicted, updated
from twin.files.shown import shown
from twin.hysteresis import ColemanHodgdon
from twin.preset.sensor import KEY as SENSOR
from twin.preset.sensor import SensorModel
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
KEY = "deployment"  # name in the description of a trained file
CANDIDATES, BEST, ROUNDS = 64, 8, 12
MIDDLE = np.log([1e-3, 1e-2, 100.0, 1.0])  # Q and the first P, each of angle and error
SPREAD = np.array([4.0, 4.0, 2.0, 3.0])  # of their logarithms: the search begins wide
LEAST_SPREAD = 0.02
EPISODES = 8
WIDER = 0.1  # share of a range of the training by which a limit lies beyond it


@dataclasses.dataclass(frozen=True)
class Deployment:
    """A trusted fallback, and the ranges of the training of an estimator."""

    fallback: ActiveModel  # the active model with tuned noise (AM-tuned), at the sample time of the training
    pull_mm: tuple[float, float]  # lowest and highest pulling distance of the training [mm]
    bend_deg: tuple[float, float]  # lowest and highest angle [deg]
    pull_speed_mm_s: float  # of the fastest command [mm / s]
    bend_speed_deg_s: float  # of the fastest motion [deg / s]

    def fallback_at(self, sample_time: float, noise_variance: float) -> ActiveModel:
        """Return the fallback for a sample time [s] and a sensor [deg^2]."""
        return dataclasses.replace(self.fallback.over(sample_time), measurement_variance=noise_variance)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as a trained file contains them."""
        values = {name: list(of) if isinstance(of, tuple) else of for name, of in vars(self).items()}
        return values | {"fallback": self.fallback.to_dict()}

    @classmethod
    def from_dict(cls, values: Any) -> Self:
        """Return the deployment from the values of `to_dict`."""
        if not isinstance(values, Mapping):
            raise InputError(f"{KEY} = {shown(values)}: must be its parts by name")
        from twin.files.json_text import validated
        from twin.files.trained_schema import DeploymentFile

        try:
            file = validated(DeploymentFile, values)
            fallback = ActiveModel.from_dict(file.fallback)
        except ValueError as error:
            raise InputError(f"{KEY}: {error}") from error
        if not isinstance(fallback.model, ColemanHodgdon):
            raise InputError(f"{KEY}: the fallback's model is {fallback.model.name}: must be coleman-hodgdon")
        return cls(fallback, file.pull_mm, file.bend_deg, file.pull_speed_mm_s, file.bend_speed_deg_s)


def deployment_of(file: TrainedFile) -> Deployment:
    """Return the deployment that a trained file contains."""
    if KEY not in file.description:
        raise InputError(f"{file.path} holds no fallback: an earlier version wrote it; train again")
    try:
        return Deployment.from_dict(file.description[KEY])
    except ValueError as error:
        raise InputError(f"{file.path} cannot be deployed: {error}") from error


def sensor_of(file: TrainedFile) -> SensorModel:
    """Return the sensor that a trained file states: that of its preset, plain where it has none."""
    try:
        return SensorModel.from_dict(file.description.get(SENSOR, {}))
    except ValueError as error:
        raise InputError(f"{file.path}: {error}") from error


def prepare_deployment(
    records: Sequence[tuple[Array, Array]], model: ColemanHodgdon, sample_time: float, seed: int
) -> Deployment:
    """Return the deployment of an estimator that is trained on records `(pull_mm (N,), truth_deg (N,))`.

    The model is identified on them, or on records of the same endoscope; the fallback is tuned under noise of
    the seed.
    """
    fallback = tune_fallback(ActiveModel(model, sample_time), records, seed)
    pulls, bends = ([record[part] for record in records] for part in (0, 1))
    return Deployment(
        fallback, _limits(pulls), _limits(bends), _speed(pulls, sample_time), _speed(bends, sample_time)
    )


def _limits(values: Sequence[Array]) -> tuple[float, float]:
    low, high = min(float(of.min()) for of in values), max(float(of.max()) for of in values)
    beyond = WIDER * (high - low)
    return low - beyond, high + beyond


def _speed(values: Sequence[Array], sample_time: float) -> float:
    fastest = max(float(np.abs(np.diff(of)).max(initial=0.0)) for of in values)
    return (1 + WIDER) * fastest / sample_time


def tune_fallback(
    active_model: ActiveModel, records: Sequence[tuple[Array, Array]], seed: int
) -> ActiveModel:
    """Return the filter with the variances that make its innovations most likely.

    Noise of R and wrong first estimates are drawn on the records `(pull_mm (N,), truth_deg (N,))`.
    """
    from twin.estimation.tuning import draw_training_episodes  # it imports SciPy's optimisers

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

    `variances` (C, 4) are the diagonals of Q and of the first P of a filter on Coleman and Hodgdon's model,
    pulls [mm] and measurements [deg] are (E, N) without gaps, initial estimates (E,) [deg].
    """
    T, variance = active_model.sample_time, float(np.asarray(active_model.measurement_variance))
    keeps, drives = affine_steps(active_model.model, pull_mm)
    q_bend, q_error, p, q = (column[:, None] for column in variances.T)
    shape = (len(variances), len(pull_mm))
    p, r, q = np.broadcast_to(p, shape), np.zeros(shape), np.broadcast_to(q, shape)
    bend, error = np.broadcast_to(initial_bend_deg, shape), np.zeros(shape)
    total = np.zeros(shape)
    for k in range(1, pull_mm.shape[1]):
        keep = keeps[:, k]
        bend = keep * bend + drives[:, k] + T * error
        p, r, q = predicted(p, r, q, keep, T, (q_bend, q_error))
        of_bend, of_error, p, r, q, expected = updated(p, r, q, variance)
        innovation = measurement_deg[:, k] - bend
        total -= 0.5 * (innovation**2 / expected + np.log(2 * np.pi * expected))
        bend, error = bend + of_bend * innovation, error + of_error * innovation
    likelihood: Array = total.sum(axis=1)
    return np.where(np.isfinite(likelihood), likelihood, -np.inf)
