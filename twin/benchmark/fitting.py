"""What the filters of the benchmark are told from the training records: models, variances, gains, bounds."""

import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.tuning import draw_training_episodes, tune_active_model, tune_constant_gain
from twin.hysteresis import (
    BoucWen,
    ColemanHodgdon,
    HysteresisModel,
    IdentifiedModel,
    PrandtlIshlinskii,
    load_model,
)
from twin.identification import identify
from twin.recording.atomic import write_whole
from twin.task import Task, stack_records

Array = NDArray[np.float64]
Records = Sequence[tuple[Array, Array]]

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
    "AM (P-I)": PrandtlIshlinskii.name,
}
"""Which filters are tuned by likelihood, and the model of each."""


@dataclasses.dataclass(frozen=True)
class Fits:
    """All that filters without a network learn from the training records."""

    models: dict[str, HysteresisModel]
    """By the names in `MODEL_NAMES`."""
    tuned: dict[str, Tuned]
    """By the names in `TUNED_WITH`."""
    gain: tuple[float, float]
    """Best constant gain of the angle, and of the model's error [1 / s]."""


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
        path = folder / f"{name.replace(', ', '_').replace('-', '_')}.json"
        if not path.is_file():
            monotone = name == MONOTONE
            kind = ColemanHodgdon.name if monotone else name
            model, rmse = identify(measured, seed, kind, monotone=monotone)
            optimizer = "non-negative least squares" if name == PrandtlIshlinskii.name else "pymoo GA"
            values = IdentifiedModel(model, rmse, optimizer, seed, "training records").to_dict()
            write_whole(path, json.dumps(values, indent=2) + "\n")
        models[name] = load_model(path)
        if on_progress:
            on_progress(done, len(MODEL_NAMES))
    return models


def tune(
    name: str, models: dict[str, HysteresisModel], records: Records, sample_time: float, seed: int
) -> Tuned:
    """Tune one filter of `TUNED_WITH` by the likelihood of its innovations under the training noise."""
    start = ActiveModel(models[TUNED_WITH[name]], sample_time)
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


def save_fits(path: Path, fits: Fits) -> None:
    """Write tuned variances and the gain; the models have files of their own."""
    values = {"tuned": {name: dataclasses.asdict(t) for name, t in fits.tuned.items()}, "gain": fits.gain}
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
        angle, error = values["gain"]
    except (ValueError, KeyError, TypeError) as error_:
        raise ValueError(f"{path} is damaged: remove it, and it is made again") from error_
    return Fits(models, tuned, (float(angle), float(error)))


def _task(records: Records) -> Task:
    return Task(*stack_records(records))
