"""Training of the LSTM baseline (Hochreiter and Schmidhuber 1997), on the records and noise of policies."""

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
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned.lstm import LSTM, STATES, TRAINING, increments
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
WARM_UP = 10  # samples at the start of a sequence that are not scored: the network has seen nothing yet


class LstmNetwork(torch.nn.Module):
    """One LSTM layer and a linear output, with the normalisation of inputs and output inside."""

    def __init__(self, hidden: int):
        super().__init__()
        self.hidden = hidden
        self.layer = torch.nn.LSTM(2, hidden)
        self.output = torch.nn.Linear(hidden, 1)
        self.input_scale = torch.nn.Buffer(torch.ones(2))
        self.output_scale = torch.nn.Buffer(torch.ones(1))

    def forward(self, seen: torch.Tensor, memory: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the noise and what is remembered after it.

        Args:
            seen: (N, B, 2) increments of pull [mm] and measurement [deg].
            memory: (2, B, hidden) of the samples before, all zero where there are none.

        Returns:
            (N, B) predicted noise [deg], and the memory.
        """
        outputs, (hidden, cell) = self.layer(self.before(seen), (memory[:1], memory[1:]))
        return self.behind(outputs), torch.cat([hidden, cell])

    def before(self, seen: torch.Tensor) -> torch.Tensor:
        """Return what the layer is given: increments in units of their spread."""
        return seen / self.input_scale

    def behind(self, outputs: torch.Tensor) -> torch.Tensor:
        """Return the (N, B) noise [deg] from the outputs of the layer."""
        noise: torch.Tensor = self.output(outputs)[..., 0] * self.output_scale
        return noise


def train_lstm(
    records: Records,
    active_model: ActiveModel,
    training: SequenceTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train the network into a folder (`lstm.onnx`, `config.yaml`, `progress.csv`); a finished run stays.

    Args:
        records: of the training set.
        active_model: gives the sample time that the run is recorded under; the network has no model.
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
        task = TrainingTask(*stack_records(records), training.noise, training.noise_level)
        network = LstmNetwork(training.hidden)
        _normalise(network, task, rng)
        window = min(training.window, task.pull_mm.shape[1])
        if window <= WARM_UP:
            raise InputError(f"records of {window} samples: the network is trained on more than {WARM_UP}")
        nothing = torch.zeros(STATES, training.sequences, training.hidden)

        def loss() -> torch.Tensor:
            seen, noise = _draw(task, training.sequences, window, rng)
            predicted, _ = network(seen, nothing)
            mean_square: torch.Tensor = ((predicted - noise)[WARM_UP:] ** 2).mean()
            return mean_square

        curve = descend(
            network,
            loss,
            training.iterations,
            training.learning_rate,
            training.sequences * window,
            on_progress=on_progress,
        )
        return curve, lambda described: export_recurrent(network, STATES, TRAINING.agent, described, path)

    return train_once(path, records, active_model, training, train)


def _draw(
    task: TrainingTask, count: int, window: int, rng: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw (window, count, 2) increments and the (window, count) noise that is in the measurement."""
    record, measurement, _ = task.draw(count, rng)
    start = rng.integers(task.pull_mm.shape[1] - window + 1, size=count)
    index = start[:, None] + np.arange(window)
    rows = np.arange(count)[:, None]
    measured = measurement[rows, index]
    pull = task.pull_mm[record[:, None], index]
    noise = measured - task.bend_deg[record[:, None], index]
    seen = increments(pull.T, measured.T)
    return tensor32(seen), tensor32(noise.T)


def _normalise(network: LstmNetwork, task: TrainingTask, rng: np.random.Generator) -> None:
    """Set the scales to the spread of the training data."""
    _, measurement, _ = task.draw(256, rng)
    network.input_scale[0] = float(np.diff(task.pull_mm, axis=1).std())
    network.input_scale[1] = float(np.diff(measurement, axis=1).std())
    network.output_scale[0] = max(task.noise_level, 1e-6) ** 0.5


def _train(
    records: Records,
    active_model: ActiveModel,
    options: TrainingOptions,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    return train_lstm(records, active_model, sequence_settings(options), folder, on_progress)


register_trainer(Trainer(LSTM, _train))
