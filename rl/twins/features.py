"""Observation of the policy of RAM (twins): the noise as recognised, and the filter in units of its own."""

import torch

from rl.twins.bank import HISTORY, NoiseBelief
from rl.twins.filter_state import FilterState
from rl.twins.filter_step import log_scale
from rl.twins.motion import MemberMotion
from rl.twins.products import along

Tensor = torch.Tensor

SCALARS = 16  # that the policy sees beside the probabilities of the laws
RECENT = 30.0  # samples of the running statistics


class Features(torch.nn.Module):
    """Observation of the policy, in units that are told here alone."""

    def __init__(self, motion: MemberMotion) -> None:
        super().__init__()
        self.motion = motion
        self.angle_units = torch.nn.Buffer(torch.tensor([1.0, 1.0, 1.0, 5.0]))
        self.log_units = torch.nn.Buffer(torch.tensor([1 / 3, 1 / 3, 1.0, 0.2, 1 / 3, 0.5]))

    def forward(
        self,
        state: FilterState,
        belief: NoiseBelief,
        mean: Tensor,
        doubt: Tensor,
        of_error: Tensor,
        innovation: Tensor,
        way_mm: Tensor,
        variance: Tensor,
        sample_time: Tensor,
    ) -> Tensor:
        """Return (B, J + SCALARS) what the policy sees; gradients pass by the belief in the laws alone.

        Args:
            state: after the sample before.
            belief: in the laws of the noise.
            mean: (B, n) of c and d, as predicted.
            doubt: (B,) variance of the prediction [deg^2].
            of_error: (B,) that of d [deg^2].
            innovation: (B,) [deg].
            way_mm: (B,) since the last sample [mm].
            variance: (B,) R [deg^2].
            sample_time: (B,) T [s].
        """
        root = torch.sqrt(variance)
        average, product, square, _ = state.statistics.split(1, dim=1)
        coefficients = mean * self.motion.of_members
        angles = [
            innovation / root,
            innovation / torch.sqrt(doubt + variance),
            along(mean, self.motion.of_error) / root,
            way_mm,
        ]
        positive = [
            doubt / variance,
            of_error + 1e-3,
            square[:, 0] + 1,
            state.samples.clamp(max=HISTORY) + 1,
            variance,
            10 * sample_time,
        ]
        return torch.cat(
            [
                belief.weights,
                belief.bias[:, None],
                torch.log(belief.bias_variance)[:, None] / 3,
                log_scale(torch.stack(angles, dim=1) * self.angle_units),
                torch.log(torch.stack(positive, dim=1)) * self.log_units,
                torch.tanh(innovation / root / 2)[:, None],
                (coefficients * coefficients).sum(dim=1, keepdim=True) / self.motion.of_members.sum(),
                average,
                product,
            ],
            dim=1,
        )


def recent(state: FilterState, seen: Tensor, innovation: Tensor, doubt: Tensor) -> Tensor:
    """Return the running statistics with one more innovation, in units of sqrt(R)."""
    average, product, square, last = (of[:, 0] for of in state.statistics.split(1, dim=1))
    now = log_scale(innovation)
    weight = seen / (state.samples + 1).clamp(max=RECENT)
    return torch.stack(
        [
            average + (now - average) * weight,
            product + (now * log_scale(last) - product) * weight,
            square + (innovation * innovation / (doubt + 1) - square) * weight,
            last + (innovation - last) * seen,
        ],
        dim=1,
    )
