"""Tuning of filters on training data by the likelihood of their innovations (Schweppe 1965).

The paper leaves Q small on purpose. A reader asks what the same filter does when it is tuned: its variances
are found here, on the training records and the training noise alone.
"""

import dataclasses
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor, time_first
from twin.estimation.gaussian_filter import GaussianFilter
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.task import TrainingTask
from twin.estimation.unscented import UnscentedActiveModel
from twin.hysteresis import BoucWen, ColemanHodgdon, PrandtlIshlinskii
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
TUNING_DRAWS = 16  # training episodes, with their own noise, that a filter is tuned on


class TrainingEpisodes(NamedTuple):
    """Training records with noise on them and a wrong first estimate; B of N samples.

    Attributes:
        pull_mm: (B, N) [mm].
        measurement_deg: (B, N) [deg].
        initial_bend_deg: (B,) [deg].
        bend_deg: (B, N) truth [deg].
    """

    pull_mm: Array
    measurement_deg: Array
    initial_bend_deg: Array
    bend_deg: Array


@dataclasses.dataclass(frozen=True)
class FixedNoiseActiveModel(ActiveModel):
    """The active model that keeps its own R, whatever the sensor is said to be."""

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

    R is told, at training as under test, unless it is to be fitted: then the filter keeps the one it found.

    Args:
        active_model: where the search begins.
        pull_mm: (B, N) pulling distance [mm].
        measurement_deg: (B, N) measured angle [deg].
        initial_bend_deg: (B,) initial estimates, wrong as they are in training [deg].
        fit_measurement_variance: whether R is fitted too; the result is then an `FixedNoiseActiveModel`.
    """
    from scipy.optimize import minimize  # imported when used: a table of methods needs none of it

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

    told = [float(np.asarray(active_model.measurement_variance))] if fit_measurement_variance else []
    start = np.log([*active_model.process_variance, 100.0, 1.0, *told])
    # SciPy's own first simplex hardly moves a logarithm that is zero: the search would end where it starts.
    simplex = np.vstack([start, start + 2 * np.eye(len(start))])
    options = {"xatol": 0.02, "fatol": 0.1, "maxfev": 500, "initial_simplex": simplex}
    return with_variances(minimize(cost, start, method="Nelder-Mead", options=options).x)


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
    """Variances of an active model that make the measured training records most likely.

    Attributes:
        key: name in the file of fits.
        model: name of the model of hysteresis.
        unscented: whether the filter is an unscented one.
        measurement_variance: whether R is fitted too, and kept whatever the sensor is said to be.
    """

    key: str
    model: str
    unscented: bool = False
    measurement_variance: bool = False

    def find(self, knowledge: Knowledge) -> dict[str, Any]:
        """Return the variances by the names of the fields of `ActiveModel`."""
        kind = UnscentedActiveModel if self.unscented else ActiveModel
        episodes = draw_training_episodes(knowledge.task, knowledge.seed)
        found = tune_active_model(
            kind(knowledge.models[self.model], knowledge.sample_time),
            episodes.pull_mm,
            episodes.measurement_deg,
            episodes.initial_bend_deg,
            fit_measurement_variance=self.measurement_variance,
        )
        names = ("process_variance", "measurement_variance", "initial_variance")
        return {name: np.asarray(getattr(found, name)).tolist() for name in names}

    def filter(self, knowledge: Knowledge, kind: type[ActiveModel] = ActiveModel) -> ActiveModel:
        """Return a filter of some kind with the variances that were found."""
        found = knowledge.found(self)
        return kind(
            knowledge.models[self.model],
            knowledge.sample_time,
            process_variance=tuple(found["process_variance"]),
            measurement_variance=float(found["measurement_variance"]),
            initial_variance=tuple(found["initial_variance"]),
        )


TUNED = LikelihoodFit("coleman-hodgdon", ColemanHodgdon.name)
"""Of the paper's active model; filters of its kind take the same variances."""


def register_likelihood(name: str, fit: LikelihoodFit, kind: type[ActiveModel] = ActiveModel) -> None:
    """Register an active model of some kind with the variances of a fit."""
    register_method(
        MethodSpec(
            name=name,
            build=lambda known: fit.filter(known, kind),
            noise_information="nothing: R is fitted" if fit.measurement_variance else "R",
            models=(fit.model,),
            fits=(fit,),
        )
    )


AM_TUNED = "AM-tuned"
"""Name of the tuned active model in tables."""
register_likelihood(AM_TUNED, TUNED)
register_likelihood(
    "AM-tuned (Q, R)",
    LikelihoodFit("coleman-hodgdon, Q and R", ColemanHodgdon.name, measurement_variance=True),
    FixedNoiseActiveModel,
)
register_likelihood("AM-tuned (Bouc-Wen)", LikelihoodFit("bouc-wen", BoucWen.name))
register_likelihood(
    "UKF-tuned (Bouc-Wen)",
    LikelihoodFit("bouc-wen, unscented", BoucWen.name, unscented=True),
    UnscentedActiveModel,
)
register_likelihood("AM-tuned (P-I)", LikelihoodFit("prandtl-ishlinskii", PrandtlIshlinskii.name))
