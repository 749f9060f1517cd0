"""Supervised training of filters on the training records, with their truth as the answer.

A run in one folder, descent by Adam (Kingma and Ba 2015).
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from rl.options import TrainingOptions, share_of
from rl.run import run_configuration, with_deployment, write_curve
from rl.trainers import OnProgress, Records
from twin.errors import DivergedError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.registry import MethodSpec
from twin.files.run_folder import counted_cost, open_run

Array = NDArray[np.float64]
GRADIENT_LIMIT = 1.0  # norm at which gradients are clipped


@dataclasses.dataclass(frozen=True)
class SequenceTraining:
    """Settings of the training of a recurrent network on windows of the records."""

    iterations: int = 600  # gradient steps, each on fresh noise
    sequences: int = 64  # records with their own noise in one step
    window: int = 150  # samples of each
    hidden: int = 32  # units of the one recurrent layer
    learning_rate: float = 5e-3  # of Adam at the start; it falls to zero along a cosine
    noise: str = "gaussian"  # measurement noise during training
    noise_level: float = 0.1  # its level: R = 0.1 in the paper
    initial_error_deg: float = 20.0  # the initial estimate is off by up to this, where it is used [deg]
    seed: int = 0  # of the weights and the noise

    def scaled(self, options: TrainingOptions) -> "SequenceTraining":
        """Return these settings for the noise, the seed and the length of a training."""
        return dataclasses.replace(
            self,
            iterations=share_of(self.iterations, options),
            noise=options.noise,
            noise_level=options.noise_level,
            initial_error_deg=options.initial_error_deg,
            seed=options.seed,
        )


class Lesson(NamedTuple):
    """What a method brings to its training."""

    network: torch.nn.Module  # the module that learns
    loss: Callable[[], torch.Tensor]  # draws data and returns the mean square error
    samples: int  # in one loss
    unit_deg2: float  # what a loss of one is [deg^2]
    export: Callable[[dict[str, Any], Path], None]  # writes the trained file with its description


def train_network(
    spec: MethodSpec,
    prepare: Callable[[TrainingTask], Lesson],
    records: Records,
    active_model: ActiveModel,
    training: SequenceTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train a method into a folder (`config.yaml`, `progress.csv` and its file), unless the file is there.

    The weights that `prepare` draws depend on the seed alone.
    """
    assert spec.training is not None
    path = folder / spec.training.file
    configuration = run_configuration(records, active_model, training)
    with open_run(folder, configuration, (path.name,)):
        if not path.is_file():
            torch.set_num_threads(1)  # the networks are small
            torch.manual_seed(training.seed)
            with counted_cost(folder):
                pull, bend = stack_records(records)
                noise, level = training.noise, training.noise_level
                task = TrainingTask(pull, bend, noise, level, training.initial_error_deg)
                lesson = prepare(task)
                curve = _descend(lesson, training, on_progress)
            write_curve(folder, curve)
            # The last: where the file is, the run is finished.
            deployed = with_deployment(configuration, records, active_model, training.seed)
            lesson.export({"agent": spec.training.agent, **deployed}, path)
    return path


def _descend(
    lesson: Lesson, training: SequenceTraining, on_progress: OnProgress | None
) -> list[tuple[int, float]]:
    """Take gradient steps on fresh losses; the learning rate falls to zero along a cosine.

    Returns minus the mean square error [deg^2] after so many samples, step by step; progress is called with
    steps done, steps in all and the latest.
    """
    network, iterations = lesson.network, training.iterations
    optimiser = torch.optim.Adam(network.parameters(), lr=training.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, iterations)
    curve = []
    for iteration in range(1, iterations + 1):
        value = lesson.loss()
        if not torch.isfinite(value):
            raise DivergedError(f"the training has diverged: the loss of step {iteration} is no number")
        optimiser.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), GRADIENT_LIMIT)
        optimiser.step()
        schedule.step()
        curve.append((iteration * lesson.samples, -value.item() * lesson.unit_deg2))
        if on_progress:
            on_progress(iteration, iterations, curve[-1][1])
    return curve


def tensor32(values: ArrayLike) -> torch.Tensor:
    """Return values in the precision of the networks."""
    return torch.as_tensor(np.asarray(values, dtype=np.float32))
