"""Training of RAM (memory): a model of the nominal endoscope, then two lessons on simulated twins."""

from pathlib import Path
from typing import Any

import numpy as np

from rl.options import TrainingOptions
from rl.trainers import OnProgress, Trainer, register_trainer
from rl.twins.graph import export_memory
from rl.twins.memory_step import MemoryStep
from rl.twins.records import SAMPLE_TIME, TwinRecords
from rl.twins.run import Learner, train_on_twins
from rl.twins.sequences import STRIDES, Prediction, by_model
from rl.twins.settings import MemoryTraining
from twin.estimation.learned.ram_memory import RAM_MEMORY, TRAINING
from twin.hysteresis import HysteresisModel, model_to_dict
from twin.identification import identify
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced import simulate_batch
from twin.signals.excitation import SIGNALS, command

STROKE_MM = (2.0, 4.0)  # the paper's training stroke
_SECONDS = 60.0
_MODEL = 210  # what the seed is used for


def train_ram_memory(
    preset: Preset,
    ranges: Ranges,
    settings: MemoryTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train into a folder, as `train_on_twins` does; the file holds the model too."""
    found: list[HysteresisModel] = []

    def begin(records: TwinRecords) -> tuple[MemoryStep, Prediction]:
        found[:] = [nominal_model(preset, settings.seed)]
        return MemoryStep(), by_model(found[0])

    def export(step: MemoryStep, description: dict[str, Any], path: Path) -> None:
        export_memory(step, description | {"model": model_to_dict(found[0])}, path)

    return train_on_twins(Learner(TRAINING, [], begin, export), preset, ranges, settings, folder, on_progress)


def nominal_model(preset: Preset, seed: int) -> HysteresisModel:
    """Return the model of Coleman and Hodgdon of an endoscope as its preset is, on the paper's stroke."""
    stroke = (STROKE_MM[0] * 1e-3, STROKE_MM[1] * 1e-3)
    pulls = [
        command(kind, stroke, _SECONDS, SAMPLE_TIME, np.random.default_rng([seed, _MODEL, number]))
        for number, kind in enumerate(SIGNALS)
    ]
    episodes = simulate_batch([preset] * len(pulls), pulls, SAMPLE_TIME)
    records = [
        (pull[:: STRIDES[0]] * 1e3, episode.bend_deg[:: STRIDES[0]])
        for pull, episode in zip(pulls, episodes, strict=True)
        if episode is not None
    ]
    return identify(records, seed)[0]


def _train(
    preset: Preset,
    ranges: Ranges,
    options: TrainingOptions,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    return train_ram_memory(preset, ranges, MemoryTraining().scaled(options), folder, on_progress)


register_trainer(Trainer(RAM_MEMORY, on_twins=_train, unit="thousandths"))
