"""Training of RAM (memory): a model of the nominal endoscope, then two lessons on simulated twins."""

import functools

from rl.trainers import Trainer, register_trainer
from rl.twins.beside_model import train_beside_model
from rl.twins.graph import export_memory
from rl.twins.memory_step import MemoryStep
from rl.twins.run import scaled_to_options
from rl.twins.settings import SimulatedTraining
from twin.estimation.learned.ram_memory import RAM_MEMORY, TRAINING

train_ram_memory = functools.partial(train_beside_model, TRAINING, lambda _: MemoryStep(), export_memory)
"""Train into a folder, as `train_beside_model` does."""

register_trainer(
    Trainer(RAM_MEMORY, on_twins=scaled_to_options(train_ram_memory, SimulatedTraining()), unit="thousandths")
)
