"""Recurrent networks that filter: an LSTM without a model, and a GRU that knows the noise and the model.

Both predict the noise of a measurement, so that the estimate is y minus that. Absolute values are no inputs:
a network that is trained on them on the stroke [2, 4] mm does not generalise to [-1, 1] mm.

- LSTM (Hochreiter and Schmidhuber 1997): sees the increments of the pull and of the measurement. It has no
  model that could move the estimate: while a measurement is missing, the estimate is held, and the next
  increments span the gap.
- GRU (Cho et al. 2014): sees s_k = (y_k - step(y_{k-1})) / sqrt(R), the part of the measurement that the
  model does not predict from the previous *measurement*, and the increment of the pull. It predicts the noise
  in units of sqrt(R). While a measurement is missing, the model moves the estimate and the last measurement.

Neither uses the initial estimate, except as output until the first measurement.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from rl.options import TrainingOptions
from rl.supervised import Lesson, SequenceTraining, tensor32, train_network
from rl.trainers import OnProgress, Records, Trainer, register_trainer
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask
from twin.estimation.learned.methods import GRU, LSTM
from twin.estimation.learned.step import LEAST_VARIANCE, affine_steps, check_affine
from twin.estimation.registry import MethodSpec
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
Tensor = torch.Tensor
WARM_UP = 10  # samples at the start of a sequence of the LSTM that are not scored: it has seen nothing yet


class SequenceNetwork(torch.nn.Module):
    """One recurrent layer and a linear output, with the normalisation of inputs and output."""

    def __init__(self, layer: type[torch.nn.LSTM] | type[torch.nn.GRU], hidden: int):
        super().__init__()
        self.layer = layer(2, hidden)
        self.output = torch.nn.Linear(hidden, 1)
        self.input_scale = torch.nn.Buffer(torch.ones(2))  # spread of what it sees
        self.output_scale = torch.nn.Buffer(torch.ones(1))  # of the noise that it predicts

    def forward(self, seen: Tensor) -> Tensor:
        """Return the (N, B) noise of (N, B, 2) sequences from their start."""
        return self.readout(self.layer(seen / self.input_scale)[0])

    def readout(self, outputs: Tensor) -> Tensor:
        """Return the noise from (..., hidden) outputs of the layer."""
        noise: Tensor = self.output(outputs)[..., 0] * self.output_scale
        return noise


def cell_of(layers: torch.nn.LSTM | torch.nn.GRU, number: int = 0) -> torch.nn.LSTMCell | torch.nn.GRUCell:
    """Return one of some recurrent layers as a cell, which takes a sample at a time."""
    kind = torch.nn.LSTMCell if isinstance(layers, torch.nn.LSTM) else torch.nn.GRUCell
    cell = kind(layers.hidden_size if number else layers.input_size, layers.hidden_size)
    ending, weights = f"_l{number}", layers.state_dict()
    cell.load_state_dict(
        {name.removesuffix(ending): of for name, of in weights.items() if name.endswith(ending)}
    )
    return cell


class RecurrentStep(torch.nn.Module):
    """One sample of a trained network, as it is deployed; `hidden` is the memory of its cell."""

    inputs: ClassVar[tuple[str, ...]]  # names of what it takes
    values: ClassVar[tuple[str, ...]]  # names of the numbers of its state before `hidden`

    def __init__(self, network: SequenceNetwork):
        super().__init__()
        self.network = network
        self.cell = cell_of(network.layer)
        hidden = network.layer.hidden_size
        self.size = 2 * hidden if isinstance(self.cell, torch.nn.LSTMCell) else hidden

    def noise(self, seen: Sequence[Tensor], hidden: Tensor) -> tuple[Tensor, Tensor]:
        """Return the (B,) noise, and the memory after it."""
        values = torch.stack(list(seen), dim=1) / self.network.input_scale
        if isinstance(self.cell, torch.nn.LSTMCell):
            output, cell = self.cell(values, hidden.chunk(2, dim=1))
            return self.network.readout(output), torch.cat([output, cell], dim=1)
        output = self.cell(values, hidden)
        return self.network.readout(output), output

    @property
    def state(self) -> dict[str, tuple[int, ...]]:
        """Shape for one filter of each array of its state."""
        return {name: () for name in self.values} | {"hidden": (self.size,)}


class LstmStep(RecurrentStep):
    """One sample of the LSTM; the state is the estimate, the way since the last measurement, and that one."""

    inputs = ("increment_mm", "measurement_deg")
    values = ("previous_deg", "way_mm", "measured", "begun")

    def forward(
        self,
        increment_mm: Tensor,
        measurement_deg: Tensor,
        previous_deg: Tensor,
        way_mm: Tensor,
        measured: Tensor,
        begun: Tensor,
        hidden: Tensor,
    ) -> tuple[Tensor, ...]:
        """Return the estimate, and the state one sample later."""
        missing = torch.isnan(measurement_deg)
        seen = (~missing).to(begun.dtype)
        y = torch.where(missing, measured, measurement_deg)
        way = begun * (way_mm + increment_mm)
        noise, after = self.noise([way, begun * (y - measured)], hidden)
        bend = torch.where(missing, previous_deg, y - noise)
        after = hidden + seen[:, None] * (after - hidden)
        return bend, (1 - seen) * way, y, torch.maximum(begun, seen), after


class GruStep(RecurrentStep):
    """One sample of the GRU; the state is the estimate and the last measurement, moved along over gaps."""

    inputs = ("keep", "drive_deg", "increment_mm", "measurement_deg", "variance")
    values = ("previous_deg", "measured", "begun")

    def forward(
        self,
        keep: Tensor,
        drive_deg: Tensor,
        increment_mm: Tensor,
        measurement_deg: Tensor,
        variance: Tensor,
        previous_deg: Tensor,
        measured: Tensor,
        begun: Tensor,
        hidden: Tensor,
    ) -> tuple[Tensor, ...]:
        """Return the estimate, and the state one sample later."""
        missing = torch.isnan(measurement_deg)
        seen = (~missing).to(begun.dtype)
        unit = torch.sqrt(variance)
        predicted = begun * (keep * measured + drive_deg)
        y = torch.where(missing, predicted, measurement_deg)
        noise, after = self.noise([begun * (y - predicted) / unit, increment_mm], hidden)
        bend = torch.where(missing, keep * previous_deg + drive_deg, y - unit * noise)
        after = hidden + seen[:, None] * (after - hidden)
        return bend, y, torch.maximum(begun, seen), after


def train_lstm(
    records: Records,
    active_model: ActiveModel,
    training: SequenceTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train the LSTM into a folder and return its file; the active model gives only the sample time."""

    def prepare(task: TrainingTask) -> Lesson:
        rng = random_stream(training.seed, SeedUse.NETWORK)
        network = SequenceNetwork(torch.nn.LSTM, training.hidden)
        _, measurement, _ = task.draw(256, rng)
        network.input_scale[0] = float(np.diff(task.pull_mm, axis=1).std())
        network.input_scale[1] = float(np.diff(measurement, axis=1).std())
        network.output_scale[0] = max(task.noise_level, LEAST_VARIANCE) ** 0.5
        window = min(training.window, task.pull_mm.shape[1])
        if window <= WARM_UP:
            raise InputError(f"records of {window} samples: the network is trained on more than {WARM_UP}")

        def loss() -> Tensor:
            record, measurement, _ = task.draw(training.sequences, rng)
            start = rng.integers(task.pull_mm.shape[1] - window + 1, size=training.sequences)
            rows, index = np.arange(training.sequences)[:, None], start[:, None] + np.arange(window)
            measured, pull = measurement[rows, index], task.pull_mm[record[:, None], index]
            noise = tensor32((measured - task.bend_deg[record[:, None], index]).T)
            both = np.stack([pull.T, measured.T], axis=-1)
            predicted = network(tensor32(np.diff(both, axis=0, prepend=both[:1])))
            square: Tensor = (predicted - noise)[WARM_UP:] ** 2
            return square.mean()

        return Lesson(network, loss, training.sequences * window, 1.0, lambda: LstmStep(network))

    return train_network(LSTM, prepare, records, active_model, training, folder, on_progress)


