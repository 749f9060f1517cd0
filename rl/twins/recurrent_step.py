"""One sample of a network or a learned gain beside a model: the rivals of RAM (twins) as modules of torch.

All predict by the model of Coleman and Hodgdon, theta_k|k-1 = keep theta_{k-1} + drive + f T, see the same
numbers and remember by one cell. They differ in what is said:

- `Correction`: what is to be added to the prediction, in units of sqrt(R). A network that filters.
- `LearnedGain`: the gains of theta and of f on the innovation (KalmanNet, Revach et al. 2022). It may say the
  mean of the noise too, which is taken away at the output.
- `RecursiveGain`: the gains, and what the variance of the prediction grows by. The variance goes on by
  Joseph's form; gains and variance are learned by likelihood (Recursive KalmanNet, Mortada et al. 2025).

A state of zeros has seen nothing: the first measurement is then the first prediction.
"""

from collections.abc import Callable
from typing import NamedTuple

import torch

from rl.twins.bank import HISTORY
from rl.twins.cells import MemoryCell
from rl.twins.filter_step import LEAST_VARIANCE, FilterStep, Output, log_scale
from rl.twins.networks import last_layer, network

SEEN = 11  # numbers that a network sees
VALUES = 7  # numbers of a filter that are no memory of its network
FIRST_SPREAD = 0.3
"""Standard deviation that an interval starts from where none is computed, in units of sqrt(R)."""
LARGEST_BIAS = 4.0  # of the mean of the noise in units of sqrt(R)

Tensor = torch.Tensor


class RecurrentState(NamedTuple):
    """State of B filters.

    Attributes:
        values: (B, VALUES) theta [deg], f [deg / s], last measurement [deg], latest correction of theta [deg]
            and of f [deg / s], last innovation in units of sqrt(R), variance of theta in units of R.
        hidden: (B, size) memory of the cell.
        samples: (B,) measured so far.
    """

    values: Tensor
    hidden: Tensor
    samples: Tensor


class Sample(NamedTuple):
    """Sample as it is before the network is heard.

    Attributes:
        innovation: (B,) [deg].
        spread: (B,) variance of theta before it, in units of R.
        keep: (B,) what a step of the model keeps of the angle.
        root: (B,) sqrt(R) [deg].
        seen: (B,) 1 where something was measured.
    """

    innovation: Tensor
    spread: Tensor
    keep: Tensor
    root: Tensor
    seen: Tensor


class Update(NamedTuple):
    """Changes of a state by one sample.

    Attributes:
        bend_deg: (B,) what is added to theta [deg].
        error: (B,) what is added to f [deg / s].
        spread: (B,) variance of theta after it, in units of R.
        bias: (B,) mean of the noise, in units of sqrt(R).
        bias_variance: (B,) how sure that is, in units of R.
    """

    bend_deg: Tensor
    error: Tensor
    spread: Tensor
    bias: Tensor
    bias_variance: Tensor


