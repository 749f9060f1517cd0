"""The trainers: how each learned method of the method table is trained, declared where the training lives.

A new one is one new file in this package that calls `register_trainer`.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.registry import MethodSpec, find_training, import_modules

if TYPE_CHECKING:
    from rl.options import TrainingOptions
    from twin.estimation.knowledge import Knowledge
    from twin.preset.preset import Preset
    from twin.preset.randomization import Ranges

Records = Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]
"""`(pull_mm (N,), bend_deg (N,))` of the training set."""
OnProgress = Callable[[int, int, float], None]
"""Called with the amount done, the total, and the latest mean reward per sample [deg^2]."""
Train = Callable[[Records, ActiveModel, "TrainingOptions", Path, OnProgress | None], Path]
TrainOnTwins = Callable[["Simulated", "TrainingOptions", Path, OnProgress | None], Path]


RATES = (1e-3, 3e-3, 1e-2)  # learning rates that a search tries


@dataclasses.dataclass(frozen=True)
class Simulated:
    """Twins that a training simulates."""

    preset: "Preset"  # the endoscope
    ranges: "Ranges"  # what varies from one to the next
    # of the training by name, such as `noises`, in place of its own
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Material:
    """All that a method may be trained on."""

    records: Records = ()  # of the training set
    active_model: ActiveModel | None = None  # filter or model that is learned with
    simulated: Simulated | None = None  # twins that may be simulated


def material_of(knowledge: "Knowledge") -> Material:
    """Return the training material that the knowledge of a comparison provides."""
    active_model = ActiveModel(knowledge.reference, knowledge.sample_time)
    simulated = Simulated(*knowledge.twins) if knowledge.twins else None
    return Material(knowledge.records, active_model, simulated)


@dataclasses.dataclass(frozen=True)
class Trainer:
    """Training of one method, on records or on simulated twins."""

    method: MethodSpec  # that it trains
    # trains on records into a folder and returns the trained file; a finished run is kept, unless PPO is to
    # train for more episodes
    train: Train | None = None
    on_twins: TrainOnTwins | None = None  # the same on twins of a preset, which it simulates
    unit: str = "steps"  # of progress, in the plural
    # values of settings on twins that a search tries, each with each
    searched: Mapping[str, tuple[float, ...]] = dataclasses.field(default_factory=dict)

    def run(
        self,
        material: "Material",
        options: "TrainingOptions",
        folder: Path,
        on_progress: OnProgress | None = None,
    ) -> Path:
        """Train on the available material into a folder, and return the trained file."""
        if self.on_twins is not None:
            if material.simulated is None:
                raise InputError(f"{self.method.name} is trained on twins of a preset: none is given")
            return self.on_twins(material.simulated, options, folder, on_progress)
        if self.train is None or material.active_model is None:
            raise InputError(f"{self.method.name} is trained on records and a model: none are given")
        return self.train(material.records, material.active_model, options, folder, on_progress)


_TRAINERS: dict[str, Trainer] = {}


def register_trainer(trainer: Trainer) -> Trainer:
    """Add the trainer of a method to the table and return it."""
    training = trainer.method.training
    if training is None or training.agent in _TRAINERS:
        raise InputError(f"{trainer.method.name!r} is not trainable, or has a trainer already")
    _TRAINERS[training.agent] = trainer
    return trainer


def find_trainer(agent: str) -> Trainer:
    """Return the trainer of an agent."""
    find_training(agent)
    known = _TRAINERS if agent in _TRAINERS else all_trainers()
    if agent not in known:
        raise InputError(f"agent {agent!r} has no trainer; valid: {', '.join(known)}")
    return known[agent]


def all_trainers() -> dict[str, Trainer]:
    """Return the trainers of all agents."""
    import_modules("rl")  # without its packages: comparisons need more than a training does
    return _TRAINERS
