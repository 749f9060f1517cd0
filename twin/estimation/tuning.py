"""Tuning of active models: variances by the likelihood of the innovations (Schweppe 1965), a constant gain.

The paper leaves Q small on purpose. Here the same filter is tuned, on the training records under the training
noise, or on randomised twins (`TwinsLikelihoodFit`).
"""

import dataclasses
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError, InputError
from twin.estimation.active_model import ActiveModel, UnscentedActiveModel
from twin.estimation.estimator import Sensor, time_first
from twin.estimation.gaussian import Belief, GaussianFilter
from twin.estimation.knowledge import Knowledge, TrainingTask
from twin.estimation.registry import MethodSpec, register_method
from twin.hysteresis import BoucWen, ColemanHodgdon, PrandtlIshlinskii
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
TUNING_DRAWS = 16  # training episodes, each with its own noise, that a filter is tuned on
TWINS, SECONDS = 32, 40.0
"""Number of simulated twins that a filter is tuned on, and length of each record [s]."""
STROKE_MM, NARROWEST_MM = (-4.0, 4.0), 1.0
"""Widest stroke of their commands, and least width of a stroke [mm]."""
VARIANCES_DEG2 = (0.05, 8.0)  # least and largest R of their measurements, drawn log-uniformly [deg^2]
INITIAL_ERROR_DEG = 20.0  # largest error of their first estimates [deg]
_SAMPLE_TIME = 0.02  # of the simulations [s]


class TrainingEpisodes(NamedTuple):
    """Training records with noise and a wrong first estimate; B of N samples."""

    pull_mm: Array  # (B, N) [mm]
    measurement_deg: Array  # (B, N) [deg]
    initial_bend_deg: Array  # (B,) [deg]
    bend_deg: Array  # (B, N) truth [deg]


