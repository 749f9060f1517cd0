"""A Koopman model of the bending angle, fitted by extended dynamic mode decomposition, and its Kalman filter.

EDMD by least squares: Williams et al. 2015; with inputs and delays as observables: Korda and Mezic 2018;
bilinear in the command: Bruder et al. 2021. The lifted state holds the last angles, the newest first,
psi = [theta_k, ..., theta_(k-d)], and its first row moves by

    theta_(k+1) = (e_0 + g_0 + |dl| g_1) psi + sum_i [dl, |dl| l]_(k+1-i) h_i,

where g_0 sums to zero, so that an angle at rest may be any. The model is symmetric in the direction of
bending: there are no features dl psi, |dl| and dl l. Coleman and Hodgdon's model lies in this span: d = 0,
g_1 = -a, h = [c, a b].

The transition holds increments alone, neither pull nor angle. A model that forgets its first angle along the
training commands therefore forgets it along the same movements about any other pull, and what drives it is
linear in the pull: it stays finite there. A fit that does not forget is refused.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Sensor, time_first
from twin.estimation.gaussian import Belief, GaussianFilter, condition
from twin.estimation.knowledge import Knowledge, TrainingRecord
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.tuning import (
    TrainingEpisodes,
    draw_training_episodes,
    innovation_log_likelihood,
    nelder_mead,
)

Array = NDArray[np.float64]
DELAYS = (0, 1, 2)  # that a fit chooses from
RIDGES = (1e-8, 1e-6, 1e-4)  # as a fraction of the features' mean square


@dataclasses.dataclass(frozen=True)
class KoopmanFilter(GaussianFilter):
    """The Kalman filter of a lifted model whose first state is the angle and whose others are its past."""

    gates: Array  # (2, d + 1) rows e_0 + g_0 and g_1 [1 / mm]
    drives: Array  # (2, d + 1) rows h by feature [deg / mm], [deg / mm^2], columns by delay i
    # Q of the newest angle per sample; from a fit, its residual variance, until it is tuned [deg^2]
    process_variance: float
    measurement_variance: ArrayLike = 0.1  # R [deg^2], one for all filters or (B,)
    # of the first angle: that of an even draw within 20 deg; the past angles are the same one [deg^2]
    initial_variance: float = 400 / 3

    @property
    def delays(self) -> int:
        """Number of past angles, d."""
        return int(self.gates.shape[1]) - 1

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def start(self, pull_mm: Array, bend_deg: Array) -> Belief:
        """Return the belief at the first sample, at rest until there; the memory is the d pulls before."""
        size = self.delays + 1
        mean = np.repeat(bend_deg[None], size, axis=0)
        covariance = np.full((size, size, bend_deg.size), float(self.initial_variance))
        return Belief(mean, covariance, np.repeat(np.atleast_1d(pull_mm)[None], self.delays, axis=0))

    def predict(self, belief: Belief, pull_mm: Array, previous_pull_mm: Array) -> Belief:
        """Advance the belief by one sample: a new angle enters, the oldest leaves."""
        pulls = np.concatenate([np.stack([pull_mm, previous_pull_mm]), belief.memory])
        row = self.row(pulls)
        bend = (row * belief.mean).sum(axis=0) + self.drive(pulls)
        mean = np.concatenate([bend[None], belief.mean[:-1]])
        # F is this row above a shift: F P F' costs (d + 1)^2 operations, not (d + 1)^3.
        with_past = (row[:, None] * belief.covariance).sum(axis=0)
        covariance = np.empty_like(belief.covariance)
        covariance[0, 0] = (row * with_past).sum(axis=0) + self.process_variance
        covariance[0, 1:] = covariance[1:, 0] = with_past[:-1]
        covariance[1:, 1:] = belief.covariance[:-1, :-1]
        return Belief(mean, covariance, pulls[1:-1])

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on a measurement of the newest angle."""
        newest = np.eye(self.delays + 1)[0]
        mean, covariance = condition(
            belief.mean, belief.covariance, newest, measurement_deg, self.measurement_variance
        )
        return Belief(mean, covariance, belief.memory)

    def row(self, pulls_mm: Array) -> Array:
        """Return the first row of the transition (d + 1, ...) for pulls (d + 2, ...), newest first [mm]."""
        increment = pulls_mm[0] - pulls_mm[1]
        return np.tensordot(self.gates, _gates(increment), axes=(0, 0))

    def drive(self, pulls_mm: Array) -> Array:
        """Return what the command adds to the newest angle (...) [deg], from the same pulls."""
        return np.tensordot(self.drives, _drives(pulls_mm), axes=((0, 1), (0, 1)))

    def response(self, pull_mm: Array, bend_deg0: ArrayLike) -> Array:
        """Return the model's angle (B, N) along commands (N,) or (B, N) from first angles, no measurement."""
        pull = np.atleast_2d(pull_mm)
        pull, zeros, first = time_first(pull, np.zeros(pull.shape), bend_deg0)
        samples, past = len(pull), self.delays + 1
        pulls = np.stack([pull[np.maximum(np.arange(samples) - i, 0)] for i in range(past + 1)])
        row, drive = self.row(pulls), self.drive(pulls)  # of all samples: what is left is one sum for each
        bend = np.concatenate([np.repeat(first[None], past, axis=0), zeros[1:]])
        with np.errstate(over="ignore", invalid="ignore"):  # of a model that does not forget
            for k in range(1, samples):
                bend[k + past - 1] = (row[:, k] * bend[k - 1 : k + past - 1][::-1]).sum(axis=0) + drive[k]
        return bend[past - 1 :].T


