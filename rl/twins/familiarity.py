"""Familiarity of the noise: whether counted residuals look like any noise that training has met.

Each law of the recogniser has a histogram of its own, which changes with R. What was counted is compared with
the mixture of them that the recogniser believes in, by the divergence of Kullback and Leibler (1951). Beyond
what hardly any sequence of the training reaches under such laws, neither the recogniser nor the policy knows
what it speaks of: they fall silent by degrees, and the fallback takes over.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import torch

from rl.twins.histogram import BINS
from rl.twins.products import along

Tensor = torch.Tensor

LEVELS = (-1.8, 1.3, 12)  # of log sqrt(R): from, to, and how many; between them histograms are interpolated
UPDATES, BATCH, RATE = 500, 128, 0.1  # of the lesson, by Adam
FAMILIAR = 0.995  # share of the training's histograms that count as familiar
SILENT = 1.5  # times the limit, where nothing is heard any more
LEAST_COUNTS = 1.0  # of a histogram that says anything
_UNLIKELY = 1e-6  # probability of a bin at least
_GROUPS = 12  # of histograms of about the same counts, each of which has a limit


class Histograms(NamedTuple):
    """Histograms of residuals, and what was believed of them.

    Attributes:
        weights: (S, J) of the laws.
        counts: (S, BINS).
        log_variance: (S,) logarithm of R.
    """

    weights: Tensor
    counts: Tensor
    log_variance: Tensor


class Familiarity(torch.nn.Module):
    """Histograms of the laws, and the limit of the divergence by law and number of counts.

    Attributes:
        histograms: (J, levels, BINS) logarithms of probabilities.
        level: (J,) of the limit, where very much is counted.
        slope: what the limit has more where less is counted, over 1 / counts.
    """

    def __init__(self, laws: int):
        """Start before anything is learned, when all is familiar.

        Args:
            laws: J.
        """
        super().__init__()
        begin, end, count = LEVELS
        self.centres = torch.nn.Buffer(torch.linspace(begin, end, count))
        self.histograms = torch.nn.Buffer(torch.zeros(laws, count, BINS))
        self.level = torch.nn.Buffer(torch.full((laws,), 1e9))
        self.slope = torch.nn.Buffer(torch.tensor(0.0))

    def divergence(self, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
        """Return (B,) the divergence sum p log(p / q) of what was counted from what is believed.

        Args:
            weights: (B, J) of the laws.
            counts: (B, BINS).
            log_variance: (B,) logarithm of R.
        """
        return self._from(self.histograms, weights, counts, log_variance)

    def _from(self, histograms: Tensor, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
        begin, end, count = LEVELS
        between = (end - begin) / (count - 1)
        place = (log_variance / 2).clamp(min=begin, max=end)[:, None]
        near = (1 - (place - self.centres).abs() / between).clamp(min=0)  # (B, levels)
        # By law, and the batch within: ONNX Runtime is slow at many products of a row each. In single
        # precision, in which it is five times faster at exponentials: a verdict needs no more.
        laws = torch.softmax(near.float()[None] @ histograms.float(), dim=-1)  # (J, B, BINS)
        believed = (weights.float().T[:, :, None] * laws).sum(dim=0).to(counts.dtype)
        share = counts / counts.sum(dim=-1, keepdim=True).clamp(min=LEAST_COUNTS)
        return (share * torch.log((share + _UNLIKELY) / (believed + _UNLIKELY))).sum(dim=-1)

    def forward(self, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
        """Return (B,) how familiar the noise is, from 0 to 1; arguments as in `divergence`."""
        limit = along(weights, self.level) + self.slope / counts.sum(dim=-1).clamp(min=LEAST_COUNTS)
        beyond = self.divergence(weights, counts, log_variance) / limit
        known: Tensor = ((SILENT - beyond) / (SILENT - 1)).clamp(min=0, max=1)
        return known

    def learn(self, seen: Histograms, held_out: Histograms, draw: Callable[[int], Tensor]) -> None:
        """Learn the histograms by maximum likelihood, and the limits as quantiles of the divergence.

        Args:
            seen: S histograms to learn from.
            held_out: histograms of other sequences, that the limits are taken from: what was learned from few
                sequences fits others less well, and so has wider limits.
            draw: returns so many places of the S.
        """
        learned = self.histograms.clone().requires_grad_()
        optimiser = torch.optim.Adam([learned], lr=RATE)
        for update in range(UPDATES):
            optimiser.param_groups[0]["lr"] = RATE * (1 + math.cos(math.pi * update / UPDATES)) / 2
            rows = draw(BATCH)
            loss = self._from(learned, *(of[rows] for of in seen)).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
        with torch.no_grad():
            self.histograms.copy_(learned)
            parts = zip(*(of.split(4096) for of in held_out), strict=True)
            found = torch.cat([self.divergence(*part) for part in parts])
            self._limit(held_out.weights, found, held_out.counts.sum(dim=-1).clamp(min=LEAST_COUNTS))

    def _limit(self, weights: Tensor, found: Tensor, total: Tensor) -> None:
        """Set the limits by the (S,) divergences that were found, of so many counts."""
        groups = [rows for rows in torch.argsort(total).tensor_split(_GROUPS) if len(rows)]
        middle = torch.stack([found[rows].median() for rows in groups])
        inverse = torch.stack([(1 / total[rows]).mean() for rows in groups])
        off = inverse - inverse.mean()
        slope = ((off * (middle - middle.mean())).sum() / (off**2).sum().clamp(min=1e-12)).clamp(min=0)
        self.slope.copy_(slope)
        left = found - slope / total
        common = torch.quantile(left, FAMILIAR)
        for law in range(len(self.level)):
            mine = weights[:, law] > 0.5
            level = torch.quantile(left[mine], FAMILIAR) if mine.sum() >= 100 else common
            self.level[law] = level.clamp(min=1e-3)