@dataclasses.dataclass(frozen=True)
class FixedNoiseActiveModel(ActiveModel):
    """The active model that keeps its own R, whatever the sensor states."""

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return itself."""
        return self


def draw_training_episodes(task: TrainingTask, seed: int, count: int = TUNING_DRAWS) -> TrainingEpisodes:
    """Draw the episodes that all filters of one seed are tuned on."""
    record, measurement, initial = task.draw(count, random_stream(seed, SeedUse.FILTER_TUNING))
    return TrainingEpisodes(task.pull_mm[record], measurement, initial, task.bend_deg[record])


def tune_active_model(
    active_model: ActiveModel,
    pull_mm: Array,
    measurement_deg: Array,
    initial_bend_deg: Array,
    fit_measurement_variance: bool = False,
) -> ActiveModel:
    """Return the filter with the process and initial variances that make the measurements most likely.

    The search begins at `active_model`, whose R is known; if R is fitted too, the result is a
    `FixedNoiseActiveModel`. Pulls [mm] and measurements [deg] are (B, N), the initial estimates (B,) wrong as
    they are in training [deg].
    """

    def with_variances(logarithms: Array) -> ActiveModel:
        q_bend, q_error, p_bend, p_error, *r = np.exp(np.clip(logarithms, -30, 20)).tolist()
        filter_ = dataclasses.replace(
            active_model, process_variance=(q_bend, q_error), initial_variance=(p_bend, p_error)
        )
        return FixedNoiseActiveModel(**{**vars(filter_), "measurement_variance": r[0]}) if r else filter_

    def cost(logarithms: Array) -> float:
        return -innovation_log_likelihood(
            with_variances(logarithms), pull_mm, measurement_deg, initial_bend_deg
        )

    fitted = [float(np.asarray(active_model.measurement_variance))] if fit_measurement_variance else []
    start = np.log([*active_model.process_variance, 100.0, 1.0, *fitted])
    return with_variances(nelder_mead(cost, start, xatol=0.02, fatol=0.1, maxfev=500))


def nelder_mead(cost: Any, start: Array, step: float = 2.0, **options: float) -> Array:
    """Return the point of least cost by the simplex search of Nelder and Mead, with a simplex of equal steps.

    SciPy's own first simplex hardly moves a coordinate that is zero: the search would end where it starts.
    """
    from scipy.optimize import minimize  # imported when used: a table of methods needs none of it

    simplex = np.vstack([start, start + step * np.eye(len(start))])
    settings = {"initial_simplex": simplex, **options}
    return np.asarray(minimize(cost, start, method="Nelder-Mead", options=settings).x)


def innovation_log_likelihood(
    filter_: GaussianFilter, pull_mm: Array, measurement_deg: Array, initial_bend_deg: Array
) -> float:
    """Return the log-likelihood of all measurements after the first, summed over (B, N) records."""
    pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
    belief = filter_.start(pull[0], initial)
    total = 0.0
    for k in range(1, len(measurement)):
        belief = filter_.predict(belief, pull[k], pull[k - 1])
        total += float(np.sum(filter_.log_likelihood(belief, measurement[k])))
        belief = filter_.update(belief, measurement[k])
    return total


@dataclasses.dataclass(frozen=True)
class LikelihoodFit:
    """Variances of an active model that make the measured training records most likely."""

    key: str  # name in the file of fits
    model: str  # name of the model of hysteresis
    unscented: bool = False  # whether the filter is an unscented one
    measurement_variance: bool = False  # whether R is fitted too, and kept whatever the sensor states

    def find(self, knowledge: Knowledge) -> dict[str, Any]:
        """Return the variances by the names of the fields of `ActiveModel`."""
        kind = UnscentedActiveModel if self.unscented else ActiveModel
        episodes = draw_training_episodes(knowledge.task, knowledge.seed)
        begin = kind(knowledge.models[self.model], knowledge.sample_time)
        found = tune_active_model(begin, *episodes[:3], self.measurement_variance)
        names = ("process_variance", "measurement_variance", "initial_variance")
        return {name: np.asarray(getattr(found, name)).tolist() for name in names}

    def filter(self, knowledge: Knowledge, kind: type[ActiveModel] = ActiveModel) -> ActiveModel:
        """Return a filter of some kind with the fitted variances."""
        found = {
            name: tuple(of) if isinstance(of, list) else of for name, of in knowledge.found(self).items()
        }
        return kind(knowledge.models[self.model], knowledge.sample_time, **found)


@dataclasses.dataclass(frozen=True)
class TwinsLikelihoodFit(LikelihoodFit):
    """Variances of an active model that make measurements of randomised twins most likely.

    The twins follow commands on strokes of any width, half of them in sheaths that move, under noise of a
    drawn and known R.
    """

    def find(self, knowledge: Knowledge) -> dict[str, Any]:
        """Return the variances by the names of the fields of `ActiveModel`."""
        episodes, variance = draw_twin_episodes(knowledge)
        begin = ActiveModel(
            knowledge.models[self.model], knowledge.sample_time, measurement_variance=variance
        )
        found = tune_active_model(begin, *episodes[:3])
        return {
            "process_variance": list(found.process_variance),
            "measurement_variance": 1.0,  # replaced by that of the sensor
            "initial_variance": list(found.initial_variance),
        }


def draw_twin_episodes(knowledge: Knowledge) -> tuple[TrainingEpisodes, Array]:
    """Return noisy measurements of randomised reduced twins, and (B,) R of each [deg^2]."""
    from twin.reduced import simulate_batch  # here: a table of methods needs none of it
    from twin.signals.excitation import SIGNALS, command

    if knowledge.twins is None:
        raise InputError("a tuning on twins needs a preset and its ranges")
    preset, ranges = knowledge.twins
    stride = round(knowledge.sample_time / _SAMPLE_TIME)
    presets, pulls, bends = [], [], []
    for number in range(TWINS):
        rng = random_stream(knowledge.seed, SeedUse.TUNING_TWINS, number)
        drawn, other = ranges.draw(preset, rng), ranges.draw(preset, rng)
        width = rng.uniform(NARROWEST_MM, STROKE_MM[1] - STROKE_MM[0])
        low = rng.uniform(STROKE_MM[0], STROKE_MM[1] - width)
        signal = list(SIGNALS)[number % len(SIGNALS)]
        pull = command(signal, (low * 1e-3, (low + width) * 1e-3), SECONDS, _SAMPLE_TIME, rng)
        presets.append(drawn)
        pulls.append(pull)
        bends.append(np.linspace(drawn.sheath_bend, other.sheath_bend, len(pull)) if number % 2 else None)
    simulated = simulate_batch(presets, pulls, _SAMPLE_TIME, sheath_bends=bends)
    found = [episode for episode in simulated if episode is not None]
    if not found:
        raise DivergedError("no twin that a filter could be tuned on found an equilibrium")
    pull_mm = np.array([episode.pull_mm[::stride] for episode in found])
    truth = np.array([episode.truth_deg[::stride] for episode in found])
    rng = random_stream(knowledge.seed, SeedUse.TUNING_TWINS, TWINS)
    least, most = np.log(VARIANCES_DEG2)
    variance = np.exp(rng.uniform(least, most, len(found)))
    measurement = truth + np.sqrt(variance)[:, None] * rng.standard_normal(truth.shape)
    initial = truth[:, 0] + rng.uniform(-INITIAL_ERROR_DEG, INITIAL_ERROR_DEG, len(found))
    return TrainingEpisodes(pull_mm, measurement, initial, truth), variance


@dataclasses.dataclass(frozen=True)
class ConstantGain(ActiveModel):
    """The active model with a second, constant gain on the measured residual: eq. 10 with a constant action.

        phi = y - theta_AM(k|k),    X = X_AM + K phi

    The covariance is left as it is.
    """

    gain: tuple[float, float] = (0.0, 0.0)  # K of the angle, and of the error [1 / s]; zero: the active model

    @property
    def states_interval(self) -> bool:
        """False: the covariance does not account for the gain."""
        return False

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on one measurement and add the gain times the remaining residual."""
        updated = super().update(belief, measurement_deg)
        residual = measurement_deg - updated.mean[0]
        residual = np.where(np.isnan(residual), 0.0, residual)  # without a measurement there is none
        return updated._replace(mean=updated.mean + np.array(self.gain)[:, None] * residual)


