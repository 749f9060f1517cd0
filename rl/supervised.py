"""What the learned filters share: a run in one folder, descent by Adam (Kingma and Ba 2015), their files.

The filters are trained with the truth of the training records as the answer. What they learn from and what
they minimise is theirs.
"""

import csv
import dataclasses
import io
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from twin.estimation.active_model import ActiveModel
from twin.files.atomic import WholeFile
from twin.files.run_folder import claim_folder
from twin.hysteresis import HysteresisModel, model_from_dict, model_to_dict

Array = NDArray[np.float64]
Trained = TypeVar("Trained")
Kind = TypeVar("Kind", bound="Network")
OnProgress = Callable[[int, int, float], None]
"""Told iterations done, iterations in all and the latest minus mean square error [deg^2]."""
GRADIENT_LIMIT = 1.0  # norm at which gradients are clipped
CHUNK = 200_000  # samples, over all records, that pass through a network at once: some 100 MB
LEAST_VARIANCE = 1e-6  # R [deg^2] below which a network is told this: it divides by sqrt(R)


@dataclasses.dataclass(frozen=True)
class SequenceTraining:
    """How a recurrent network, LSTM or GRU, is trained on windows of the records."""

    iterations: int = 600
    """Gradient steps, each on fresh noise."""
    sequences: int = 64
    """Records with their own noise in one step."""
    window: int = 150
    """Samples of each."""
    hidden: int = 32
    """Units of the one recurrent layer."""
    learning_rate: float = 5e-3
    """Of Adam at the start; it falls to zero along a cosine."""
    noise: str = "gaussian"
    """Measurement noise during training."""
    noise_level: float = 0.1
    """Its level: R = 0.1 in the paper."""
    seed: int = 0
    """Of the weights and the noise."""


class Network(torch.nn.Module):
    """A module of one size that travels between processes as bytes, not as torch's shared memory."""

    def __init__(self, hidden: int):
        super().__init__()
        self.hidden = hidden

    def __reduce__(self) -> tuple[Callable[..., "Network"], tuple[type[Self], int, bytes]]:
        """Pickle the weights as the bytes of a file."""
        buffer = io.BytesIO()
        torch.save(self.state_dict(), buffer)
        return _arrive, (type(self), self.hidden, buffer.getvalue())


def _arrive(kind: type[Network], hidden: int, weights: bytes) -> Network:
    """Rebuild a network in the process that it was sent to."""
    torch.set_num_threads(1)  # processes are many: their threads would only wait for each other
    network = kind(hidden)
    network.load_state_dict(torch.load(io.BytesIO(weights), weights_only=True))
    return network


def train_once(
    path: Path,
    configuration: dict[str, Any],
    seed: int,
    train: Callable[[], tuple[dict[str, Any], Sequence[tuple[int, float]]]],
    load: Callable[[Path], Trained],
) -> Trained:
    """Train into the folder of a file (`config.yaml`, `progress.csv` and the file); a finished run is loaded.

    Args:
        path: the file, which is there when the run is finished.
        configuration: what the run depends on.
        seed: of the weights; `train` makes its own numbers.
        train: returns the contents of the file, and the mean reward [deg^2] after so many samples.
        load: reads the file.

    Raises:
        ValueError: the folder holds a run of another configuration.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    claim_folder(path.parent, configuration)
    if not path.is_file():
        torch.set_num_threads(1)  # the networks are small
        torch.manual_seed(seed)
        contents, curve = train()
        with (path.parent / "progress.csv").open("w", newline="") as file:
            csv.writer(file).writerows([("samples", "mean_reward"), *((s, f"{r:.6g}") for s, r in curve)])
        with WholeFile(path) as whole:
            torch.save(contents, whole)
    return load(path)


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
        samples: behind one loss.
        loss_unit_deg2: what a loss of one is [deg^2].
        on_progress: told how far it is.

    Returns:
        Minus mean square error [deg^2] after so many samples, step by step.
    """
    optimiser = torch.optim.Adam(network.parameters(), lr=learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, iterations)
    curve = []
    for iteration in range(1, iterations + 1):
        value = loss()
        optimiser.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), GRADIENT_LIMIT)
        optimiser.step()
        schedule.step()
        curve.append((iteration * samples, -value.item() * loss_unit_deg2))
        if on_progress:
            on_progress(iteration, iterations, curve[-1][1])
    return curve


def contents_of(
    agent: str, network: Network, active_model: ActiveModel, configuration: dict[str, Any]
) -> dict[str, Any]:
    """Return what the file of a learned filter holds: all that it needs to run, and how it was trained."""
    return {
        "agent": agent,
        "hidden": network.hidden,
        "weights": network.state_dict(),
        "model": model_to_dict(active_model.model),
        "sample_time": active_model.sample_time,
        "configuration": configuration,
    }


def read_file(path: Path, agent: str, kind: type[Kind]) -> tuple[Kind, HysteresisModel, float]:
    """Read the network, the model and the sample time [s] from a file that `train_once` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, or of another agent.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no file {path}; `endotwin train --agent {agent}` writes one")
    try:
        contents = torch.load(path, weights_only=True)
        if contents["agent"] != agent:
            raise ValueError(f"it holds the agent {contents['agent']!r}")
        network = kind(contents["hidden"])
        network.load_state_dict(contents["weights"])
        return network, model_from_dict(contents["model"]), float(contents["sample_time"])
    except Exception as error:  # torch raises many classes for a file that it cannot read
        raise ValueError(f"{path} is no network written by `endotwin train --agent {agent}`") from error


def deviation(variance: ArrayLike) -> Array:
    """Return sqrt(R) [deg], the unit that a network sees angles in."""
    return np.sqrt(np.maximum(np.asarray(variance, dtype=float), LEAST_VARIANCE))


def chunks(samples: int, batch: int) -> Iterator[slice]:
    """Cut all samples but the first into stretches that a network can take at once for a batch of records."""
    length = max(CHUNK // batch, 1)
    for begin in range(1, samples, length):
        yield slice(begin, min(begin + length, samples))


def tensor32(values: ArrayLike) -> torch.Tensor:
    """Return values in the precision of the networks."""
    return torch.as_tensor(np.asarray(values, dtype=np.float32))
