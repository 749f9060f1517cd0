"""A recurrent network that filters (GRU: Cho et al. 2014), told the noise and the model of hysteresis.

It sees, sample by sample, what the model does not foretell of the measurement,

    s_k = (y_k - step(y_{k-1})) / sqrt(R),

with R as told and `step` the model's step from the previous *measurement*, and the increment of the pull. It
predicts the noise in y_k in units of sqrt(R). No absolute value enters, so that another stroke is nothing
new, and no estimate, so that a whole record is one pass. Where noise and model error grow together with
sqrt(R), so does the error of the estimate. It takes no initial estimate: it begins at the first measurement.

A missing measurement leaves the network as it is. The estimate, and the last measurement too, are moved along
by the model, so that the next surprise spans the gap.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from rl.foretold import surprises
from rl.supervised import (
    Network,
    OnProgress,
    SequenceTraining,
    chunks,
    contents_of,
    descend,
    deviation,
    read_file,
    tensor32,
    train_once,
)
from rl.training import run_configuration
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.estimation.task import TrainingTask, stack_records
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]
GRU_FILE = "gru.pt"


class GruNetwork(Network):
    """One GRU layer and a linear output."""

    def __init__(self, hidden: int):
        super().__init__(hidden)
        self.layer = torch.nn.GRU(2, hidden)
        self.output = torch.nn.Linear(hidden, 1)
        self.pull_scale = torch.nn.Buffer(torch.ones(()))  # spread of the training increments [mm]

    def forward(
        self, surprise: torch.Tensor, increment: torch.Tensor, hidden: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the (N, B) noise in units of sqrt(R), and what is remembered (1, B, hidden).

        Args:
            surprise: (N, B) of the measurement, in units of sqrt(R).
            increment: (N, B) of the pull [mm].
            hidden: (1, B, hidden) remembered from the samples before; nothing where it is None.
        """
        outputs, hidden = self.layer(torch.stack([surprise, increment / self.pull_scale], dim=-1), hidden)
        return self.output(outputs)[..., 0], hidden


class GruState(NamedTuple):
    """What moves."""

    bend_deg: Array  # (B,) estimate
    measurement_deg: Array  # (B,) the last one, moved along by the model over gaps; NaN before the first
    memory: Array  # (m, B) of the model
    hidden: torch.Tensor  # (1, B, hidden)


@dataclasses.dataclass(frozen=True)
class Gru(Estimator[GruState]):
    """A trained network, the model that it was trained with, and what it is told of the noise."""

    network: GruNetwork
    model: HysteresisModel
    sample_time: float
    """T that it was trained at [s]."""
    measurement_variance: ArrayLike = 0.1
    """R [deg^2], one for all or (B,)."""

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def start(self, pull_mm: Array, bend_deg: Array) -> GruState:
        """Return a network that has seen nothing; the initial estimate is shown until a measurement comes."""
        hidden = torch.zeros(1, bend_deg.size, self.network.hidden)
        return GruState(bend_deg.copy(), np.full(bend_deg.size, np.nan), self.model.start(pull_mm), hidden)

    @torch.inference_mode()
    def step(
        self, state: GruState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> GruState:
        """Return the state one sample later."""
        scale = deviation(self.measurement_variance)
        first, missing = np.isnan(state.measurement_deg), np.isnan(measurement_deg)
        moved, memory = self.model.step(state.bend_deg, state.memory, pull_mm, previous_pull_mm)
        last = np.where(first, state.bend_deg, state.measurement_deg)
        foretold, _ = self.model.step(last, state.memory, pull_mm, previous_pull_mm)
        surprise = np.where(first | missing, 0, (measurement_deg - foretold) / scale)
        increment = np.broadcast_to(pull_mm - previous_pull_mm, surprise.shape)
        noise, hidden = self.network(tensor32(surprise[None]), tensor32(increment[None]), state.hidden)
        return GruState(
            np.where(missing, moved, measurement_deg - scale * noise[0].numpy()),
            np.where(missing, np.where(first, np.nan, foretold), measurement_deg),
            memory,
            torch.where(torch.as_tensor(missing)[:, None], state.hidden, hidden),
        )

    def bend_deg(self, state: GruState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    @torch.inference_mode()
    def estimate(self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike) -> Array:
        """Filter whole records (see `Estimator.estimate`), many samples in one pass where none is missing."""
        if np.isnan(measurement_deg[..., 1:]).any():
            return super().estimate(pull_mm, measurement_deg, initial_bend_deg)
        pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
        samples, batch = measurement.shape
        scale = deviation(self.measurement_variance)
        estimate = np.empty_like(measurement)
        estimate[0] = initial
        memory = self.model.start(pull[0])
        hidden = torch.zeros(1, batch, self.network.hidden)
        for part in chunks(samples, batch):
            before = slice(part.start - 1, part.stop)  # increments are against the sample before
            surprise, memory = surprises(self.model, pull[before], measurement[before], memory)
            if part.start == 1:
                surprise[0] = 0  # the measurement before it is not used
            noise, hidden = self.network(
                tensor32(surprise / scale), tensor32(np.diff(pull[before], axis=0)), hidden
            )
            estimate[part] = measurement[part] - scale * noise.numpy()
        return estimate.T


def train_gru(
    records: Sequence[tuple[Array, Array]],
    active_model: ActiveModel,
    training: SequenceTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Gru:
    """Train the network into a folder (`gru.pt`, `config.yaml`, `progress.csv`); a finished run is loaded.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of the training set.
        active_model: gives the model, the sample time and the R that the network is told in training.
        training: size and length.
        folder: where the run is kept.
        on_progress: told iterations done, iterations in all and the latest minus mean square error [deg^2].

    Raises:
        ValueError: the folder holds a run of another configuration.
    """
    configuration = run_configuration(records, active_model, training)

    def train() -> tuple[dict[str, Any], list[tuple[int, float]]]:
        rng = np.random.default_rng(training.seed)
        pull, bend = stack_records(records)
        task = TrainingTask(pull, bend, training.noise, training.noise_level)
        model, scale = active_model.model, float(deviation(active_model.measurement_variance))
        network = GruNetwork(training.hidden)
        network.pull_scale.fill_(float(np.diff(pull, axis=1).std()))
        window = min(training.window, pull.shape[1] - 1)

        def loss() -> torch.Tensor:
            surprise, increment, noise = _draw(task, model, training.sequences, window, rng)
            predicted, _ = network(tensor32(surprise / scale), tensor32(increment))
            return ((predicted - tensor32(noise / scale)) ** 2).mean()

        curve = descend(
            network,
            loss,
            training.iterations,
            training.learning_rate,
            training.sequences * window,
            scale**2,
            on_progress,
        )
        return contents_of("gru", network, active_model, configuration), curve

    return train_once(folder / GRU_FILE, configuration, training.seed, train, load_gru)


def load_gru(path: Path) -> Gru:
    """Read a trained network.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    network, model, sample_time = read_file(path, "gru", GruNetwork)
    return Gru(network, model, sample_time)


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
