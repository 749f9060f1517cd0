"""`python -m scripts.studies.learned_gains`: learned gains with their authors' sizes on a linear system.

Sizes, optimisers, batches and losses are those of the published code: KalmanNet with one gated recurrent
unit between two layers (architecture 1; Revach et al. 2022), and Recursive KalmanNet with a network for the
gain and one for the covariance (Mortada et al. 2025). Inputs and bounds of the gains are those of our rivals.
"""

import dataclasses
import datetime
import sys
import time
from collections.abc import Callable, Iterable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch

from rl.on_twins import RIVALS, Rival
from rl.supervised import tensor32
from rl.twins.filter_step import ALL, FilterStep
from rl.twins.learning import filter_sequences
from rl.twins.recurrent_step import SEEN, VALUES, LearnedGain, MemoryCell, RecursiveGain
from scripts.benchmarks.linear_system import (
    SAMPLES,
    SPEED,
    Bodies,
    LinearSource,
    decibels,
    first_rate,
    kalman_filter,
    learn_gains,
    learned_estimates,
    sequences_of,
)
from scripts.command import Options, Summary, run_verb
from scripts.studies.comparison_data import file_head
from scripts.studies.tables import DATA, ROOT, head_commit
from twin.files.atomic import write_whole
from twin.files.bounds import check_between
from twin.report.tables import csv_text

Tensor = torch.Tensor
WEIGHT_DECAY = 1e-4
BODIES, SEED = 2000, 5  # of the test
UPDATES_OF_OURS = 90
COLUMNS = (
    "method",
    "sizes",
    "training",
    "parameters",
    "normal noise [dB]",
    "two widths, variance known [dB]",
    "two widths, each known [dB]",
    "training [s]",
)
"""In decibels: the mean square error above that of a Kalman filter. The first is of the optimal one."""


@dataclasses.dataclass(frozen=True)
class LearnedGains(Options):
    """Train learned gains on the linear system, and write how near they come to the Kalman filter."""

    updates: int = 200
    """Gradient steps of each training with its authors' sizes."""
    out: Path = ROOT / DATA / "learned_gains_linear.csv"
    """File to write."""


class LayeredUnit(MemoryCell):
    """Gated recurrent unit between two fully connected layers, whose output is that of the network."""

    def __init__(self, encoder: int, units: int, readout: int, outputs: int):
        super().__init__()
        self.size, self.width = units, outputs
        self.encoder = torch.nn.Sequential(torch.nn.Linear(SEEN, encoder), torch.nn.ReLU())
        self.cell = torch.nn.GRUCell(encoder, units)
        last = torch.nn.Linear(readout, outputs)
        self.readout = torch.nn.Sequential(torch.nn.Linear(units, readout), torch.nn.ReLU(), last)
        with torch.no_grad():
            last.weight.mul_(0.1)
            last.bias.zero_()

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return the output and the memory."""
        memory = self.cell(self.encoder(seen), memory)
        return self.readout(memory), memory


class Parallel(MemoryCell):
    """Networks with the same inputs."""

    def __init__(self, networks: Iterable[LayeredUnit]):
        super().__init__()
        self.networks = torch.nn.ModuleList(networks)
        self.sizes = [network.size for network in networks]
        self.size, self.width = sum(self.sizes), sum(network.width for network in networks)

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return the outputs and the memories."""
        parts = zip(self.networks, memory.split(self.sizes, dim=1), strict=True)
        outputs, memories = zip(*(network(seen, of) for network, of in parts), strict=True)
        return torch.cat(outputs, dim=1), torch.cat(memories, dim=1)


