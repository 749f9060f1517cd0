"""Familiarity of the noise: whether counted residuals look like any noise that training has met.

Each law of the recogniser has a histogram of its own. What was counted is compared with the mixture of them
that the recogniser believes in, by the divergence of Kullback and Leibler (1951). Beyond what hardly any
sequence of the training reaches, neither the recogniser nor the policy knows what it speaks of: they fall
silent by degrees, and the filter goes on alone.
"""

import math
from collections.abc import Callable

import torch

from rl.twins.recogniser import BINS, LAWS

Tensor = torch.Tensor

UPDATES, RATE = 600, 0.05  # of the lesson, by Adam
FAMILIAR = 0.995  # share of the training's histograms that count as familiar
SILENT = 1.5  # times the limit, where nothing is heard any more
LEAST_COUNTS = 1.0  # of a histogram that says anything
_UNLIKELY = 1e-6  # probability of a bin at least
_GROUPS = 12  # of histograms of about the same counts, each of which has a limit


class Familiarity(torch.nn.Module):
    """Histograms of the laws, and the limit of the divergence by the number of counts.

    Attributes:
        histograms: (3, LAWS, BINS) logarithms of probabilities, as polynomials in the logarithm of R.
        level: of the limit, where very much is counted.
        slope: what the limit has more where less is counted, over 1 / counts.
    """

    def __init__(self) -> None:
        super().__init__()
        self.histograms = torch.nn.Buffer(torch.zeros(3, LAWS, BINS))
        self.level = torch.nn.Buffer(torch.tensor(1e9))  # before it has learned, all is familiar
        self.slope = torch.nn.Buffer(torch.tensor(0.0))

    def divergence(self, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
        """Return (B,) the divergence of what was counted from what is believed.

        Args:
            weights: (B, LAWS) of the laws.
            counts: (B, BINS).
            log_variance: (B,) logarithm of R.
        """
        return divergence(self.histograms, weights, counts, log_variance)

    def forward(self, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
        """Return (B,) how familiar the noise is, from 0 to 1; arguments as in `divergence`."""
        total = counts.sum(dim=-1).clamp(min=LEAST_COUNTS)
        limit = self.level + self.slope / total
        beyond = self.divergence(weights, counts, log_variance) / limit
        known: Tensor = ((SILENT - beyond) / (SILENT - 1)).clamp(min=0, max=1)
        return known


def divergence(histograms: Tensor, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
    """Return (B,) sum p log(p / q) of the counted shares p and the probabilities q of a mixture of laws."""
    level = (log_variance / 2)[:, None, None]
    constant, linear, square = histograms
    laws = torch.softmax(constant + level * linear + level * level * square, dim=-1)  # (B, LAWS, BINS)
    believed = torch.bmm(weights[:, None, :], laws)[:, 0, :]
    share = counts / counts.sum(dim=-1, keepdim=True).clamp(min=LEAST_COUNTS)
    return (share * torch.log((share + _UNLIKELY) / (believed + _UNLIKELY))).sum(dim=-1)


def learn_familiarity(
    familiarity: Familiarity,
    weights: Tensor,
    counts: Tensor,
    log_variance: Tensor,
    draw: Callable[[int], Tensor],
) -> None:
    """Learn the histograms by maximum likelihood, and the limit as a quantile of the divergence.

    Args:
        familiarity: changed in place.
        weights: (S, LAWS) that were believed in the training.
        counts: (S, BINS) of the same.
        log_variance: (S,) of the same.
        draw: returns so many places of the S.
    """
    learned = familiarity.histograms.clone().requires_grad_()
    optimiser = torch.optim.Adam([learned], lr=RATE)
    for update in range(UPDATES):
        optimiser.param_groups[0]["lr"] = RATE * (1 + math.cos(math.pi * update / UPDATES)) / 2
        rows = draw(512)
        loss = divergence(learned, weights[rows], counts[rows], log_variance[rows]).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    familiarity.histograms.copy_(learned.detach())
    with torch.no_grad():
        found = torch.cat(
            [
                familiarity.divergence(*part)
                for part in zip(*(of.split(4096) for of in (weights, counts, log_variance)), strict=True)
            ]
        )
    total = counts.sum(dim=-1).clamp(min=LEAST_COUNTS)
    groups = [rows for rows in torch.argsort(total).tensor_split(_GROUPS) if len(rows)]
    reached = torch.stack([torch.quantile(found[rows], FAMILIAR) for rows in groups])
    inverse = torch.stack([(1 / total[rows]).mean() for rows in groups])
    slope = ((inverse - inverse.mean()) * (reached - reached.mean())).sum()
    slope = (slope / ((inverse - inverse.mean()) ** 2).sum().clamp(min=1e-12)).clamp(min=0)
    level = (reached - slope * inverse).max()  # above the limits of all groups
    familiarity.level.copy_(level.clamp(min=1e-3))
    familiarity.slope.copy_(slope)
