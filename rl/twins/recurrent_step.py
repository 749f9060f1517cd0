"""One sample of a network or a learned gain on a model: the rivals of RAM (twins) as modules of torch.

All predict by the model of Coleman and Hodgdon, theta_k|k-1 = keep theta_{k-1} + drive + f T, have the same
inputs and one memory cell. They differ in their output:

- `Correction`: the correction of the prediction, in units of sqrt(R). A network that filters.
- `LearnedGain`: the gains of theta and of f on the innovation (KalmanNet, Revach et al. 2022). It may output
  the mean of the noise too, which is subtracted.
- `RecursiveGain`: the gains, and what a sample adds to the covariance of theta and f. The covariance follows
  Joseph's form; gains and covariance are learned by likelihood (Recursive KalmanNet, Mortada et al. 2025).

A state of zeros has seen nothing: the first measurement is then the first prediction.
"""

from collections.abc import Callable
from typing import NamedTuple

import torch

from rl.policies import log_scale
from rl.twins.filter_bank import HISTORY
from rl.twins.filter_step import LEAST_VARIANCE, FilterStep, Output, last_layer, network

Tensor = torch.Tensor


class MemoryCell(torch.nn.Module):
    """A step of a memory."""

    size: int  # numbers that are remembered
    width: int  # numbers of the output

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return (B, width) the output for (B, n) numbers, and the (B, size) memory after them."""
        raise NotImplementedError


class GatedUnit(MemoryCell):
    """Gated recurrent unit (Cho et al. 2014)."""

    def __init__(self, inputs: int, width: int):
        super().__init__()
        self.size = self.width = width
        self.cell = torch.nn.GRUCell(inputs, width)

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return the output and the memory."""
        memory = self.cell(seen, memory)
        return memory, memory


class LongShortTerm(MemoryCell):
    """Long short-term memory (Hochreiter and Schmidhuber 1997)."""

    def __init__(self, inputs: int, width: int):
        super().__init__()
        self.size, self.width = 2 * width, width
        self.cell = torch.nn.LSTMCell(inputs, width)

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return the output and the memory."""
        hidden, cell = self.cell(seen, memory.split(self.width, dim=1))
        return hidden, torch.cat([hidden, cell], dim=1)


class StateSpace(MemoryCell):
    """Selective diagonal state space (after Mamba, Gu and Dao 2023): step, input and output by what is seen.

    Each of W channels u has N states with decay rates a > 0: h <- exp(-dt a) h + dt b u, with output c . h +
    d u.
    """

    def __init__(self, inputs: int, width: int, states: int = 8):
        super().__init__()
        self.size, self.width, self.states = width * states, width, states
        self.channels = torch.nn.Linear(inputs, width)
        self.gate = torch.nn.Linear(inputs, width)
        self.step = torch.nn.Linear(width, width)
        self.into = torch.nn.Linear(width, states)
        self.out = torch.nn.Linear(width, states)
        self.log_rate = torch.nn.Parameter(torch.log(torch.arange(1.0, states + 1)).repeat(width))
        self.skip = torch.nn.Parameter(torch.ones(width))
        # States are flat, channel by channel: files of ours have no operator that reshapes.
        self.of_channel = torch.nn.Buffer(torch.eye(width).repeat_interleave(states, dim=1))
        self.of_state = torch.nn.Buffer(torch.eye(states).repeat(1, width))
        with torch.no_grad():
            self.step.bias.uniform_(-6.0, -1.0)  # memories from a sample to some hundred

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return the output and the memory."""
        raw, gate = self.channels(seen), self.gate(seen)
        channel = raw * torch.sigmoid(raw)
        step = torch.sigmoid(self.step(channel))
        into, out = self.into(channel) @ self.of_state, self.out(channel) @ self.of_state
        decay = torch.exp(-(step @ self.of_channel) * torch.exp(self.log_rate))
        states = decay * memory + ((step * channel) @ self.of_channel) * into
        output = (states * out) @ self.of_channel.T + self.skip * channel
        return output * gate * torch.sigmoid(gate), states


