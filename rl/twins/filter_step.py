"""One sample of a filter that learns: base of the steps, their result and the width of their interval."""

from typing import Any, ClassVar, NamedTuple

import torch

from twin.estimation.gaussian import DEVIATIONS_OF_95
from twin.estimation.member_motion import (
    FIRST_ERROR_DEG2,
    GROWTH_DEG2_PER_MM,
    GROWTH_DEG2_PER_S,
    MEMBERS_PER_MM,
    MEMORY_MM,
    ZERO_PER_S,
)


def network(inputs: int, hidden: int, outputs: int, layers: int = 2) -> torch.nn.Sequential:
    """Return a network of equal layers with hyperbolic tangents; without layers, it is linear."""
    parts: list[torch.nn.Module] = []
    for _ in range(layers):
        parts += [torch.nn.Linear(inputs, hidden), torch.nn.Tanh()]
        inputs = hidden
    return torch.nn.Sequential(*parts, torch.nn.Linear(inputs, outputs))


def last_layer(layers: torch.nn.Sequential) -> torch.nn.Linear:
    """Return the last layer of a network."""
    layer = layers[-1]
    assert isinstance(layer, torch.nn.Linear)
    return layer


Tensor = torch.Tensor


def along(values: Tensor, vector: Tensor) -> Tensor:
    """Return the (...) products of values (..., n) with a vector (n,).

    A sum of products, and no product of matrices: at one with a single column ONNX Runtime is eight times
    slower.
    """
    return (values * vector).sum(dim=-1)


LEAST_VARIANCE = 1e-8  # [deg^2]
ALL = torch.tensor([1.0, 1.0])  # parts of a step that are on, 1 or 0: the policy, and its mean of the noise


class Output(NamedTuple):
    """Result of one sample."""

    bend_deg: Tensor  # (B,) estimate [deg]
    half_width_deg: Tensor  # (B,) half of its 95 % interval [deg]
    bias: Tensor  # (B,) sensor's zero in units of sqrt(R)
    bias_variance: Tensor  # (B,) how sure that is, in units of R
    action: Tensor  # (B, actions) before bounds: on the total gain, on R for the covariance, on growth
    deviation_deg: Tensor  # (B,) standard deviation of the estimate as the filter has it [deg]
    seen: Tensor  # (B, n) what the interval is made of


class FilterStep(torch.nn.Module):
    """One sample of a filter that learns: called with what it predicts by, a measurement and a state."""

    # whether it learns by the likelihood of its errors under its own variance, or by balanced square errors
    by_likelihood: ClassVar[bool] = False
    actions: ClassVar[int]  # of the policy

    def __init__(self, seen: int):
        super().__init__()
        self.seen = seen  # numbers that the interval is made of
        self.interval = network(seen, 16, 1, layers=1)
        with torch.no_grad():
            last_layer(self.interval).weight.zero_()
            last_layer(self.interval).bias.zero_()

    def start(self, zero_deviation: Tensor) -> Any:
        """Return the state, a named tuple, before anything is measured.

        Deviations (B,) are those of what is known of the sensor's zero [deg].
        """
        raise NotImplementedError

    def begun(self, state: Any, zero_deviation: Tensor) -> Any:
        """Return a state, or the first one where it is all zero; see `start`."""
        return state

    def widen(self, seen: Tensor) -> Tensor:
        """Return (...) half of a 95 % interval, in standard deviations."""
        return DEVIATIONS_OF_95 * torch.exp(2 * torch.tanh(self.interval(seen)[..., 0]))


NO_ERROR = 1e-6  # share of the variances of d where there is to be none; zero would mark a first sample


class MemberMotion(torch.nn.Module):
    """Decay and growth of the r coefficients c, of d and of the sensor's zero b, in this order: n = r + 2."""

    def __init__(self, rank: int, *, with_error: bool = True):
        super().__init__()
        # Parts of the state are picked by constant vectors: the exported graph needs no slices then.
        units = torch.eye(rank + 2)
        self.unit = torch.nn.Buffer(units)
        self.of_error, self.of_zero = torch.nn.Buffer(units[rank]), torch.nn.Buffer(units[rank + 1])
        self.of_members = torch.nn.Buffer(units[:rank].sum(dim=0))
        self.share_of_error = torch.nn.Buffer(torch.tensor(1.0 if with_error else NO_ERROR))

    def first_covariance(self, zero_deviation: Tensor) -> Tensor:
        """Return (B, n, n) before anything is measured, for (B,) deviations of what is known of b [deg]."""
        first: Tensor = self.of_members + FIRST_ERROR_DEG2 * self.share_of_error * self.of_error
        of_zero = (zero_deviation * zero_deviation)[:, None] * self.of_zero
        return (first + of_zero)[:, :, None] * self.unit

    def keep(self, way_mm: Tensor) -> Tensor:
        """Return (B, n) the shares of the numbers that remain after a travel (B,) [mm]."""
        return 1 - (1 - torch.exp(-way_mm / MEMORY_MM))[:, None] * self.of_error

    def growth(self, way_mm: Tensor, zero_deviation: Tensor, sample_time: Tensor) -> Tensor:
        """Return (B, n) the growth of the variances."""
        of_error = (GROWTH_DEG2_PER_MM * way_mm + GROWTH_DEG2_PER_S * sample_time) * self.share_of_error
        of_zero = ZERO_PER_S * sample_time * zero_deviation * zero_deviation
        of_members = MEMBERS_PER_MM * way_mm[:, None] * self.of_members
        return of_error[:, None] * self.of_error + of_members + of_zero[:, None] * self.of_zero
