"""The LSTM baseline (Hochreiter and Schmidhuber 1997), trained on the same records and noise as the policies.

It sees what changes from sample to sample, normalised by the training data: increments of the pulling
distance and of the measurement. It predicts the noise of the measurement, so that its estimate is y minus
that. Absolute values are left out on purpose: trained on stroke [2, 4] mm, a network that sees them has never
met [-1, 1] mm.

A sample without measurement is skipped: the estimate stands, since there is no model that could move it, and
the next increments span the gap.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from rl.supervised import Network, OnProgress, SequenceTraining, chunks, descend, tensor32, train_once
from rl.training import run_configuration
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, time_first
from twin.estimation.task import TrainingTask, stack_records

Array = NDArray[np.float64]
Memory = tuple[torch.Tensor, torch.Tensor]
LSTM_FILE = "lstm.pt"
WARM_UP = 10  # samples at the start of a sequence that are not scored: the network has seen nothing yet


class Lstm(Network):
    """One LSTM layer and a linear output, with the normalisation of inputs and output inside."""

    def __init__(self, hidden: int, sample_time: float = 0.0):
        super().__init__(hidden)
        self.sample_time = torch.nn.Buffer(torch.tensor(sample_time, dtype=torch.float64))
        self.layer = torch.nn.LSTM(2, hidden, batch_first=True)
        self.output = torch.nn.Linear(hidden, 1)
        self.input_scale = torch.nn.Buffer(torch.ones(2))
        self.output_scale = torch.nn.Buffer(torch.ones(1))

    def forward(self, increments: torch.Tensor, memory: Memory | None = None) -> tuple[torch.Tensor, Memory]:
        """Return the noise and what is remembered after it.

        Args:
            increments: (B, N, 2) of pull [mm] and measurement [deg].
            memory: of the samples before, (1, B, hidden) twice; nothing is remembered where it is None.

        Returns:
            (B, N) predicted noise [deg], and the memory.
        """
        outputs, memory = self.layer(increments / self.input_scale, memory)
        return self.output(outputs)[..., 0] * self.output_scale, memory

    @torch.no_grad()
    def estimate(self, pull_mm: Array, measurement_deg: Array) -> Array:
        """Filter (B, N) measurements [deg] along a command (N,) [mm], the first too; returns (B, N) [deg]."""
        measurement = np.atleast_2d(measurement_deg)
        increments = _increments(np.broadcast_to(pull_mm, measurement.shape), measurement)
        noise, _ = self(tensor32(increments))
        return measurement - noise.numpy().astype(float)


class LstmState(NamedTuple):
    """What moves."""

    bend_deg: Array  # (B,) estimate
    pull_mm: Array  # (B,) at the last measurement
    measurement_deg: Array  # (B,) the last one; NaN before the first
    memory: Memory


@dataclasses.dataclass(frozen=True)
class LstmEstimator(Estimator[LstmState]):
    """The network sample by sample; it is told nothing and takes no initial estimate."""

    network: Lstm

    def start(self, pull_mm: Array, bend_deg: Array) -> LstmState:
        """Return a network that has seen nothing; the initial estimate is shown until a measurement comes."""
        zero = torch.zeros(1, bend_deg.size, self.network.hidden)
        return LstmState(bend_deg.copy(), pull_mm.copy(), np.full(bend_deg.size, np.nan), (zero, zero))

    @torch.inference_mode()
    def step(
        self, state: LstmState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> LstmState:
        """Return the state one sample later."""
        first, missing = np.isnan(state.measurement_deg), np.isnan(measurement_deg)
        pull = np.where(first, 0, pull_mm - state.pull_mm)
        increments = np.stack([pull, np.nan_to_num(measurement_deg - state.measurement_deg)], axis=-1)
        noise, memory = self.network(tensor32(increments[:, None]), state.memory)
        kept = torch.as_tensor(missing)[:, None]
        return LstmState(
            np.where(missing, state.bend_deg, measurement_deg - noise[:, 0].numpy()),
            np.where(missing, state.pull_mm, pull_mm),
            np.where(missing, state.measurement_deg, measurement_deg),
            (torch.where(kept, state.memory[0], memory[0]), torch.where(kept, state.memory[1], memory[1])),
        )

    def bend_deg(self, state: LstmState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    @torch.inference_mode()
    def estimate(self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike) -> Array:
        """Filter whole records (see `Estimator.estimate`), many samples in one pass where none is missing."""
        if np.isnan(measurement_deg[..., 1:]).any():
            return super().estimate(pull_mm, measurement_deg, initial_bend_deg)
        pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
        estimate = np.empty_like(measurement)
        estimate[0] = initial
        memory = None
        for part in chunks(*measurement.shape):
            # With the sample before, except at the first, whose measurement is not used.
            before = slice(max(part.start - 1, 1), part.stop)
            increments = _increments(pull[before].T, measurement[before].T)[:, part.start - before.start :]
            noise, memory = self.network(tensor32(increments), memory)
            estimate[part] = measurement[part] - noise.numpy().T
        return estimate.T


def train_lstm(
    records: Sequence[tuple[Array, Array]],
    active_model: ActiveModel,
    training: SequenceTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
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

    def train() -> tuple[dict[str, Any], list[tuple[int, float]]]:
        rng = np.random.default_rng(training.seed)
        task = TrainingTask(*stack_records(records), training.noise, training.noise_level)
        network = Lstm(training.hidden, active_model.sample_time)
        _normalise(network, task, rng)
        window = min(training.window, task.pull_mm.shape[1])
        if window <= WARM_UP:
            raise ValueError(f"records of {window} samples: the LSTM is trained on more than {WARM_UP}")

        def loss() -> torch.Tensor:
            increments, noise = _draw(task, training.sequences, window, rng)
            predicted, _ = network(increments)
            return ((predicted - noise)[:, WARM_UP:] ** 2).mean()

        curve = descend(
            network,
            loss,
            training.iterations,
            training.learning_rate,
            training.sequences * window,
            on_progress=on_progress,
        )
        return network.state_dict(), curve

    return train_once(
        folder / LSTM_FILE,
        run_configuration(records, active_model, training),
        training.seed,
        train,
        lambda path: load_lstm(path, training.hidden),
    )


def load_lstm(path: Path, hidden: int = SequenceTraining.hidden) -> Lstm:
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


def _draw(
    task: TrainingTask, count: int, window: int, rng: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw (count, window, 2) increments and the (count, window) noise that is in the measurement."""
    record, measurement, _ = task.draw(count, rng)
    start = rng.integers(task.pull_mm.shape[1] - window + 1, size=count)
    index = start[:, None] + np.arange(window)
    rows = np.arange(count)[:, None]
    measured = measurement[rows, index]
    pull = task.pull_mm[record[:, None], index]
    noise = measured - task.bend_deg[record[:, None], index]
    increments = _increments(pull, measured)
    return tensor32(increments), tensor32(noise)


def _increments(pull_mm: Array, measurement_deg: Array) -> Array:
    """Return (B, N, 2) increments from sample to sample, zero at the first."""
    both = np.stack([pull_mm, measurement_deg], axis=-1)
    return np.diff(both, axis=1, prepend=both[:, :1])


def _normalise(network: Lstm, task: TrainingTask, rng: np.random.Generator) -> None:
    """Set the scales to the spread of the training data."""
    _, measurement, _ = task.draw(256, rng)
    network.input_scale[0] = float(np.diff(task.pull_mm, axis=1).std())
    network.input_scale[1] = float(np.diff(measurement, axis=1).std())
    network.output_scale[0] = max(task.noise_level, 1e-6) ** 0.5