def fit_koopman(
    records: Sequence[TrainingRecord], delays: int | None = None, ridge: float | None = None
) -> KoopmanFilter:
    """Fit the lifted model to the truth of the training records, which RAM's reward sees too.

    Unless they are given, the number of delays d and Tikhonov's penalty (as a fraction of the features' mean
    square) are chosen by leaving each record out in turn: the least RMSE of the response along that record,
    from its first angle, without measurements. A single record is halved for that. Raises `ValueError` where
    no model that was tried forgets its first angle along the training commands.
    """
    tried = (DELAYS if delays is None else [delays], RIDGES if ridge is None else [ridge])
    choices: list[tuple[int, float]] = list(itertools.product(*tried))
    fitted = [_fit(records, *choice) for choice in choices]
    stable = [choice for choice, model in zip(choices, fitted, strict=True) if _forgets(model, records)]
    if not stable:
        raise InputError(
            f"(delays, ridge) in {choices}: no model forgets its first angle along the training commands; "
            "give fewer delays, a larger ridge, or records in which the tendon moves further"
        )
    scores = [_left_out_rmse_deg(records, past, penalty) for past, penalty in stable]
    return fitted[choices.index(stable[int(np.argmin(scores))])]


def tune_koopman(koopman: KoopmanFilter, episodes: TrainingEpisodes) -> KoopmanFilter:
    """Return the filter with the process and initial variance that make the measurements most likely.

    The residual of its fit is far too small a process variance: errors of successive steps are correlated.
    """

    def with_variances(logarithms: Array) -> KoopmanFilter:
        process, initial = np.exp(np.clip(logarithms, -30, 20)).tolist()
        return dataclasses.replace(koopman, process_variance=process, initial_variance=initial)

    def cost(logarithms: Array) -> float:
        return -innovation_log_likelihood(with_variances(logarithms), *episodes[:3])

    start = np.log([koopman.process_variance, koopman.initial_variance])
    return with_variances(nelder_mead(cost, start, xatol=0.02, fatol=0.1, maxfev=150))


