"""Supervised training of filters on the training records, with their truth as the answer.

A run in one folder, descent by Adam (Kingma and Ba 2015).
"""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike

from rl.export import export_step
from rl.options import TrainingOptions, share_of
from rl.run import Keeper, run_configuration, with_deployment, write_curve
from rl.trainers import OnProgress, Records
from twin.errors import DivergedError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.registry import MethodSpec
from twin.files.run_folder import counted_cost, open_run

OnUpdate = Callable[[int, float], None]  # called with the updates that are done, and the latest loss
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
    deployed: Callable[[], Any]  # returns one sample of the trained network, with its `inputs` and `state`


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

    The weights that `prepare` draws depend only on the seed.
    """
    assert spec.training is not None
    path = folder / spec.training.file
    configuration = {"agent": spec.training.agent, **run_configuration(records, active_model, training)}
    with open_run(folder, configuration, (path.name,)):
        if not path.is_file():
            torch.set_num_threads(1)  # the networks are small
            torch.manual_seed(training.seed)
            with counted_cost(folder):
                pull, bend = stack_records(records)
                noise, level = training.noise, training.noise_level
                task = TrainingTask(pull, bend, noise, level, training.initial_error_deg)
                lesson = prepare(task)
                curve: list[tuple[float, ...]] = []

                def on_update(step: int, loss: float) -> None:
                    curve.append((step * lesson.samples, -loss * lesson.unit_deg2))
                    if on_progress:
                        on_progress(step, training.iterations, curve[-1][1])

                groups = [{"params": list(lesson.network.parameters())}]
                steps = training.iterations, training.learning_rate
                descend(groups, lambda _: lesson.loss(), *steps, on_update, betas=(0.9, 0.999))
            write_curve(folder, curve)
            # Written last: the run is finished if this file exists.
            deployed = with_deployment(configuration, records, active_model, training.seed)
            step = lesson.deployed()
            export_step(step, dict.fromkeys(step.inputs, ()), step.state, deployed, path)
    return path


def descend(
    groups: list[dict[str, Any]],
    loss: Callable[[int], torch.Tensor],
    updates: int,
    rate: float,
    on_update: OnUpdate | None,
    keeper: Keeper | None = None,
    betas: tuple[float, float] = (0.9, 0.99),
) -> None:
    """Take gradient steps by Adam; the learning rate falls to zero along a cosine.

    A group may have a `share` of the learning rate; the checkpoint of a keeper is taken up.
    """
    optimiser = torch.optim.Adam(groups, lr=rate, betas=betas)
    parameters = [values for group in optimiser.param_groups for values in group["params"]]
    begin = keeper.restore(optimiser) if keeper else 0
    for update in range(begin, updates):
        for group in optimiser.param_groups:
            group["lr"] = rate * group.get("share", 1.0) * (1 + math.cos(math.pi * update / updates)) / 2
        value = loss(update)
        if not torch.isfinite(value):
            raise DivergedError(f"the training has diverged: the loss of update {update + 1} is no number")
        optimiser.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(parameters, GRADIENT_LIMIT)
        optimiser.step()
        if on_update:
            on_update(update + 1, value.item())
        if keeper:
            keeper.keep(update + 1, optimiser, last=update + 1 == updates)


def tensor32(values: ArrayLike) -> torch.Tensor:
    """Return values in the precision of the networks."""
    return torch.as_tensor(np.asarray(values, dtype=np.float32))
