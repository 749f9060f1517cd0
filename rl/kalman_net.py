"""Training of the active model with a learned gain, by back-propagation through the filter.

The reference implementation of KalmanNet (Revach et al. 2022) is known for losses that are no numbers;
bounded gains, clipped gradients and a history that ends with its window guard against them.
"""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rl.export import export_module
from rl.options import TrainingOptions, share_of
from rl.supervised import descend, tensor32, train_once
from rl.trainers import OnProgress, Records, Trainer, register_trainer
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned.kalman_net import (
    FEATURES,
    KALMAN_NET,
    TRAINING,
    Corrected,
    advance,
    begin,
    check_affine,
)
from twin.estimation.learned.scale import deviation
from twin.estimation.learned.surprise import affine_steps
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
ERROR_GAIN_LIMIT = 2.0  # largest gain of f [1 / s]
FIRST_GAIN = (0.3, 0.1)  # of theta and, in parts of its limit, of f: where training begins


@dataclasses.dataclass(frozen=True)
class KalmanNetTraining:
    """Settings of the training: back-propagation through time, cut at the end of every window.

    Attributes:
        iterations: gradient steps, one per window.
        sequences: filters that run side by side, each on its own noise.
        window: samples that an error is traced back over.
        episode: samples until all filters start anew, from another wrong initial estimate.
        hidden: units of the GRU.
        learning_rate: of Adam at the start; it falls to zero along a cosine.
        noise: measurement noise during training.
        noise_level: its level: R = 0.1 in the paper.
        initial_error_deg: the initial estimate is off by up to this [deg].
        seed: of the weights and the noise.
    """

    iterations: int = 1500
    sequences: int = 64
    window: int = 50
    episode: int = 300
    hidden: int = 16
    learning_rate: float = 3e-3
    noise: str = "gaussian"
    noise_level: float = 0.1
    initial_error_deg: float = 20.0
    seed: int = 0


class GainNetwork(torch.nn.Module):
    """One GRU layer and a linear output, between zero and the limits of the gains."""

    def __init__(self, hidden: int):
        super().__init__()
        self.hidden = hidden
        self.cell = torch.nn.GRUCell(FEATURES, hidden)
        self.output = torch.nn.Linear(hidden, 2)
        self.limits = torch.nn.Buffer(torch.tensor([1.0, ERROR_GAIN_LIMIT]))
        with torch.no_grad():
            self.output.bias.copy_(torch.logit(torch.tensor(FIRST_GAIN)))

    def forward(self, seen: torch.Tensor, memory: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the (B, 2) gains of theta and of f [1 / s], and what is remembered (1, B, hidden).

        Args:
            seen: (B, FEATURES) in units of sqrt(R); taken on a symmetric logarithmic scale, since a wrong
                initial estimate is sixty such units and the noise one.
            memory: (1, B, hidden).
        """
        features = seen.to(torch.float32)
        hidden = self.cell(torch.sign(features) * torch.log1p(torch.abs(features)), memory[0])
        return self.limits * torch.sigmoid(self.output(hidden)), hidden[None]


def train_kalman_net(
    records: Records,
    active_model: ActiveModel,
    training: KalmanNetTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train into a folder (`kalman_net.onnx`, `config.yaml`, `progress.csv`); a finished run stays.

    Args:
        records: of the training set.
        active_model: gives the model, the sample time and the R that the network is told in training.
        training: size and length.
        folder: where the run is kept.
        on_progress: told iterations done, iterations in all and the latest minus mean square error [deg^2].

    Returns:
        The trained file.

    Raises:
        ValueError: the model is not affine, or the folder holds a run of another configuration.
    """
    check_affine(active_model.model)
    path = folder / TRAINING.file

    def train() -> tuple[Sequence[tuple[int, float]], Callable[[dict[str, Any]], None]]:
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
        return curve, lambda described: export_module(
            network,
            {"seen": torch.zeros(2, FEATURES), "memory": torch.zeros(1, 2, network.hidden)},
            ["said", "remembered"],
            {"seen": [0], "memory": [1]},
            {"agent": TRAINING.agent, "hidden": network.hidden, **described},
            path,
        )

    return train_once(path, records, active_model, training, train)


def _windows(
    network: GainNetwork, task: TrainingTask, active_model: ActiveModel, training: KalmanNetTraining
) -> Iterator[torch.Tensor]:
    """Yield the mean square error, in units of R, of one window after another, with its gradient."""
    rng = random_stream(training.seed, SeedUse.NETWORK)
    keep_all, drive_all = affine_steps(active_model.model, task.pull_mm)
    episode, window = training.episode, training.window
    scale = tensor32(deviation(active_model.measurement_variance))

    def gain_of(features: torch.Tensor, hidden: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        gain, remembered = network(features, hidden[None])
        return gain, remembered[0]

    while True:
        # All filters start anew, anywhere in the records, from initial estimates that are wrong.
        record, measured, initial = task.draw(training.sequences, rng)
        truth = task.bend_deg[record]
        start = rng.integers(truth.shape[1] - episode, size=len(record))
        rows, index = np.arange(len(record)), start + np.arange(1, episode + 1)[:, None]
        series = (keep_all[record], drive_all[record], measured, truth)
        samples = torch.stack([tensor32(values[rows, index]) for values in series], dim=1)  # (N, 4, B)
        first = tensor32(truth[rows, start] + initial - truth[:, 0])
        state = begin(torch, first, torch.zeros(len(first), network.hidden))

        for begins in range(0, episode - window + 1, window):
            # The state is handed on to the next window, its history is not.
            state = Corrected(*(value.detach() for value in state))
            estimate = []
            for keep, drive, measurement, _ in samples[begins : begins + window]:
                state = advance(
                    torch, gain_of, state, keep, drive, measurement, scale, active_model.sample_time
                )
                estimate.append(state.bend_deg)
            error = torch.stack(estimate) - samples[begins : begins + window, 3]
            yield ((error / scale) ** 2).mean()


def _train(
    records: Records,
    active_model: ActiveModel,
    options: TrainingOptions,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    settings = KalmanNetTraining(
        iterations=share_of(KalmanNetTraining.iterations, options),
        noise=options.noise,
        noise_level=options.noise_level,
        initial_error_deg=options.initial_error_deg,
        seed=options.seed,
    )
    return train_kalman_net(records, active_model, settings, folder, on_progress)


register_trainer(Trainer(KALMAN_NET, _train))
