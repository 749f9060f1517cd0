"""The active model with a learned gain, after KalmanNet (Revach et al. 2022, arXiv 2107.10043).

The state is that of the active model, X = [theta, f]: the bending angle [deg] and the error of the model
[deg / s]. The prediction is its too,

    theta_k|k-1 = step(theta_{k-1}) + f T,

and the correction K (y_k - theta_k|k-1) has its gain from a small recurrent network in place of P, Q and R.
It sees the paper's four features, F1 the difference of successive measurements, F2 the innovation, F3 the
difference of successive estimates and F4 the latest correction, in units of sqrt(R) as told. From F1 and F3
we take what the model foretells: a pull that moves the angle is then nothing new, and errors that grow
together with sqrt(R) are filtered alike. Of f, F3 and F4 are one.

The gains are bounded: K_theta in [0, 1], a convex step towards the measurement, and K_f in [0, 2] per second.
The reference implementation is known for losses that are no numbers; bounds, clipped gradients and a history
that ends with its window guard against them. Without a measurement the filter predicts, and the network stays
as it is.
"""

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from rl.foretold import affine_steps, check_affine
from rl.supervised import (
    Network,
    OnProgress,
    contents_of,
    descend,
    deviation,
    read_file,
    tensor32,
    train_once,
)
from rl.training import run_configuration
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.task import TrainingTask, stack_records
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]
KALMAN_NET_FILE = "kalman_net.pt"
ERROR_GAIN_LIMIT = 2.0  # largest gain of f [1 / s]
FEATURES = 5
FIRST_GAIN = (0.3, 0.1)  # of theta and, in parts of its limit, of f: where training begins


@dataclasses.dataclass(frozen=True)
class KalmanNetTraining:
    """How the gain is trained: back-propagation through time, cut at the end of every window."""

    iterations: int = 1500
    """Gradient steps, one per window."""
    sequences: int = 64
    """Filters that run side by side, each on its own noise."""
    window: int = 50
    """Samples that an error is traced back over."""
    episode: int = 300
    """Samples until all filters start anew, from another wrong initial estimate."""
    hidden: int = 16
    """Units of the GRU."""
    learning_rate: float = 3e-3
    """Of Adam at the start; it falls to zero along a cosine."""
    noise: str = "gaussian"
    """Measurement noise during training."""
    noise_level: float = 0.1
    """Its level: R = 0.1 in the paper."""
    initial_error_deg: float = 20.0
    """The initial estimate is off by up to this [deg]."""
    seed: int = 0
    """Of the weights and the noise."""


