"""Training of RAM (memory): a model of the nominal endoscope, then two lessons on simulated twins."""

import functools
from pathlib import Path
from typing import Any

from rl.options import TRAINING_STROKE_MM
from rl.trainers import OnProgress, Trainer, register_trainer
from rl.twins.graph import export_memory
from rl.twins.memory_step import MemoryStep
from rl.twins.records import SAMPLE_TIME, TwinRecords
from rl.twins.run import Learner, scaled_to_options, train_on_twins
from rl.twins.sequences import STRIDES, Prediction, by_model
from rl.twins.settings import SimulatedTraining
from twin.estimation.learned.ram_memory import RAM_MEMORY, TRAINING
from twin.hysteresis import ColemanHodgdon, model_to_dict
from twin.identification.coleman_hodgdon import identify_coleman_hodgdon
from twin.identification.nominal import nominal_records
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced.member_set import NO_MEMBERS


def train_ram_memory(
    preset: Preset,
    ranges: Ranges,
    settings: SimulatedTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train into a folder, as `train_on_twins` does; the file holds the model too."""

    @functools.cache  # found when it is needed: a finished run needs none
    def model() -> ColemanHodgdon:
        return nominal_model(preset, settings.seed)

    def begin(records: TwinRecords) -> tuple[MemoryStep, Prediction]:
        return MemoryStep(), by_model(model())

    def export(step: MemoryStep, description: dict[str, Any], path: Path) -> None:
        export_memory(step, description | {"model": model_to_dict(model())}, path)

    return train_on_twins(
        Learner(TRAINING, NO_MEMBERS, begin, export), preset, ranges, settings, folder, on_progress
    )


def nominal_model(preset: Preset, seed: int) -> ColemanHodgdon:
    """Return the model of Coleman and Hodgdon of an endoscope as its preset is, on the paper's stroke.

    Raises:
        FloatingPointError: the endoscope found no equilibrium.
    """
    return identify_coleman_hodgdon(
        nominal_records(preset, TRAINING_STROKE_MM, seed, SAMPLE_TIME, STRIDES[0]), seed
    )[0]


register_trainer(
    Trainer(RAM_MEMORY, on_twins=scaled_to_options(train_ram_memory, SimulatedTraining()), unit="thousandths")
)
