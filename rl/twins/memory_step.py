"""One sample of RAM (memory) as a module of torch: the paper's active model and a policy that remembers.

It needs no twin of the endoscope online. With a model of Coleman and Hodgdon a prediction is
affine in the angle, theta_k = keep theta_{k-1} + drive + f T, where f is the model's error, a random walk
(eqs. 4-9). Keep and drive depend on the command alone and are computed outside.

The policy is a gated recurrent unit (Cho et al. 2014). It sees every innovation and its context, and has four
outputs: the total gain of eq. 10, the R by which P shrinks, the growth of P, and the mean b of the noise in
units of sqrt(R). As in RAM (twins), the *sum* of both gains is bounded to [0, 1], a policy that outputs zero
changes nothing, and b is subtracted only from the output.
"""

from typing import NamedTuple

import torch

from rl.policies import log_scale
from rl.twins.filter_bank import HISTORY
from rl.twins.filter_step import LEAST_VARIANCE, FilterStep, Output, last_layer, network

HIDDEN = 48
SEEN = 11  # numbers that the policy sees
OUTPUTS = 5  # on the gain, on R, on the growth of P, b, how sure b is
REACH = (5.0, 4.0, 4.0)  # of the first three, in logarithms
FIRST_DEG2 = (400.0, 1.0)  # variances before anything is measured: the first estimate is not trusted
GROWTH_DEG2_PER_MM, GROWTH_PER_S = 0.1, 0.01  # of the variances of theta; the latter of theta and of f
LARGEST_BIAS = 4.0  # of b in units of sqrt(R)

Tensor = torch.Tensor


class MemoryState(NamedTuple):
    """State of B filters."""

    mean: Tensor  # (B, 2) of theta + b [deg] and f [deg / s]
    covariance: Tensor  # (B, 3) of theta, of theta and f, of f
    hidden: Tensor  # (B, hidden) of the policy
    innovation: Tensor  # (B,) the last one in units of sqrt(R)
    samples: Tensor  # (B,) measured so far