class GainNetwork(Network):
    """A GRU cell and a linear output, between zero and the limits of the gains."""

    def __init__(self, hidden: int):
        super().__init__(hidden)
        self.cell = torch.nn.GRUCell(FEATURES, hidden)
        self.output = torch.nn.Linear(hidden, 2)
        self.limits = torch.nn.Buffer(torch.tensor([1.0, ERROR_GAIN_LIMIT]))
        with torch.no_grad():
            self.output.bias.copy_(torch.logit(torch.tensor(FIRST_GAIN)))

    def forward(self, features: torch.Tensor, hidden: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the (B, 2) gains of theta and of f [1 / s], and what is remembered (B, hidden).

        Args:
            features: (B, FEATURES) in units of sqrt(R); seen on a symmetric logarithmic scale, since a wrong
                initial estimate is sixty such units and the noise one.
            hidden: (B, hidden).
        """
        hidden = self.cell(torch.sign(features) * torch.log1p(torch.abs(features)), hidden)
        return self.limits * torch.sigmoid(self.output(hidden)), hidden


class Corrected(NamedTuple):
    """What moves in the filter, apart from the memory of the model; everything in degrees and seconds."""

    bend_deg: torch.Tensor  # (B,) theta
    error: torch.Tensor  # (B,) f [deg / s]
    measurement_deg: torch.Tensor  # (B,) the last one, or the prediction in its place
    correction: torch.Tensor  # (2, B) the latest K times innovation
    hidden: torch.Tensor  # (B, hidden)


class KalmanNetState(NamedTuple):
    """What moves in the filter and in its model."""

    filter: Corrected
    memory: Array  # (m, B)


@dataclasses.dataclass(frozen=True)
class KalmanNet(Estimator[KalmanNetState]):
    """A trained gain, the model that it was trained with, and what it is told of the noise."""

    network: GainNetwork
    model: HysteresisModel
    sample_time: float
    """T [s]."""
    measurement_variance: ArrayLike = 0.1
    """R [deg^2], one for all or (B,)."""

    def __post_init__(self) -> None:
        """Refuse a model whose step cannot be taken as affine.

        Raises:
            ValueError: the model is not affine in the angle.
        """
        check_affine(self.model)

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def start(self, pull_mm: Array, bend_deg: Array) -> KalmanNetState:
        """Return the state at the first sample, with no known error of the model."""
        first = begin(torch.tensor(bend_deg), self.network.hidden)
        return KalmanNetState(first, self.model.start(pull_mm))

    @torch.inference_mode()
    def step(
        self, state: KalmanNetState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> KalmanNetState:
        """Predict and correct by one sample."""
        bend = state.filter.bend_deg.numpy()
        drive, memory = self.model.step(np.zeros_like(bend), state.memory, pull_mm, previous_pull_mm)
        keep = self.model.slope(bend, pull_mm, previous_pull_mm)
        scale = deviation(self.measurement_variance)
        k, d, y, s = (torch.tensor(values) for values in (keep, drive, measurement_deg, scale))
        return KalmanNetState(advance(self.network, state.filter, k, d, y, s, self.sample_time), memory)

    def bend_deg(self, state: KalmanNetState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.filter.bend_deg.numpy()


def begin(bend_deg: torch.Tensor, hidden: int) -> Corrected:
    """Return filters at their (B,) initial estimates [deg]."""
    zero = torch.zeros_like(bend_deg)
    return Corrected(bend_deg, zero, bend_deg, torch.stack([zero, zero]), torch.zeros(len(bend_deg), hidden))


def advance(
    network: GainNetwork,
    state: Corrected,
    keep: torch.Tensor,
    drive: torch.Tensor,
    measurement_deg: torch.Tensor,
    deviation_deg: torch.Tensor,
    sample_time: float,
) -> Corrected:
    """Predict and correct by one sample.

    Args:
        network: of the gain.
        state: B filters at the sample before.
        keep: (B,) the model's step is keep theta + drive.
        drive: (B,) [deg].
        measurement_deg: (B,), NaN where there is none.
        deviation_deg: sqrt(R), scalar or (B,) [deg].
        sample_time: T [s].
    """
    foretold = state.error * sample_time
    prediction = keep * state.bend_deg + drive + foretold
    seen = ~torch.isnan(measurement_deg)
    measurement = torch.where(seen, measurement_deg, prediction)
    innovation = measurement - prediction
    difference = measurement - keep * state.measurement_deg - drive  # F1, less what the model foretells
    of_bend, of_error = state.correction
    moved = (state.error - of_error) * sample_time + of_bend  # F3, less what the model foretells
    features = [difference, innovation, moved, of_bend, of_error * sample_time]
    seen_by_network = torch.stack(features, dim=-1) / deviation_deg[..., None]
    gain, hidden = network(seen_by_network.to(torch.float32), state.hidden)

    correction = gain.T * innovation
    return Corrected(
        prediction + correction[0],
        state.error + correction[1],
        measurement,
        correction,
        torch.where(seen[:, None], hidden, state.hidden),
    )


def train_kalman_net(
    records: Sequence[tuple[Array, Array]],
    active_model: ActiveModel,
    training: KalmanNetTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> KalmanNet:
    """Train into a folder (`kalman_net.pt`, `config.yaml`, `progress.csv`); a finished run is loaded.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of the training set.
        active_model: gives the model, the sample time and the R that the network is told in training.
        training: size and length.
        folder: where the run is kept.
        on_progress: told iterations done, iterations in all and the latest minus mean square error [deg^2].

    Raises:
        ValueError: the model is not affine, or the folder holds a run of another configuration.
    """
    check_affine(active_model.model)
    configuration = run_configuration(records, active_model, training)

    def train() -> tuple[dict[str, Any], list[tuple[int, float]]]:
        network = GainNetwork(training.hidden)
        task = TrainingTask(
            *stack_records(records), training.noise, training.noise_level, training.initial_error_deg
        )
        episode = min(training.episode, task.pull_mm.shape[1] - 1)
        cut = dataclasses.replace(training, episode=episode, window=min(training.window, episode))
        windows = _windows(network, task, active_model, cut)
        unit = float(deviation(active_model.measurement_variance)) ** 2
        curve = descend(
            network,
            lambda: next(windows),
            training.iterations,
            training.learning_rate,
            cut.sequences * cut.window,
            unit,
            on_progress,
        )
        return contents_of("kalman-net", network, active_model, configuration), curve

    path = folder / KALMAN_NET_FILE
    return train_once(path, configuration, training.seed, train, load_kalman_net)


def load_kalman_net(path: Path) -> KalmanNet:
    """Read a trained gain.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    return KalmanNet(*read_file(path, "kalman-net", GainNetwork))


def _windows(
    network: GainNetwork, task: TrainingTask, active_model: ActiveModel, training: KalmanNetTraining
) -> Iterator[torch.Tensor]:
    """Yield the mean square error, in units of R, of one window after another, with its gradient."""
    rng = np.random.default_rng(training.seed)
    keep_all, drive_all = affine_steps(active_model.model, task.pull_mm)
    episode, window = training.episode, training.window
    scale = tensor32(deviation(active_model.measurement_variance))
    while True:
        # All filters start anew, anywhere in the records, from initial estimates that are wrong.
        record, measured, initial = task.draw(training.sequences, rng)
        truth = task.bend_deg[record]
        start = rng.integers(truth.shape[1] - episode, size=len(record))
        rows, index = np.arange(len(record)), start + np.arange(1, episode + 1)[:, None]
        series = (keep_all[record], drive_all[record], measured, truth)
        samples = torch.stack([tensor32(values[rows, index]) for values in series], dim=1)  # (N, 4, B)
        state = begin(tensor32(truth[rows, start] + initial - truth[:, 0]), network.hidden)

        for first in range(0, episode - window + 1, window):
            # The state is handed on to the next window, its history is not.
            state = Corrected(*(value.detach() for value in state))
            estimate = []
            for keep, drive, measurement, _ in samples[first : first + window]:
                state = advance(network, state, keep, drive, measurement, scale, active_model.sample_time)
                estimate.append(state.bend_deg)
            error = torch.stack(estimate) - samples[first : first + window, 3]
            yield ((error / scale) ** 2).mean()