class Convolution(MemoryCell):
    """Causal temporal convolution (Bai et al. 2018): layers of two taps, each twice as far apart as before.

    The memory holds the inputs of each layer that are still needed, the oldest first.
    """

    def __init__(self, inputs: int, width: int, layers: int = 6):
        super().__init__()
        self.width = width
        self.apart = [2**layer for layer in range(layers)]
        self.size = width * sum(self.apart)
        self.before = torch.nn.Linear(inputs, width)
        self.now = torch.nn.ModuleList(torch.nn.Linear(width, width) for _ in range(layers))
        self.then = torch.nn.ModuleList(torch.nn.Linear(width, width, bias=False) for _ in range(layers))

    def forward(self, seen: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Return the output and the memory."""
        output, kept = torch.tanh(self.before(seen)), []
        sizes = [size for apart in self.apart for size in (self.width, self.width * (apart - 1)) if size]
        parts = iter(memory.split(sizes, dim=1))
        for now, then, apart in zip(self.now, self.then, self.apart, strict=True):
            oldest = next(parts)
            kept += [next(parts), output] if apart > 1 else [output]
            output = output + torch.tanh(now(output) + then(oldest))
        return output, torch.cat(kept, dim=1)


SEEN = 12  # numbers that a network sees
VALUES = 6  # numbers of a filter that are neither a memory of its network nor a covariance
FIRST_SPREAD = 0.3
"""Standard deviation that an interval starts from where none is computed, in units of sqrt(R)."""
LARGEST_BIAS = 4.0  # of the mean of the noise in units of sqrt(R)


class RecurrentState(NamedTuple):
    """State of B filters."""

    # (B, VALUES + covariances) theta [deg], f [deg / s], last measurement [deg], latest correction of theta
    # [deg] and of f [deg / s], last innovation in units of sqrt(R), covariance as in `Sample`
    values: Tensor
    hidden: Tensor  # (B, size) memory of the cell
    samples: Tensor  # (B,) measured so far


class Sample(NamedTuple):
    """Sample as it is before the network's update."""

    innovation: Tensor  # (B,) [deg]
    # (B,) each in units of R: variance of theta before it; where it is propagated, covariance of theta and f
    # [1 / s] and variance of f [1 / s^2]
    covariance: tuple[Tensor, ...]
    keep: Tensor  # (B,) what a step of the model keeps of the angle
    root: Tensor  # (B,) sqrt(R) [deg]
    T: Tensor  # (B,) sample time [s]
    seen: Tensor  # (B,) 1 where something was measured


class Update(NamedTuple):
    """Changes of a state by one sample."""

    bend_deg: Tensor  # (B,) what is added to theta [deg]
    error: Tensor  # (B,) what is added to f [deg / s]
    covariance: tuple[Tensor, ...]  # as in `Sample`, after it
    bias: Tensor  # (B,) mean of the noise, in units of sqrt(R)
    bias_variance: Tensor  # (B,) how sure that is, in units of R


class RecurrentStep(FilterStep):
    """Prediction, cell and correction; see the module."""

    actions = 0
    outputs: int
    """Numbers of the network's output."""
    covariances = 1
    """Numbers of the covariance."""
    unsure = 1.0
    """Variance that is stated of the mean of the noise, in units of R, in addition to the output."""

    def __init__(self, cell: Callable[[int, int], MemoryCell], width: int):
        made = cell(SEEN, width)
        super().__init__(made.width + SEEN)
        self.cell = made
        self.output = network(made.width + SEEN, 48, self.outputs, layers=1)
        with torch.no_grad():
            last_layer(self.output).weight.mul_(0.1)
            last_layer(self.output).bias.zero_()

    def start(self, zero_deviation: Tensor) -> RecurrentState:
        """Return the state before anything is measured, see `FilterStep.start`."""
        batch = len(zero_deviation)
        values = torch.zeros(batch, VALUES + self.covariances)
        return RecurrentState(values, torch.zeros(batch, self.cell.size), torch.zeros(batch))

    def forward(
        self,
        keep: Tensor,
        drive_deg: Tensor,
        increment_mm: Tensor,
        measurement_deg: Tensor,
        variance: Tensor,
        zero_deviation: Tensor,
        sample_time: Tensor,
        parts: Tensor,
        state: RecurrentState,
    ) -> tuple[Output, RecurrentState]:
        """Return the estimates and the states one sample later; arguments as in `MemoryStep`.

        Of `parts`, the first is whether the network is on, the second whether its mean of the noise is used.
        """
        network_on, bias_on = parts.split(1)
        root, T = torch.sqrt(variance), sample_time
        theta, error, last, of_theta, of_error, before, spread, *others = (
            of[:, 0] for of in state.values.split(1, dim=1)
        )
        is_seen = ~torch.isnan(measurement_deg)
        seen = is_seen.to(keep.dtype)
        begun = torch.sign(state.samples)

        predicted = keep * theta + drive_deg + error * T
        measured = torch.where(is_seen, measurement_deg, predicted)
        predicted = begun * predicted + (1 - begun) * measured
        innovation = measured - predicted
        normal = innovation / root
        surprise = begun * (measured - keep * last - drive_deg) / root
        moved = ((error - of_error) * T + of_theta) / root
        features = torch.stack(
            [
                log_scale(normal),
                torch.tanh(normal),
                torch.tanh(normal / 2) * torch.tanh(before / 2),
                log_scale(surprise),
                log_scale(moved),
                log_scale(of_theta / root),
                log_scale(10 * increment_mm),
                log_scale(drive_deg),
                torch.log(variance) / 3,
                torch.log(zero_deviation * zero_deviation / variance + 1e-2) / 3,
                torch.log(10 * T),
                torch.log(state.samples.clamp(max=HISTORY) + 1) / 3,
            ],
            dim=1,
        ).detach()
        output, hidden = self.cell(features, state.hidden)
        hidden = state.hidden + seen[:, None] * (hidden - state.hidden)
        known = torch.cat([output, features], dim=1)
        output = self.output(known) * network_on
        at = Sample(innovation, (begun * spread + (1 - begun), *others), keep, root, T, seen)
        update = self._update(output, at)

        bend = predicted + seen * update.bend_deg
        changed = error + seen * update.error
        values = [bend, changed, measured, seen * update.bend_deg, seen * update.error]
        values += [before + seen * (normal.detach() - before), *update.covariance]
        spread = update.covariance[0]
        deviation = root * torch.sqrt(spread.clamp(min=LEAST_VARIANCE) + update.bias_variance)
        half_width = deviation * self.widen(known)
        output = Output(
            bend - bias_on * update.bias * root,
            half_width,
            update.bias,
            update.bias_variance + self.unsure,
            bend.new_zeros(len(bend), 0),
            deviation,
            known,
        )
        return output, RecurrentState(torch.stack(values, dim=1), hidden, state.samples + seen)

    def _update(self, output: Tensor, at: Sample) -> Update:
        """Return the update of a sample by (B, outputs) numbers of the network."""
        raise NotImplementedError


class Correction(RecurrentStep):
    """Network that outputs a correction of the prediction."""

    outputs = 1

    def _update(self, output: Tensor, at: Sample) -> Update:
        none = 0 * at.innovation
        return Update(at.root * output[:, 0], none, (none + FIRST_SPREAD**2,), none, none)


class LearnedGain(RecurrentStep):
    """Gains of theta, in [0, 1], and of f, in [0, 2] per second; small ones at a zero output."""

    outputs = 2

    def _update(self, output: Tensor, at: Sample) -> Update:
        none = 0 * at.innovation
        of_theta, of_error = (gain * at.innovation for gain in _gains(output))
        return Update(of_theta, of_error, (none + FIRST_SPREAD**2,), none, none)


class LearnedGainAndBias(LearnedGain):
    """Gains, and the mean of the noise with how sure it is."""

    outputs, unsure = 4, 1e-4

    def _update(self, output: Tensor, at: Sample) -> Update:
        bias = LARGEST_BIAS * torch.tanh(output[:, 2] / LARGEST_BIAS)
        doubt = torch.exp(4 * torch.tanh(output[:, 3] / 2))
        return super()._update(output, at)._replace(bias=bias, bias_variance=doubt)


class RecursiveGain(LearnedGain):
    """Gains K, and a covariance P = (I - K H) F P F' (I - K H)' + L L', with a triangular L from the network.

    Nothing ties L L' to K R K': P would be R at a gain of 1, whatever the errors. The first L is sqrt(R),
    since the likelihood of a smaller one is so steep that the gain saturates.
    """

    by_likelihood = True
    outputs, covariances = 5, 3

    def _update(self, output: Tensor, at: Sample) -> Update:
        of_theta, of_error = (at.seen * gain for gain in _gains(output))
        theta, both, error = at.covariance
        theta = at.keep * (at.keep * theta + 2 * at.T * both) + at.T * at.T * error
        both = at.keep * both + at.T * error
        error = error + of_error * (of_error * theta - 2 * both)
        both = (1 - of_theta) * (both - of_error * theta)
        theta = (1 - of_theta) ** 2 * theta
        first, last = (torch.exp(6 * torch.tanh(of / 6)) for of in (output[:, 2], output[:, 4] - 3))
        mixed = output[:, 3]
        covariance = theta + first * first, both + first * mixed, error + mixed * mixed + last * last
        return super()._update(output, at)._replace(covariance=covariance)


def _gains(output: Tensor) -> tuple[Tensor, Tensor]:
    """Return the gain of theta, in [0, 1], and that of f, in [0, 2] per second."""
    return torch.sigmoid(output[:, 0] - 2), 2 * torch.sigmoid(output[:, 1] - 4)
