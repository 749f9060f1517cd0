"""Laws of the noise: what the recogniser chooses among, each with a density and a mean of its own.

A law is a mixture of normal laws in units of sqrt(R). Convolved with a normal belief of the angle it is one
again, so that how likely it made an innovation, and where the angle is then, are known in closed form
(Sorenson and Alspach 1971). Places, widths and weights change with R: a part of each is in units of sqrt(R),
another in degrees, as the counts of a Poisson law are whole degrees whatever its R.
"""

import math
from typing import NamedTuple

import torch

from rl.twins.networks import network

Tensor = torch.Tensor

PARTS = 10  # K, normal laws of a mixture
_IN_DEGREES = 4  # of them, begin as counts: at 0, 1, 2 and 3 deg
_R = (0.05, 24.0)  # of the noises of the training [deg^2]; beyond, laws are those of the end
NARROWEST_DEG2 = 0.01  # of a part: no model of the angle is good enough for the lattice of counts to be sharp


class NoiseLaws(NamedTuple):
    """J laws of K parts at B values of R, in units of sqrt(R) and of R.

    Attributes:
        place: (B, J, K) mean of each part.
        log_weight: (B, J, K) logarithm of how likely each is.
        width: (B, J, K) variance of each.
        mean: (B, J) of each law.
        effective: (B, J) variance of the normal law that tells as much of the angle.
        log_prior: (B, J) logarithm of how likely each law is before anything is measured.
    """

    place: Tensor
    log_weight: Tensor
    width: Tensor
    mean: Tensor
    effective: Tensor
    log_prior: Tensor

    def log_parts(self, residual: Tensor, doubt: Tensor) -> Tensor:
        """Return (B, J, K) log-densities of a residual, by part; the common 2 pi is left out.

        Args:
            residual: (B, J, K) from each part, in units of sqrt(R).
            doubt: (B,) variance of the belief of the angle in units of R.
        """
        return log_density(self.log_weight, residual, self.width + doubt[:, None, None])


class Laws(torch.nn.Module):
    """Parameters of the laws."""

    def __init__(self, count: int):
        """Start with parts of all widths at places that cover them.

        Args:
            count: J.
        """
        super().__init__()
        of_deviation = PARTS - _IN_DEGREES
        places, weights, widths = torch.zeros(2, PARTS), torch.zeros(3, PARTS), torch.zeros(2, PARTS)
        places[0, :of_deviation] = torch.linspace(-1.5, 2.0, of_deviation)
        places[1, of_deviation:] = torch.arange(float(_IN_DEGREES))
        weights[0, of_deviation:] = -2.0
        widths[0, :of_deviation], widths[0, of_deviation:] = math.log(0.5), math.log(0.1)
        widths[1] = math.log(0.1)
        scattered = places[:, None] + 0.02 * torch.randn(2, count, PARTS)
        self.places = torch.nn.Parameter(scattered)
        self.weights = torch.nn.Parameter(weights[:, None].repeat(1, count, 1))
        self.widths = torch.nn.Parameter(widths[:, None].repeat(1, count, 1))
        self.effective = torch.nn.Parameter(torch.zeros(3, count))
        self.prior = network(1, 16, count, layers=1)

    @property
    def count(self) -> int:
        """J, number of laws."""
        return self.effective.shape[1]

    def forward(self, variance: Tensor) -> NoiseLaws:
        """Return the laws at (B,) values of R [deg^2]."""
        variance = variance.clamp(*_R)
        level = torch.log(variance)[:, None, None]
        size = variance[:, None, None]
        one, by_level, by_size = self.weights
        score = one + level * by_level + size / 4 * by_size
        weight, total = normed(score)
        place = self.places[0] + torch.exp(-level / 2) * self.places[1]
        in_degrees = torch.exp(2 * self.widths[1]) + NARROWEST_DEG2
        width = torch.exp(2 * self.widths[0]) + in_degrees / size
        one, by_level, by_size = self.effective
        effective = torch.exp((one + level[:, 0] * by_level + size[:, 0] / 4 * by_size).clamp(-4, 1))
        prior = self.prior(level[:, 0] / 3)
        return NoiseLaws(
            place,
            score - total[..., None],
            width,
            (weight * place).sum(dim=-1),
            effective,
            prior - normed(prior)[1][..., None],
        )


def log_density(log_weight: Tensor, residual: Tensor, variance: Tensor) -> Tensor:
    """Return the log-density of normal laws of some weight, at residuals from them, but for the 2 pi."""
    return log_weight - 0.5 * (residual * residual / variance + torch.log(variance))


def normed(logarithms: Tensor) -> tuple[Tensor, Tensor]:
    """Return the shares of values by their logarithms, and the logarithm of their sum, over the last axis.

    By hand: it takes one exponential of each, and ONNX Runtime has no such sum in double precision.
    """
    top = logarithms.amax(dim=-1, keepdim=True).detach()
    values = torch.exp(logarithms - top)
    total = values.sum(dim=-1, keepdim=True)
    return values / total, (top + torch.log(total))[..., 0]
