"""Supervised training of filters on the training records, with their truth as the answer.

A run in one folder, descent by Adam (Kingma and Ba 2015).
"""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from rl.options import TrainingOptions, share_of
from rl.run import run_configuration, with_deployment, write_curve
from rl.trainers import OnProgress, Records
from twin.errors import DivergedError
from twin.estimation.active_model import ActiveModel
from twin.files.run_folder import counted_cost, open_run

Array = NDArray[np.float64]
GRADIENT_LIMIT = 1.0  # norm at which gradients are clipped


@dataclasses.dataclass(frozen=True)
class SequenceTraining:
    """Settings of the training of a recurrent network on windows of the records.

    Attributes:
        iterations: gradient steps, each on fresh noise.
        sequences: records with their own noise in one step.
        window: samples of each.
        hidden: units of the one recurrent layer.
        learning_rate: of Adam at the start; it falls to zero along a cosine.
        noise: measurement noise during training.
        noise_level: its level: R = 0.1 in the paper.
        initial_error_deg: the initial estimate is off by up to this, where it is used [deg].
        seed: of the weights and the noise.
    """

    iterations: int = 600
    sequences: int = 64
    window: int = 150
    hidden: int = 32
    learning_rate: float = 5e-3
    noise: str = "gaussian"
    noise_level: float = 0.1
    initial_error_deg: float = 20.0
    seed: int = 0

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


def train_once(
    path: Path,
    records: Records,
    active_model: ActiveModel,
    training: Any,
    train: Callable[[], tuple[Sequence[tuple[int, float]], Callable[[dict[str, Any]], None]]],
) -> Path:
    """Train into the folder of a file (`config.yaml`, `progress.csv` and the file), unless it is there.

    Args:
        path: the file, which is there when the run is finished.
        records: of the training set.
        active_model: the filter or model that is learned with.
        training: a dataclass of settings; its `seed` is that of the weights.
        train: returns the mean reward [deg^2] after so many samples, and a function that writes the file with
            its description.
    """
    configuration = run_configuration(records, active_model, training)
    with open_run(path.parent, configuration, (path.name,)):
        if not path.is_file():
            torch.set_num_threads(1)  # the networks are small
            torch.manual_seed(training.seed)
            with counted_cost(path.parent):
                curve, export = train()
            write_curve(path.parent, curve)
            # The last: where the file is, the run is finished.
            export(with_deployment(configuration, records, active_model, training.seed))
    return path


def descend(
    network: torch.nn.Module,
    loss: Callable[[], torch.Tensor],
    iterations: int,
    learning_rate: float,
    samples: int,
    loss_unit_deg2: float = 1.0,
    on_progress: OnProgress | None = None,
) -> list[tuple[int, float]]:
    """Take gradient steps on fresh losses; the learning rate falls to zero along a cosine.

    Args:
        network: its parameters are changed in place.
        loss: draws data and returns the mean square error.
        iterations: steps.
        learning_rate: at the start.
        samples: in one loss.
        loss_unit_deg2: what a loss of one is [deg^2].
        on_progress: called with iterations done, iterations in all and minus the latest loss [deg^2].

    Returns:
        Minus mean square error [deg^2] after so many samples, step by step.
    """
    optimiser = torch.optim.Adam(network.parameters(), lr=learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, iterations)
    curve = []
    for iteration in range(1, iterations + 1):
        value = loss()
        if not torch.isfinite(value):
            raise DivergedError(f"the training has diverged: the loss of step {iteration} is no number")
        optimiser.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), GRADIENT_LIMIT)
        optimiser.step()
        schedule.step()
        curve.append((iteration * samples, -value.item() * loss_unit_deg2))
        if on_progress:
            on_progress(iteration, iterations, curve[-1][1])
    return curve


def tensor32(values: ArrayLike) -> torch.Tensor:
    """Return values in the precision of the networks."""
    return torch.as_tensor(np.asarray(values, dtype=np.float32))
