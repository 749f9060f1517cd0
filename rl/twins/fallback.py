"""Fallback under noise that no training has met: a robust filter, which needs nothing learned.

Counted residuals tell two things of any noise. Their width in the middle against their root mean square tells
how heavy the tails are: with tails, the filter takes the narrower variance, and no innovation moves it by
more than one of `BOUND` standard deviations would (Huber 1964). Where as many are on one side as on the
other, at every distance, the noise is symmetric, and its mean is taken for zero: nothing else tells it from
the angle.
"""

import math
from typing import NamedTuple

import torch

from rl.twins.familiarity import LEAST_COUNTS
from rl.twins.histogram import BINS, LARGEST_RESIDUAL
from rl.twins.products import along

Tensor = torch.Tensor

BOUND = 1.5  # standard deviations of an innovation that count in full
BEFORE = 10.0  # counts by which half of what is seen of tails is believed
NORMAL_LOG = -(math.log(2) + 0.5772156649) / 2  # mean of log |x| under a normal law of variance 1
HEAVY = 0.8  # ratio of variances below which tails are heavy: what is above is chance
DISTANCES = (0.5, 1.0, 1.5, 2.0, 3.0)  # in units of sqrt(R), beyond which sides are compared
EVEN, ODD = 1.5, 2.5  # standard deviations between the sides: symmetric up to, not symmetric from
ENOUGH = 150.0  # counts that symmetry needs; with half of them nothing is said


class Verdict(NamedTuple):
    """Reliance on the fallback, and its view of the noise; all (B,).

    Attributes:
        strange: from 0, the noise is like that of the training, to 1.
        narrower: what R is multiplied by.
        even: how sure it is that the mean of the noise is zero: one over its variance in units of R.
    """

    strange: Tensor
    narrower: Tensor
    even: Tensor

    def bound(self, innovation: Tensor, variance: Tensor) -> Tensor:
        """Return (B,) the share of an innovation [deg] that counts, by its variance [deg^2]."""
        largest = BOUND * torch.sqrt(variance)
        return 1 - self.strange + self.strange * largest / torch.maximum(innovation.abs(), largest)


class Fallback(torch.nn.Module):
    """Tails and symmetry of a noise by its histogram; nothing in it is learned."""

    def __init__(self) -> None:
        super().__init__()
        centres = torch.linspace(-LARGEST_RESIDUAL, LARGEST_RESIDUAL, BINS)
        residual = torch.sinh(centres) / 4
        within = float(centres[1] - centres[0]) / 4  # spread of what a middle bin counts
        self.least = within**2 / 4  # [R]: what is narrower is not told apart
        self.square = torch.nn.Buffer(residual**2)
        self.logarithm = torch.nn.Buffer(torch.log(residual**2 + self.least) / 2)
        beyond = torch.stack([(residual.abs() > distance).float() for distance in DISTANCES], dim=1)
        self.beyond = torch.nn.Buffer(beyond)
        self.side = torch.nn.Buffer(beyond * torch.sign(residual)[:, None])

    def narrower(self, counts: Tensor) -> Tensor:
        """Return (B,) what R is multiplied by: less than 1 where tails are heavy, by the width of the middle.

        Args:
            counts: (B, BINS) histogram of residuals in units of sqrt(R).
        """
        total = counts.sum(dim=-1)
        some = total.clamp(min=LEAST_COUNTS)
        logarithm = along(counts, self.logarithm) / some
        ratio = torch.exp(2 * (logarithm - NORMAL_LOG)) / (along(counts, self.square) / some + self.least)
        share: Tensor = (1 + total / (total + BEFORE) * (ratio - 1)) / HEAVY
        return share.clamp(min=0, max=1)

    def symmetry(self, counts: Tensor) -> Tensor:
        """Return (B,) how surely the noise is symmetric, from 0 to 1."""
        off = (counts @ self.side).abs() / torch.sqrt(counts @ self.beyond + 1)
        uneven = ((off - EVEN) / (ODD - EVEN)).clamp(min=0, max=1).sum(dim=-1)
        counted = 2 * counts.sum(dim=-1) / ENOUGH - 1
        return (1 - uneven).clamp(min=0, max=1) * counted.clamp(min=0, max=1)

    def forward(self, strange: Tensor, counts: Tensor) -> Verdict:
        """Return what a filter does under noise that is so strange.

        Args:
            strange: (B,) from 0 to 1.
            counts: as in `narrower`.
        """
        narrower = 1 - strange * (1 - self.narrower(counts))
        return Verdict(strange, narrower, strange * self.symmetry(counts) * counts.sum(dim=-1))
