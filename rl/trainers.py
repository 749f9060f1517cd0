"""The trainers: how each learned method of the method table is trained, declared where the training lives.

A new one is one new file in this package that calls `register_trainer`.
"""

import dataclasses
import importlib
import pkgutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.registry import MethodSpec, find_training

if TYPE_CHECKING:
    from rl.options import TrainingOptions
    from twin.estimation.active_model import ActiveModel

Records = Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]
"""`(pull_mm (N,), bend_deg (N,))` of the training set."""
OnProgress = Callable[[int, int, float], None]
"""Told how much is done, how much there is in all, and the latest mean reward per sample [deg^2]."""
Train = Callable[[Records, "ActiveModel", "TrainingOptions", Path, OnProgress | None], Path]


@dataclasses.dataclass(frozen=True)
class Trainer:
    """Training of one method.

    Attributes:
        method: that it trains.
        train: trains into a folder and returns the trained file; a finished run is left as it is.
        unit: of progress, in the plural.
        counts_samples: whether an episode is a record of whatever number of samples, as in PPO, so that at a
            shorter sample time fewer episodes are as much to learn from.
    """

    method: MethodSpec
    train: Train
    unit: str = "steps"
    counts_samples: bool = False


_TRAINERS: dict[str, Trainer] = {}
_SEARCHED: list[str] = []


def register_trainer(trainer: Trainer) -> Trainer:
    """Add the trainer of a method to the table and return it.

    Raises:
        ValueError: the method is not trainable, or has a trainer already.
    """
    training = trainer.method.training
    if training is None or training.agent in _TRAINERS:
        raise InputError(f"{trainer.method.name!r} is not trainable, or has a trainer already")
    _TRAINERS[training.agent] = trainer
    return trainer


def find_trainer(agent: str) -> Trainer:
    """Return the trainer of an agent.

    Raises:
        ValueError: no method is trained under this name.
    """
    find_training(agent)
    if agent not in _TRAINERS and not _SEARCHED:
        package = importlib.import_module("rl")
        for module in pkgutil.iter_modules(package.__path__, "rl."):
            if not module.ispkg:  # comparisons need more than a training does
                importlib.import_module(module.name)
        _SEARCHED.append("rl")
    if agent not in _TRAINERS:
        raise InputError(f"agent {agent!r} has no trainer; valid: {', '.join(_TRAINERS)}")
    return _TRAINERS[agent]
