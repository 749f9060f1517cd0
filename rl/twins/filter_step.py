"""One sample of a filter that learns: base of the steps, their result and the width of their interval."""

from typing import Any, ClassVar, NamedTuple

import torch

from rl.twins.networks import last_layer, network
from twin.estimation.gaussian import DEVIATIONS_OF_95

LEAST_VARIANCE = 1e-8  # [deg^2]
ALL, NOTHING = torch.tensor([1.0, 1.0]), torch.tensor([0.0, 0.0])
"""Parts of a step that act, 1 or 0: the policy, and what is said of the noise."""

Tensor = torch.Tensor


class Output(NamedTuple):
    """Result of one sample.

    Attributes:
        bend_deg: (B,) estimate [deg].
        half_width_deg: (B,) half of its 95 % interval [deg].
        bias: (B,) mean of the noise in units of sqrt(R), as recognised.
        bias_variance: (B,) how sure that is, in units of R.
        action: (B, actions) before they are bounded: on the total gain, on R for the covariance, on growth.
        deviation_deg: (B,) standard deviation of the estimate as the filter has it [deg].
        seen: (B, n) what the interval is made of.
    """

    bend_deg: Tensor
    half_width_deg: Tensor
    bias: Tensor
    bias_variance: Tensor
    action: Tensor
    deviation_deg: Tensor
    seen: Tensor


class FilterStep(torch.nn.Module):
    """One sample of a filter that learns: called with what it predicts by, a measurement and a state.

    Attributes:
        slow: names of parameters that learn in smaller steps than the others.
        by_likelihood: whether it learns by the likelihood of its errors under its own variance, instead of by
            the balanced square errors (`rl/twins/balance.py`).
        actions: of the policy.
        seen: numbers that the interval, and a policy from outside, are made of.
    """

    slow: ClassVar[tuple[str, ...]] = ()
    by_likelihood: ClassVar[bool] = False
    actions: ClassVar[int]

    def __init__(self, seen: int):
        """Start with the interval of a normal law.

        Args:
            seen: numbers that the interval is made of.
        """
        super().__init__()
        self.seen = seen
        self.interval = network(seen, 16, 1, layers=1)
        with torch.no_grad():
            last_layer(self.interval).weight.zero_()
            last_layer(self.interval).bias.zero_()

    def start(self, variance: Tensor) -> Any:
        """Return the state, a named tuple, before anything is measured, for (B,) variances R [deg^2]."""
        raise NotImplementedError

    def widen(self, seen: Tensor) -> Tensor:
        """Return (...) how many standard deviations half of a 95 % interval has."""
        return DEVIATIONS_OF_95 * torch.exp(2 * torch.tanh(self.interval(seen)[..., 0]))


def log_scale(values: Tensor) -> Tensor:
    """Return values on a symmetric logarithmic scale."""
    return torch.sign(values) * torch.log1p(values.abs())
