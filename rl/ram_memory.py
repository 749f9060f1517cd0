"""Training of RAM (memory): a model of the nominal endoscope, then two lessons on simulated twins."""

import functools

from rl.trainers import RATES, Trainer, register_trainer
from rl.twins.beside_model import train_beside_model
from rl.twins.graph import export_memory
from rl.twins.memory_step import HIDDEN, MemoryStep
from rl.twins.run import scaled_to_options
from rl.twins.settings import NetworkTraining
from twin.estimation.learned.ram_memory import RAM_MEMORY, TRAINING

WIDTHS = (HIDDEN, 72)
"""Sizes of its memory that a search tries, those of its rivals."""
SETTINGS = NetworkTraining(width=72)
"""Settings of its training; width and learning rate are what the search took, see docs/ram_twins.md."""


def untrained(settings: NetworkTraining) -> MemoryStep:
    """Return its step before a training of these settings."""
    return MemoryStep(settings.width)


train_ram_memory = functools.partial(train_beside_model, TRAINING, untrained, export_memory)
"""Train into a folder, as `train_beside_model` does."""

register_trainer(
    Trainer(
        RAM_MEMORY,
        on_twins=scaled_to_options(train_ram_memory, SETTINGS),
        unit="thousandths",
        searched={"learning_rate": RATES, "width": WIDTHS},
    )
)