class RecurrentStep(FilterStep):
    """Prediction, cell and correction; see the module."""

    actions = 0
    said: int
    """Numbers that the network says."""
    unsure = 1.0
    """Variance that is stated of the mean of the noise, in units of R, beside what is said of it."""

    def __init__(self, cell: Callable[[int, int], MemoryCell], width: int):
        """Start untrained, and almost silent, with a cell made of what it sees and its width."""
        made = cell(SEEN, width)
        super().__init__(made.width + SEEN)
        self.cell = made
        self.output = network(made.width + SEEN, 48, self.said, layers=1)
        with torch.no_grad():
            last_layer(self.output).weight.mul_(0.1)
            last_layer(self.output).bias.zero_()

    def start(self, variance: Tensor) -> RecurrentState:
        """Return the state before anything is measured, for (B,) variances R of the noise [deg^2]."""
        batch = len(variance)
        zeros = torch.zeros(batch, VALUES), torch.zeros(batch, self.cell.size), torch.zeros(batch)
        return RecurrentState(*zeros)

    def forward(
        self,
        keep: Tensor,
        drive_deg: Tensor,
        increment_mm: Tensor,
        measurement_deg: Tensor,
        variance: Tensor,
        sample_time: Tensor,
        parts: Tensor,
        state: RecurrentState,
    ) -> tuple[Output, RecurrentState]:
        """Return the estimates and the states one sample later; arguments as of `MemoryStep`.

        Of `parts`, the first is whether the network is heard, the second if its mean of the noise is.
        """
        acts, hears = parts.split(1)
        root, T = torch.sqrt(variance), sample_time
        theta, error, last, of_theta, of_error, before, spread = (
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
                torch.log(10 * T),
                torch.log(state.samples.clamp(max=HISTORY) + 1) / 3,
            ],
            dim=1,
        ).detach()
        told, hidden = self.cell(features, state.hidden)
        hidden = state.hidden + seen[:, None] * (hidden - state.hidden)
        known = torch.cat([told, features], dim=1)
        heard = self.output(known) * acts
        at = Sample(innovation, begun * spread + (1 - begun), keep, root, seen)
        update = self._update(heard, at)

        bend = predicted + seen * update.bend_deg
        changed = error + seen * update.error
        values = [bend, changed, measured, seen * update.bend_deg, seen * update.error]
        after = torch.stack([*values, before + seen * (normal.detach() - before), update.spread], dim=1)
        deviation = root * torch.sqrt(update.spread.clamp(min=LEAST_VARIANCE) + update.bias_variance)
        half_width = deviation * self.widen(known)
        output = Output(
            bend - hears * update.bias * root,
            half_width,
            update.bias,
            update.bias_variance + self.unsure,
            bend.new_zeros(len(bend), 0),
            deviation,
            known,
        )
        return output, RecurrentState(after, hidden, state.samples + seen)

    def _update(self, said: Tensor, at: Sample) -> Update:
        """Return what (B, said) numbers of the network mean at a sample."""
        raise NotImplementedError


class Correction(RecurrentStep):
    """Network that says what is to be added to the prediction."""

    said = 1

    def _update(self, said: Tensor, at: Sample) -> Update:
        none = 0 * at.innovation
        return Update(at.root * said[:, 0], none, none + FIRST_SPREAD**2, none, none)


class LearnedGain(RecurrentStep):
    """Gains of theta, in [0, 1], and of f, in [0, 2] per second; small ones where nothing is said."""

    said = 2

    def _update(self, said: Tensor, at: Sample) -> Update:
        none = 0 * at.innovation
        of_theta, of_error = _gain_of_theta(said), 2 * torch.sigmoid(said[:, 1] - 4)
        return Update(of_theta * at.innovation, of_error * at.innovation, none + FIRST_SPREAD**2, none, none)


class LearnedGainAndBias(LearnedGain):
    """Gains, and the mean of the noise with how sure it is."""

    said, unsure = 4, 1e-4

    def _update(self, said: Tensor, at: Sample) -> Update:
        bias = LARGEST_BIAS * torch.tanh(said[:, 2] / LARGEST_BIAS)
        doubt = torch.exp(4 * torch.tanh(said[:, 3] / 2))
        return super()._update(said, at)._replace(bias=bias, bias_variance=doubt)


class RecursiveGain(LearnedGain):
    """Gains, and a variance that goes on from sample to sample."""

    by_likelihood = True
    said = 3

    def _update(self, said: Tensor, at: Sample) -> Update:
        gain = _gain_of_theta(said)
        grown = at.keep * at.keep * at.spread + torch.exp(6 * torch.tanh((said[:, 2] - 4) / 6))
        updated = (1 - gain) ** 2 * grown + gain**2
        return super()._update(said, at)._replace(spread=grown + at.seen * (updated - grown))


def _gain_of_theta(said: Tensor) -> Tensor:
    """Return the gain of theta, in [0, 1]."""
    return torch.sigmoid(said[:, 0] - 2)
