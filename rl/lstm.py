"""The LSTM baseline (Hochreiter and Schmidhuber 1997), trained on the same records and noise as the policies.

It sees what changes from sample to sample, normalised by the training data: increments of the pulling
distance and of the measurement. It predicts the noise of the measurement, so that its estimate is y minus
that. Absolute values are left out on purpose: trained on stroke [2, 4] mm, a network that sees them has never
met [-1, 1] mm.
"""

import csv
import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from rl.environment import Task, stack_records
from rl.training import claim_folder, run_configuration
from twin.estimation.active_model import ActiveModel
from twin.recording.atomic import WholeFile

Array = NDArray[np.float64]
WARM_UP = 10  # samples at the start of a sequence that are not scored: the network has seen nothing yet


@dataclasses.dataclass(frozen=True)
class LstmTraining:
    """How the LSTM is trained."""

    iterations: int = 600
    """Gradient steps, each on fresh noise."""
    sequences: int = 64
    """Records with their own noise in one step."""
    window: int = 150
    """Samples of each."""
    hidden: int = 32
    """Units of the one LSTM layer."""
    learning_rate: float = 5e-3
    """Of Adam at the start; it falls to zero along a cosine."""
    noise: str = "gaussian"
    """Measurement noise during training."""
    noise_level: float = 0.1
    """Its level: R = 0.1 in the paper."""
    seed: int = 0
    """Of the weights and the noise."""


class Lstm(torch.nn.Module):
    """One LSTM layer and a linear output, with the normalisation of inputs and output inside."""

    def __init__(self, hidden: int, sample_time: float = 0.0):
        super().__init__()
        self.sample_time = torch.nn.Buffer(torch.tensor(sample_time, dtype=torch.float64))
        self.layer = torch.nn.LSTM(2, hidden, batch_first=True)
        self.output = torch.nn.Linear(hidden, 1)
        self.input_scale = torch.nn.Buffer(torch.ones(2))
        self.output_scale = torch.nn.Buffer(torch.ones(1))

    def forward(self, increments: torch.Tensor) -> torch.Tensor:
        """Return the (B, N) predicted noise [deg] for (B, N, 2) increments of pull and measurement."""
        hidden, _ = self.layer(increments / self.input_scale)
        return self.output(hidden)[..., 0] * self.output_scale

    @torch.no_grad()
    def estimate(self, pull_mm: Array, measurement_deg: Array) -> Array:
        """Filter (B, N) measurements [deg] along a command (N,) [mm]; returns (B, N) angles [deg]."""
        measurement = np.atleast_2d(measurement_deg)
        increments = _increments(np.broadcast_to(pull_mm, measurement.shape), measurement)
        return measurement - self(torch.as_tensor(increments, dtype=torch.float32)).numpy().astype(float)


def train_lstm(
    records: Sequence[tuple[Array, Array]],
    active_model: ActiveModel,
    training: LstmTraining,
    folder: Path,
    on_progress: Callable[[int, int, float], None] | None = None,
) -> Lstm:
    """Train the network into a folder (`lstm.pt`, `config.yaml`, `progress.csv`); a finished run is loaded.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of the training set.
        active_model: gives the sample time that the run is recorded under; the network has no model.
        training: size and length.
        folder: where the run is kept.
        on_progress: told iterations done, iterations in all and the latest minus mean square error [deg^2].

    Raises:
        ValueError: the folder holds a run of another configuration.
    """
    folder.mkdir(parents=True, exist_ok=True)
    claim_folder(folder, run_configuration(records, active_model, training))
    path = folder / "lstm.pt"
    if path.is_file():
        return load_lstm(path, training.hidden)

    torch.set_num_threads(1)
    torch.manual_seed(training.seed)
    rng = np.random.default_rng(training.seed)
    pull, bend = stack_records(records)
    task = Task(pull, bend, training.noise, training.noise_level)
    network = Lstm(training.hidden, active_model.sample_time)
    _normalise(network, task, rng)
    optimiser = torch.optim.Adam(network.parameters(), lr=training.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, training.iterations)
    window = min(training.window, pull.shape[1])

    curve = []
    for iteration in range(1, training.iterations + 1):
        increments, noise = _draw(task, training.sequences, window, rng)
        loss = ((network(increments) - noise)[:, WARM_UP:] ** 2).mean()
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        curve.append((iteration * training.sequences * window, -loss.item()))
        if on_progress:
            on_progress(iteration, training.iterations, curve[-1][1])

    with (folder / "progress.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("samples", "mean_reward"), *((s, f"{r:.6g}") for s, r in curve)])
    with WholeFile(path) as file:
        torch.save(network.state_dict(), file)
    return network


def load_lstm(path: Path, hidden: int = LstmTraining.hidden) -> Lstm:
    """Read a trained network.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no network of this size.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no LSTM file {path}; `endotwin train --agent lstm` writes one")
    network = Lstm(hidden)
    try:
        network.load_state_dict(torch.load(path, weights_only=True))
    except Exception as error:  # torch raises many classes for a file that it cannot read
        raise ValueError(f"{path} is not an LSTM of {hidden} units written by `endotwin train`") from error
    return network


def _draw(task: Task, count: int, window: int, rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw (count, window, 2) increments and the (count, window) noise that is in the measurement."""
    record, measurement, _ = task.draw(count, rng)
    start = rng.integers(task.pull_mm.shape[1] - window + 1, size=count)
    index = start[:, None] + np.arange(window)
    rows = np.arange(count)[:, None]
    measured = measurement[rows, index]
    pull = task.pull_mm[record[:, None], index]
    noise = measured - task.bend_deg[record[:, None], index]
    increments = _increments(pull, measured)
    return torch.as_tensor(increments, dtype=torch.float32), torch.as_tensor(noise, dtype=torch.float32)


def _increments(pull_mm: Array, measurement_deg: Array) -> Array:
    """Return (B, N, 2) increments from sample to sample, zero at the first."""
    both = np.stack([pull_mm, measurement_deg], axis=-1)
    return np.diff(both, axis=1, prepend=both[:, :1])


def _normalise(network: Lstm, task: Task, rng: np.random.Generator) -> None:
    """Set the scales to the spread of the training data."""
    _, measurement, _ = task.draw(256, rng)
    network.input_scale[0] = float(np.diff(task.pull_mm, axis=1).std())
    network.input_scale[1] = float(np.diff(measurement, axis=1).std())
    network.output_scale[0] = max(task.noise_level, 1e-6) ** 0.5