def tune_constant_gain(active_model: ActiveModel, task: TrainingTask, seed: int) -> ConstantGain:
    """Return the filter with the constant gain of least RMSE on noisy training records.

    It sees what RAM sees in training, the truth of the training records included. Both gains are searched
    from the middle of [0, 1], as RAM's actions are bounded.
    """
    episodes = draw_training_episodes(task, seed)

    def with_gain(action: Array) -> ConstantGain:
        bend, error = ((np.clip(action, -1, 1) + 1) / 2).tolist()
        return ConstantGain(**vars(active_model), gain=(bend, error))

    def cost(action: Array) -> float:
        estimate = with_gain(action).estimate(*episodes[:3])
        rmse = float(np.sqrt(np.mean((estimate - episodes.bend_deg)[:, 1:] ** 2)))
        return rmse + 10 * float(np.maximum(np.abs(action) - 1, 0).sum())  # keeps it within the bounds

    return with_gain(nelder_mead(cost, np.zeros(2), step=0.5, xatol=0.01, fatol=1e-4, maxfev=120))


@dataclasses.dataclass(frozen=True)
class ConstantGainFit:
    """Constant gain with the least RMSE on the training records."""

    key: str = "constant gain"

    def find(self, knowledge: Knowledge) -> dict[str, Any]:
        """Return both gains."""
        start = ActiveModel(knowledge.reference, knowledge.sample_time)
        return {"gain": list(tune_constant_gain(start, knowledge.task, knowledge.seed).gain)}

    def filter(self, knowledge: Knowledge) -> ConstantGain:
        """Return the active model with the fitted gain."""
        bend, error = knowledge.found(self)["gain"]
        return ConstantGain(knowledge.reference, knowledge.sample_time, gain=(float(bend), float(error)))


def register_likelihood(
    name: str,
    fit: LikelihoodFit,
    kind: type[ActiveModel] = ActiveModel,
    given: tuple[str, ...] = ("R",),
) -> None:
    """Register an active model of some kind with the variances of a fit."""
    register_method(
        MethodSpec(
            name=name,
            build=lambda known: fit.filter(known, kind),
            given=given,
            models=(fit.model,),
            fits=(fit,),
        )
    )


AM_TUNED = "AM-tuned"  # name of the tuned active model in tables
TUNED = LikelihoodFit("coleman-hodgdon", ColemanHodgdon.name)
"""Fit of the paper's active model; filters of its kind take the same variances."""
TUNED_ON_TWINS = TwinsLikelihoodFit(f"{ColemanHodgdon.name}, on twins", ColemanHodgdon.name)
BEST_GAIN = ConstantGainFit()

register_likelihood(AM_TUNED, TUNED)
register_likelihood(
    "AM-tuned (Q, R)",
    LikelihoodFit("coleman-hodgdon, Q and R", ColemanHodgdon.name, measurement_variance=True),
    FixedNoiseActiveModel,
    given=(),
)
register_likelihood("AM-tuned (Bouc-Wen)", LikelihoodFit("bouc-wen", BoucWen.name))
register_likelihood(
    "UKF-tuned (Bouc-Wen)",
    LikelihoodFit("bouc-wen, unscented", BoucWen.name, unscented=True),
    UnscentedActiveModel,
)
register_likelihood("AM-tuned (P-I)", LikelihoodFit("prandtl-ishlinskii", PrandtlIshlinskii.name))
register_likelihood("AM-tuned (twins)", TUNED_ON_TWINS, given=("R", "ranges"))
register_likelihood(
    "AM-tuned (Bouc-Wen, twins)",
    TwinsLikelihoodFit(f"{BoucWen.name}, on twins", BoucWen.name),
    given=("R", "ranges"),
)
register_method(
    MethodSpec(
        name="Constant gain",
        build=BEST_GAIN.filter,
        given=("R",),
        models=(ColemanHodgdon.name,),
        fits=(BEST_GAIN,),
    )
)