def _fit(records: Sequence[TrainingRecord], delays: int, ridge: float) -> KoopmanFilter:
    """Least squares of the angle's increment on the lifted features, each scaled to unit mean square."""
    features, targets = zip(*(_regression(*record, delays) for record in records), strict=True)
    X, y = np.concatenate(features), np.concatenate(targets)
    scale = np.sqrt(np.mean(X**2, axis=0))
    scale[scale == 0] = 1.0  # a feature that never moves gets no weight
    size = X.shape[1]
    penalised = np.concatenate([X / scale, np.sqrt(ridge * len(X)) * np.eye(size)])
    weights = np.linalg.lstsq(penalised, np.concatenate([y, np.zeros(size)]))[0] / scale

    rest, gated, drives = np.split(weights, [delays, 2 * delays + 1])
    at_rest = np.concatenate([[1 - rest.sum()], rest])  # e_0 + g_0
    gates = np.concatenate([at_rest[None], gated.reshape(-1, delays + 1)])
    variance = float(np.mean((y - X @ weights) ** 2))
    return KoopmanFilter(gates, drives.reshape(-1, delays + 1), variance)


def _regression(pull_mm: Array, bend_deg: Array, delays: int) -> tuple[Array, Array]:
    """Features (samples, features) and increments of the angle (samples,) of one record."""
    now = np.arange(delays + 1, len(pull_mm))
    angles = np.stack([bend_deg[now - 1 - i] for i in range(delays + 1)])  # (d + 1, samples)
    pulls = np.stack([pull_mm[now - i] for i in range(delays + 2)])
    gates = _gates(pulls[0] - pulls[1])[1:]
    columns = [
        angles[1:] - angles[0],
        (gates[:, None] * angles).reshape(-1, len(now)),
        _drives(pulls).reshape(-1, len(now)),
    ]
    return np.concatenate(columns).T, bend_deg[now] - bend_deg[now - 1]


def _gates(increment_mm: Array) -> Array:
    """(2, ...) what multiplies the lifted state: 1 and |dl|."""
    return np.stack([np.ones_like(increment_mm), np.abs(increment_mm)])


def _drives(pulls_mm: Array) -> Array:
    """(2, d + 1, ...) what drives the angle, from (d + 2, ...) pulls, the newest first."""
    increment = pulls_mm[:-1] - pulls_mm[1:]
    return np.stack([increment, np.abs(increment) * pulls_mm[:-1]])


def _forgets(model: KoopmanFilter, records: Sequence[TrainingRecord]) -> bool:
    """True where, along every record, less than all of a first angle is left."""
    undriven = dataclasses.replace(model, drives=np.zeros_like(model.drives))
    left = [undriven.response(pull, 1.0)[0, -1] for pull, _ in records]
    return bool((np.abs(left) < 1).all())  # not, where it is NaN


def _left_out_rmse_deg(records: Sequence[TrainingRecord], delays: int, ridge: float) -> float:
    if len(records) == 1:
        pull, bend = records[0]
        half = len(pull) // 2
        records = [(pull[:half], bend[:half]), (pull[half:], bend[half:])]
    errors = []
    for left_out, (pull, bend) in enumerate(records):
        model = _fit([*records[:left_out], *records[left_out + 1 :]], delays, ridge)
        errors.append(model.response(pull, bend[0])[0] - bend)
    with np.errstate(over="ignore", invalid="ignore"):
        rmse = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    return rmse if np.isfinite(rmse) else np.inf


@dataclasses.dataclass(frozen=True)
class KoopmanFit:
    """Variances of the lifted model that make the measured training records most likely."""

    key: str = "koopman"

    def find(self, knowledge: Knowledge) -> dict[str, Any]:
        """Return the process and the initial variance [deg^2]."""
        episodes = draw_training_episodes(knowledge.task, knowledge.seed)
        tuned = tune_koopman(fit_koopman(knowledge.records), episodes)
        return {"process_variance": tuned.process_variance, "initial_variance": tuned.initial_variance}


VARIANCES = KoopmanFit()

register_method(
    MethodSpec(
        name="Koopman",
        given=("R",),
        build=lambda known: dataclasses.replace(fit_koopman(known.records), **known.found(VARIANCES)),
        fits=(VARIANCES,),
        records=True,
    )
)