class AdaBelief(torch.optim.Optimizer):
    """Adam on the square distance of a gradient from its running mean (Zhuang et al. 2020, algorithm 2)."""

    def __init__(self, parameters: Iterable[Tensor], lr: float, weight_decay: float):
        super().__init__(parameters, {"lr": lr, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self, closure: Any = None) -> Any:
        """Take a step."""
        for group in self.param_groups:
            for values in group["params"]:
                if values.grad is None:
                    continue
                kept = self.state[values]
                if not kept:
                    kept |= {"count": 0, "mean": torch.zeros_like(values), "square": torch.zeros_like(values)}
                kept["count"] += 1
                gradient = values.grad + group["weight_decay"] * values
                kept["mean"].lerp_(gradient, 0.1)
                kept["square"].lerp_((gradient - kept["mean"]) ** 2, 0.001).add_(1e-16)
                mean = kept["mean"] / (1 - 0.9 ** kept["count"])
                values.sub_(group["lr"] * mean / torch.sqrt(kept["square"] / (1 - 0.999 ** kept["count"])))


@dataclasses.dataclass(frozen=True)
class Published:
    """Learned gain as its authors train it."""

    step: type[LearnedGain]
    # of each network: units of the layer before the recurrent unit, its own, those after it, and outputs
    networks: tuple[tuple[int, int, int, int], ...]
    optimiser: type[torch.optim.Optimizer]
    rates: tuple[float, float]  # learning rate at the start and at the end
    sequences: int  # of an update, complete ones

    @property
    def described(self) -> tuple[str, str]:
        """Its sizes and its training in words."""
        networks = ("-".join(map(str, units)) for *units, _ in self.networks)
        first, last = self.rates
        rates = f"{first:g}" + (f" to {last:g}" if last != first else "")
        return "; ".join(networks), f"{self.optimiser.__name__} {rates}, batch {self.sequences}"

    def untrained(self) -> LearnedGain:
        """Return the step before its training."""
        step = self.step(lambda *_: Parallel([LayeredUnit(*sizes) for sizes in self.networks]), 0)
        step.output = torch.nn.Sequential()  # none: the first numbers are those of the networks
        return step

    def trained(self, source: LinearSource, updates: int, seed: int = 1) -> LearnedGain:
        """Return the step after a training on fresh runs of the system."""
        torch.manual_seed(seed)
        step, rng = self.untrained(), np.random.default_rng(seed)
        first, last = self.rates
        optimiser: Any = self.optimiser
        optimiser = optimiser(step.parameters(), lr=first, weight_decay=WEIGHT_DECAY)
        rates = torch.optim.lr_scheduler.ExponentialLR(optimiser, (last / first) ** (1 / updates))
        for _ in range(updates):
            optimiser.zero_grad()
            loss(step, source.run(self.sequences, SAMPLES, rng)).backward()
            optimiser.step()
            rates.step()
        return step


PUBLISHED = {
    "KalmanNet": Published(LearnedGain, ((240, 50, 8, 2),), torch.optim.Adam, (1e-3, 1e-3), 20),
    "Recursive KalmanNet": Published(
        RecursiveGain, ((60, 20, 400, 2), (60, 30, 600, 3)), AdaBelief, (5e-4, 5e-5), 64
    ),
}
"""By method; place and speed are two states, of which one is measured."""


def loss(step: LearnedGain, bodies: Bodies) -> Tensor:
    """Return the mean square error of both states, or twice their negative logarithm of likelihood."""
    states = torch.stack([of.values for _, of in filter_sequences(step, sequences_of(bodies), ALL)])
    theta, error, *_ = states.unbind(dim=2)
    place, speed = theta - tensor32(bodies.place), error - tensor32(bodies.speed - SPEED)
    if not step.by_likelihood:
        return (place**2 + speed**2).mean() / 2
    of_place, both, of_speed = states[..., VALUES:].unbind(dim=2)
    volume = of_place * of_speed - both**2
    distance = (of_speed * place**2 - 2 * both * place * speed + of_place * speed**2) / volume
    return (distance + torch.log(volume)).mean()


def above(step: FilterStep, bodies: Bodies, *knows_width: bool) -> list[float]:
    """Return how far the mean square error is above that of each Kalman filter [dB]."""
    mine = decibels(learned_estimates(step, bodies)[0], bodies.place)
    return [mine - decibels(kalman_filter(bodies, knows_width=of), bodies.place) for of in knows_width]


def row(name: str, described: tuple[str, str], train: Callable[[LinearSource], FilterStep]) -> dict[str, str]:
    """Return a row of the table: a method that is trained under each noise."""
    normal, two = LinearSource(), LinearSource(two_widths=True)
    on_normal, on_two = (source.run(BODIES, SAMPLES, np.random.default_rng(SEED)) for source in (normal, two))
    begun = time.process_time()
    step = train(normal)
    seconds = time.process_time() - begun
    parameters = sum(of.numel() for of in step.parameters())
    found = above(step, on_normal, False) + above(train(two), on_two, False, True)
    cells = name, *described, str(parameters), *(f"{of:.2f}" for of in found), f"{seconds:.0f}"
    return dict(zip(COLUMNS, cells, strict=True))


def ours(rival: Rival, source: LinearSource) -> FilterStep:
    """Return the step of a rival after a training with our size."""
    torch.manual_seed(1)
    step = rival.untrained()
    learn_gains(step, source, UPDATES_OF_OURS)
    return step


def learned_gains(args: LearnedGains) -> Summary:
    """Train every method under every noise, and write the table."""
    check_between("updates", args.updates, 1, 100_000)
    torch.set_num_threads(1)
    rows = []
    for name, published in PUBLISHED.items():
        rows.append(row(name, published.described, partial(published.trained, updates=args.updates)))
    for name in PUBLISHED:
        rival = RIVALS[f"{name} (twins)"]
        described = str(rival.width), f"Adam {first_rate(rival.untrained()):g} to 0, batch 128"
        rows.append(row(rival.spec.name, described, partial(ours, rival)))
    versions = {name: version(name) for name in ("endotwin", "numpy", "torch")}
    command = f"python -m scripts.studies.learned_gains --updates {args.updates}"
    head = file_head(head_commit(), command, datetime.date.today(), versions)
    write_whole(args.out, head + csv_text(rows))
    return Summary(f"wrote {args.out}", {"rows": rows})


main = partial(run_verb, LearnedGains, learned_gains)

if __name__ == "__main__":
    sys.exit(main())