def train_gru(
    records: Records,
    active_model: ActiveModel,
    training: SequenceTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train the GRU into a folder and return its file; the active model gives model, sample time and R."""
    check_affine(active_model.model)
    unit = float(np.sqrt(np.maximum(active_model.measurement_variance, LEAST_VARIANCE)))

    def prepare(task: TrainingTask) -> Lesson:
        rng = random_stream(training.seed, SeedUse.NETWORK)
        network = SequenceNetwork(torch.nn.GRU, training.hidden)
        increments = np.diff(task.pull_mm, axis=1, prepend=task.pull_mm[:, :1])
        network.input_scale[1] = float(increments[:, 1:].std())
        keep, drive = affine_steps(active_model.model, task.pull_mm)
        window = min(training.window, task.pull_mm.shape[1] - 1)

        def loss() -> Tensor:
            record, measurement, _ = task.draw(training.sequences, rng)
            surprise = np.zeros_like(measurement)
            surprise[:, 1:] = (
                measurement[:, 1:] - (keep[record] * np.roll(measurement, 1, axis=1) + drive[record])[:, 1:]
            )
            start = rng.integers(1, measurement.shape[1] - window + 1, size=training.sequences)
            rows, index = np.arange(training.sequences), start + np.arange(window)[:, None]
            surprise[rows, start] = 0  # as at the first sample of a record
            noise = tensor32((measurement - task.bend_deg[record])[rows, index] / unit)
            seen = np.stack([surprise[rows, index] / unit, increments[record][rows, index]], axis=-1)
            square: Tensor = (network(tensor32(seen)) - noise) ** 2
            return square.mean()

        return Lesson(network, loss, training.sequences * window, unit**2, lambda: GruStep(network))

    return train_network(GRU, prepare, records, active_model, training, folder, on_progress)


def _register(spec: MethodSpec, train: Callable[..., Path]) -> None:
    def run(records: Records, active_model: ActiveModel, options: TrainingOptions, *rest: Any) -> Path:
        return train(records, active_model, SequenceTraining().scaled(options), *rest)

    register_trainer(Trainer(spec, run))


_register(LSTM, train_lstm)
_register(GRU, train_gru)
