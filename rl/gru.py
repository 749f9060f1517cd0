"""Training of the GRU that is told the noise and the model of hysteresis (GRU: Cho et al. 2014)."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rl.options import TrainingOptions
from rl.recurrent_graph import export_recurrent
from rl.supervised import SequenceTraining, descend, sequence_settings, tensor32, train_once
from rl.trainers import OnProgress, Records, Trainer, register_trainer
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned.gru import GRU, TRAINING
from twin.estimation.learned.scale import deviation
from twin.estimation.learned.surprise import surprises
from twin.hysteresis import HysteresisModel
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]


class GruNetwork(torch.nn.Module):
    """One GRU layer and a linear output."""

    def __init__(self, hidden: int):
        super().__init__()
        self.hidden = hidden
        self.layer = torch.nn.GRU(2, hidden)
        self.output = torch.nn.Linear(hidden, 1)
        self.pull_scale = torch.nn.Buffer(torch.ones(()))  # spread of the training increments [mm]

    def forward(self, seen: torch.Tensor, memory: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the (N, B) noise in units of sqrt(R), and what is remembered (1, B, hidden).

        Args:
            seen: (N, B, 2) surprise of the measurement in units of sqrt(R), and increment of the pull [mm].
            memory: (1, B, hidden) of the samples before, all zero where there are none.
        """
        outputs, memory = self.layer(self.before(seen), memory)
        return self.behind(outputs), memory

    def before(self, seen: torch.Tensor) -> torch.Tensor:
        """Return what the layer is given: the increment of the pull in units of its spread."""
        return torch.stack([seen[..., 0], seen[..., 1] / self.pull_scale], dim=-1)

    def behind(self, outputs: torch.Tensor) -> torch.Tensor:
        """Return the (N, B) noise in units of sqrt(R) from the outputs of the layer."""
        noise: torch.Tensor = self.output(outputs)[..., 0]
        return noise


def train_gru(
    records: Records,
    active_model: ActiveModel,
    training: SequenceTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train the network into a folder (`gru.onnx`, `config.yaml`, `progress.csv`); a finished run stays.

    Args:
        records: of the training set.
        active_model: gives the model, the sample time and the R that the network is told in training.
        training: size and length.
        folder: where the run is kept.
        on_progress: told iterations done, iterations in all and the latest minus mean square error [deg^2].

    Returns:
        The trained file.

    Raises:
        ValueError: the folder holds a run of another configuration.
    """
    path = folder / TRAINING.file

    def train() -> tuple[Sequence[tuple[int, float]], Callable[[dict[str, Any]], None]]:
        rng = random_stream(training.seed, SeedUse.NETWORK)
        pull, bend = stack_records(records)
        task = TrainingTask(pull, bend, training.noise, training.noise_level)
        model, scale = active_model.model, float(deviation(active_model.measurement_variance))
        network = GruNetwork(training.hidden)
        network.pull_scale.fill_(float(np.diff(pull, axis=1).std()))
        window = min(training.window, pull.shape[1] - 1)
        nothing = torch.zeros(1, training.sequences, training.hidden)

        def loss() -> torch.Tensor:
            surprise, increment, noise = _draw(task, model, training.sequences, window, rng)
            predicted, _ = network(tensor32(np.stack([surprise / scale, increment], axis=-1)), nothing)
            mean_square: torch.Tensor = ((predicted - tensor32(noise / scale)) ** 2).mean()
            return mean_square

        curve = descend(
            network,
            loss,
            training.iterations,
            training.learning_rate,
            training.sequences * window,
            scale**2,
            on_progress,
        )
        return curve, lambda described: export_recurrent(network, 1, TRAINING.agent, described, path)

    return train_once(path, records, active_model, training, train)


def _draw(
    task: TrainingTask, model: HysteresisModel, count: int, window: int, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Draw (window, count) surprises and noise [deg] and increments of the pull [mm] from random records."""
    record, measurement, _ = task.draw(count, rng)
    pull, bend = task.pull_mm[record].T, task.bend_deg[record].T
    # A window begins anywhere, but the memory of a model begins with the record.
    surprise = np.zeros_like(pull)
    surprise[1:], _ = surprises(model, pull, measurement.T, model.start(pull[0]))
    increment = np.diff(pull, axis=0, prepend=pull[:1])
    start = rng.integers(1, len(pull) - window + 1, size=count)
    index = start + np.arange(window)[:, None]
    noise = measurement.T - bend
    surprise[start, np.arange(count)] = 0  # as at the first sample of a record
    columns = np.arange(count)
    return surprise[index, columns], increment[index, columns], noise[index, columns]


def _train(
    records: Records,
    active_model: ActiveModel,
    options: TrainingOptions,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    return train_gru(records, active_model, sequence_settings(options), folder, on_progress)


register_trainer(Trainer(GRU, _train))