class MemoryStep(FilterStep):
    """Active model, policy with a memory, and interval; see the module."""

    actions = len(REACH)

    def __init__(self, hidden: int = HIDDEN):
        super().__init__(hidden + SEEN)
        self.hidden = hidden
        self.reach = torch.nn.Buffer(torch.tensor(REACH))
        self.first = torch.nn.Buffer(torch.tensor([FIRST_DEG2[0], 0.0, FIRST_DEG2[1]]))
        self.input = torch.nn.Linear(SEEN, 3 * hidden)
        self.memory = torch.nn.Linear(hidden, 3 * hidden)
        self.output = network(hidden + SEEN, hidden, OUTPUTS, layers=1)
        with torch.no_grad():
            last_layer(self.output).weight.mul_(0.1)
            last_layer(self.output).bias.zero_()

    def start(self, zero_deviation: Tensor) -> MemoryState:
        """Return the state before anything is measured, see `FilterStep.start`."""
        batch = len(zero_deviation)
        return MemoryState(
            torch.zeros(batch, 2),
            self.first.expand(batch, 3),
            torch.zeros(batch, self.hidden),
            torch.zeros(batch),
            torch.zeros(batch),
        )

    def begun(self, state: MemoryState, zero_deviation: Tensor) -> MemoryState:
        """Return a state, or the first one where it is all zero."""
        begins = 1 - torch.sign(state.covariance.abs().sum(dim=1, keepdim=True))
        return state._replace(covariance=state.covariance + begins * self.first)

    def forward(
        self,
        keep: Tensor,  # (B,) what a step of the model keeps of the angle
        drive_deg: Tensor,  # (B,) what it adds [deg]
        increment_mm: Tensor,  # (B,) of the pull [mm]
        measurement_deg: Tensor,  # (B,) NaN where there is none [deg]
        variance: Tensor,  # (B,) R, as given [deg^2]
        zero_deviation: Tensor,  # (B,) of what is known of the sensor's zero, as given [deg]
        sample_time: Tensor,  # (B,) T [s]
        parts: Tensor,  # (2,) 1 or 0: whether the policy is on, and whether its output for b is used
        state: MemoryState,  # after the sample before
    ) -> tuple[Output, MemoryState]:
        """Return the estimates and the states one sample later."""
        policy_on, bias_on = parts.split(1)
        root, T = torch.sqrt(variance), sample_time
        theta, error = (of[:, 0] for of in state.mean.split(1, dim=1))
        p, cross, of_f = (of[:, 0] for of in state.covariance.split(1, dim=1))

        # Prediction (eqs. 6-8).
        predicted = keep * theta + drive_deg + error * T
        way = increment_mm.abs()
        doubt = keep * keep * p + 2 * keep * T * cross + T * T * of_f
        cross = keep * cross + T * of_f
        is_seen = ~torch.isnan(measurement_deg)
        seen = is_seen.to(predicted.dtype)
        innovation = torch.where(is_seen, measurement_deg, predicted) - predicted

        features = self._features(
            *(state, innovation.detach(), doubt.detach(), of_f.detach(), increment_mm, drive_deg),
            *(variance, zero_deviation, T),
        )
        hidden = self._remember(features, state.hidden)
        hidden = state.hidden + seen[:, None] * (hidden - state.hidden)
        known = torch.cat([hidden, features], dim=1)
        output = self.output(known)
        action, of_bias, of_doubt = output.split([len(REACH), 1, 1], dim=1)
        action = action * policy_on
        on_gain, on_noise, on_growth = (of[:, 0] for of in (torch.tanh(action) * self.reach).split(1, dim=1))
        bias = LARGEST_BIAS * torch.tanh(of_bias[:, 0] / LARGEST_BIAS)
        bias_variance = torch.exp(4 * torch.tanh(of_doubt[:, 0] / 2)) + 1e-4

        grows = torch.exp(on_growth)
        doubt = (doubt + (GROWTH_DEG2_PER_MM * way + GROWTH_PER_S * T) * grows).clamp(min=LEAST_VARIANCE)
        of_f = of_f + GROWTH_PER_S * T

        # Update (eqs. 8-10), along the direction of the filter's own gain.
        gain = torch.sigmoid(torch.log(doubt / variance) + on_gain)
        step = gain * innovation
        mean = torch.stack([predicted + step, error + cross / doubt * step], dim=1)
        shrink = seen / (doubt + variance * torch.exp(on_noise))
        covariance = torch.stack(
            [doubt - doubt * doubt * shrink, cross - cross * doubt * shrink, of_f - cross * cross * shrink],
            dim=1,
        )
        moved = innovation.detach() / root - state.innovation
        last = state.innovation + seen * moved
        after = MemoryState(mean, covariance, hidden, last, state.samples + seen)

        bend = predicted + step - bias_on * bias * root
        deviation = torch.sqrt(covariance[:, 0].clamp(min=LEAST_VARIANCE) + bias_variance * variance)
        half_width = deviation * self.widen(known)
        return Output(bend, half_width, bias, bias_variance, action, deviation, known), after

    def _remember(self, features: Tensor, hidden: Tensor) -> Tensor:
        of_input = self.input(features).split(self.hidden, dim=1)
        of_memory = self.memory(hidden).split(self.hidden, dim=1)
        reset = torch.sigmoid(of_input[0] + of_memory[0])
        update = torch.sigmoid(of_input[1] + of_memory[1])
        new = torch.tanh(of_input[2] + reset * of_memory[2])
        return new + update * (hidden - new)

    def _features(
        self,
        state: MemoryState,
        innovation: Tensor,
        doubt: Tensor,
        of_f: Tensor,
        increment_mm: Tensor,
        drive_deg: Tensor,
        variance: Tensor,
        zero_deviation: Tensor,
        sample_time: Tensor,
    ) -> Tensor:
        """Return (B, SEEN) what the policy sees."""
        root = torch.sqrt(variance)
        normal = innovation / root
        return torch.stack(
            [
                log_scale(normal),
                torch.tanh(innovation / torch.sqrt(doubt + variance)),
                torch.tanh(normal / 2) * torch.tanh(state.innovation / 2),
                log_scale(10 * increment_mm),
                log_scale(drive_deg),
                torch.log(doubt / variance + 1e-3) / 3,
                torch.log(of_f + 1e-3) / 3,
                torch.log(variance) / 3,
                torch.log(zero_deviation * zero_deviation / variance + 1e-2) / 3,
                torch.log(10 * sample_time),
                torch.log(state.samples.clamp(max=HISTORY) + 1) / 3,
            ],
            dim=1,
        )
