"""What the filters of the benchmark are told from the training records: models, variances, gains, bounds."""

import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.koopman import KoopmanFilter, fit_koopman
from twin.estimation.task import TrainingTask, stack_records
from twin.estimation.tuning import (
    draw_training_episodes,
    tune_active_model,
    tune_constant_gain,
    tune_koopman,
)
from twin.estimation.unscented import UnscentedActiveModel
from twin.files.atomic import write_whole
from twin.hysteresis import (
    BoucWen,
    ColemanHodgdon,
    HysteresisModel,
    IdentifiedModel,
    PrandtlIshlinskii,
    load_model,
)
from twin.identification import OPTIMIZERS, identify

Array = NDArray[np.float64]
Records = Sequence[tuple[Array, Array]]

POPULATION, GENERATIONS = 80, 150  # of the genetic algorithm
MONOTONE = "coleman-hodgdon, monotone"
MODEL_NAMES = (ColemanHodgdon.name, MONOTONE, BoucWen.name, PrandtlIshlinskii.name)


@dataclasses.dataclass(frozen=True)
class Tuned:
    """Variances of an active model as tuned on the training records."""

    process_variance: tuple[float, float]
    measurement_variance: float
    initial_variance: tuple[float, float]

    def filter(self, model: HysteresisModel, sample_time: float) -> ActiveModel:
        """Return the active model with these variances."""
        return ActiveModel(model, sample_time, **dataclasses.asdict(self))


TUNED_WITH = {
    "AM": ColemanHodgdon.name,
    "AM (Q, R)": ColemanHodgdon.name,
    "AM (Bouc-Wen)": BoucWen.name,
    "UKF (Bouc-Wen)": BoucWen.name,
    "AM (P-I)": PrandtlIshlinskii.name,
}
"""Which filters are tuned by likelihood, and the model of each."""


def model_path(folder: Path, name: str) -> Path:
    """Return where the model of a name in `MODEL_NAMES` is kept."""
    return folder / f"{name.replace(', ', '_').replace('-', '_')}.json"


@dataclasses.dataclass(frozen=True)
class Fits:
    """All that filters without a network learn from the training records."""

    models: dict[str, HysteresisModel]
    """By the names in `MODEL_NAMES`."""
    tuned: dict[str, Tuned]
    """By the names in `TUNED_WITH`."""
    gain: tuple[float, float]
    """Best constant gain of the angle, and of the model's error [1 / s]."""
    koopman: tuple[float, float]
    """Process and initial variance of the lifted model [deg^2]."""


def identify_models(
    measured: Records, folder: Path, seed: int, on_progress: Callable[[int, int], None] | None = None
) -> dict[str, HysteresisModel]:
    """Identify each model on measured training records, or read what an earlier run has kept.

    Args:
        measured: `(pull_mm, measured bend_deg)`.
        folder: where each is kept, as `endotwin identify` writes it.
        seed: of the genetic algorithm.
        on_progress: told how many of how many models are there.
    """
    models = {}
    for done, name in enumerate(MODEL_NAMES, start=1):
        path = model_path(folder, name)
        if not path.is_file():
            monotone = name == MONOTONE
            kind = ColemanHodgdon.name if monotone else name
            model, rmse = identify(
                measured, seed, kind, monotone=monotone, population=POPULATION, generations=GENERATIONS
            )
            how = OPTIMIZERS[kind].format(population=POPULATION, generations=GENERATIONS)
            found = IdentifiedModel(model, rmse, how, seed, "training records")
            write_whole(path, json.dumps(found.to_dict(), indent=2) + "\n")
        models[name] = load_model(path)
        if on_progress:
            on_progress(done, len(MODEL_NAMES))
    return models


def tune(
    name: str, models: dict[str, HysteresisModel], records: Records, sample_time: float, seed: int
) -> Tuned:
    """Tune one filter of `TUNED_WITH` by the likelihood of its innovations under the training noise."""
    kind = UnscentedActiveModel if name.startswith("UKF") else ActiveModel
    start = kind(models[TUNED_WITH[name]], sample_time)
    episodes = draw_training_episodes(_task(records), seed)
    found = tune_active_model(
        start,
        episodes.pull_mm,
        episodes.measurement_deg,
        episodes.initial_bend_deg,
        fit_measurement_variance=name.endswith("R)"),
    )
    return Tuned(
        found.process_variance, float(np.asarray(found.measurement_variance)), found.initial_variance
    )


def best_gain(
    models: dict[str, HysteresisModel], records: Records, sample_time: float, seed: int
) -> tuple[float, float]:
    """Return the constant gain with the least RMSE on the training episodes."""
    return tune_constant_gain(
        ActiveModel(models[ColemanHodgdon.name], sample_time), _task(records), seed
    ).gain


def koopman_variances(records: Records, seed: int) -> tuple[float, float]:
    """Return process and initial variance of the lifted model, by likelihood on the training episodes."""
    tuned = tune_koopman(fit_koopman(records), draw_training_episodes(_task(records), seed))
    return tuned.process_variance, tuned.initial_variance


def tuned_koopman(fits: Fits, records: Records) -> KoopmanFilter:
    """Return the lifted model of the training records, with the variances that it was tuned to."""
    process, initial = fits.koopman
    return dataclasses.replace(fit_koopman(records), process_variance=process, initial_variance=initial)


def save_fits(path: Path, fits: Fits) -> None:
    """Write tuned variances and the gain; the models have files of their own."""
    values = {
        "tuned": {name: dataclasses.asdict(tuned) for name, tuned in fits.tuned.items()},
        "gain": fits.gain,
        "koopman": fits.koopman,
    }
    write_whole(path, json.dumps(values, indent=2) + "\n")


def load_fits(path: Path, models: dict[str, HysteresisModel]) -> Fits:
    """Read what `save_fits` wrote.

    Raises:
        ValueError: the file is damaged.
    """
    try:
        values: dict[str, Any] = json.loads(path.read_text())
        tuned = {
            name: Tuned(
                tuple(found["process_variance"]),
                float(found["measurement_variance"]),
                tuple(found["initial_variance"]),
            )
            for name, found in values["tuned"].items()
        }
        gain, koopman = ((float(a), float(b)) for a, b in (values["gain"], values["koopman"]))
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is damaged: remove it, and it is made again") from error
    return Fits(models, tuned, gain, koopman)


def _task(records: Records) -> TrainingTask:
    return TrainingTask(*stack_records(records))
