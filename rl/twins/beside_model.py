"""Training of what predicts by a model of the nominal endoscope: two lessons on simulated twins."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rl.options import TRAINING_STROKE_MM
from rl.trainers import OnProgress
from rl.twins.filter_step import FilterStep
from rl.twins.records import SAMPLE_TIME, TwinRecords
from rl.twins.run import Learner, train_on_twins
from rl.twins.sequences import STRIDES, Prediction, by_model
from rl.twins.settings import SimulatedTraining
from twin.estimation.registry import Training
from twin.hysteresis import ColemanHodgdon, model_to_dict
from twin.identification.models import identify_coleman_hodgdon
from twin.identification.nominal import nominal_records
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges


def train_beside_model(
    training: Training,
    make: Callable[[Any], FilterStep],
    write: Callable[[Any, dict[str, Any], Path], None],
    preset: Preset,
    ranges: Ranges,
    settings: SimulatedTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train into a folder, as `train_on_twins` does; the file holds the model too.

    Args:
        training: agent and file.
        make: returns the untrained step of these settings, which is predicted for by `by_model`.
        write: writes the trained step with a description to a path.
        preset: the endoscope.
        ranges: what varies from one to the next.
        settings: size and length.
        folder: where the run is kept.
        on_progress: told how far it is.
    """

    @functools.cache  # found when it is needed: a finished run needs none
    def model() -> ColemanHodgdon:
        return nominal_model(preset, settings.seed)

    def begin(records: TwinRecords) -> tuple[FilterStep, Prediction]:
        return make(settings), by_model(model())

    def export(step: FilterStep, description: dict[str, Any], path: Path) -> None:
        write(step, description | {"model": model_to_dict(model())}, path)

    return train_on_twins(Learner(training, begin, export), preset, ranges, settings, folder, on_progress)


def nominal_model(preset: Preset, seed: int) -> ColemanHodgdon:
    """Return the model of Coleman and Hodgdon of an endoscope as its preset is, on the paper's stroke.

    Raises:
        FloatingPointError: the endoscope found no equilibrium.
    """
    return identify_coleman_hodgdon(
        nominal_records(preset, TRAINING_STROKE_MM, seed, SAMPLE_TIME, STRIDES[0]), seed
    )[0]
