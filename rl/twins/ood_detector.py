"""Detector of noise that is in no training, from a histogram of residuals, and a robust filter for it."""

import math
from collections.abc import Callable
from typing import NamedTuple

import torch

from rl.twins.filter_step import along

Tensor = torch.Tensor

BINS = 56
LARGEST_RESIDUAL = 3.9  # of the histogram's scale asinh(4 r): 6 sqrt(R)


class ResidualHistogram(torch.nn.Module):
    """Bins of residuals, narrow about zero and wide where residuals are few."""

    def __init__(self) -> None:
        super().__init__()
        self.centres = torch.nn.Buffer(torch.linspace(-LARGEST_RESIDUAL, LARGEST_RESIDUAL, BINS))

    def forward(self, residual: Tensor, doubt: Tensor) -> Tensor:
        """Return (..., BINS) the counts of residuals (...); the variance of the prediction is in units of R.

        A residual, in units of sqrt(R), is shared by the two nearest bins; one that is in doubt counts less.
        """
        place = _arsinh(4 * residual).clamp(-LARGEST_RESIDUAL, LARGEST_RESIDUAL)
        between = 2 * LARGEST_RESIDUAL / (BINS - 1)
        share = (1 - (place[..., None] - self.centres).abs() / between).clamp(min=0)
        return share / (1 + doubt)[..., None]


def _arsinh(values: Tensor) -> Tensor:
    """Return arsinh of values by its logarithm: ONNX Runtime has none of double precision."""
    size = values.abs()
    return torch.sign(values) * torch.log(size + torch.sqrt(size * size + 1))


LEVELS = (-1.8, 1.3, 12)  # of log sqrt(R): from, to, and how many; between them histograms are interpolated
UPDATES, BATCH, RATE = 500, 128, 0.1  # of the lesson, by Adam
FAMILIAR = 0.995  # share of the training's histograms that count as familiar
SILENT = 1.5  # times the limit, where the classifier is disabled
LEAST_COUNTS = 1.0  # of a histogram that is used
_UNLIKELY = 1e-6  # probability of a bin at least
_GROUPS = 12  # of histograms of about the same counts, each of which has a limit


class Histograms(NamedTuple):
    """Histograms of residuals, and the beliefs with them."""

    weights: Tensor  # (S, J) of the noise_models
    counts: Tensor  # (S, BINS)
    log_variance: Tensor  # (S,) logarithm of R


class OodDetector(torch.nn.Module):
    """Histograms of the noise models, and the limit of the divergence by noise model and number of counts."""

    def __init__(self, noise_models: int):
        super().__init__()
        begin, end, count = LEVELS
        self.centres = torch.nn.Buffer(torch.linspace(begin, end, count))
        self.histograms = torch.nn.Buffer(torch.zeros(noise_models, count, BINS))  # logarithms
        self.level = torch.nn.Buffer(torch.full((noise_models,), 1e9))  # where very much is counted
        self.slope = torch.nn.Buffer(torch.tensor(0.0))  # what the limit has more, over 1 / counts

    def divergence(self, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
        """Return (B,) the divergence sum p log(p / q) of counts (B, BINS) from a belief (B, J)."""
        return self._from(self.histograms, weights, counts, log_variance)

    def _from(self, histograms: Tensor, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
        begin, end, count = LEVELS
        between = (end - begin) / (count - 1)
        place = (log_variance / 2).clamp(min=begin, max=end)[:, None]
        near = (1 - (place - self.centres).abs() / between).clamp(min=0)  # (B, levels)
        # By noise model, and the batch within: ONNX Runtime is slow at many products of a row each. In single
        # precision, in which it is five times faster at exponentials: a verdict needs no more.
        noise_models = torch.softmax(near.float()[None] @ histograms.float(), dim=-1)  # (J, B, BINS)
        believed = (weights.float().T[:, :, None] * noise_models).sum(dim=0).to(counts.dtype)
        share = counts / counts.sum(dim=-1, keepdim=True).clamp(min=LEAST_COUNTS)
        return (share * torch.log((share + _UNLIKELY) / (believed + _UNLIKELY))).sum(dim=-1)

    def forward(self, weights: Tensor, counts: Tensor, log_variance: Tensor) -> Tensor:
        """Return (B,) how familiar the noise is, from 0 to 1; arguments as in `divergence`."""
        limit = along(weights, self.level) + self.slope / counts.sum(dim=-1).clamp(min=LEAST_COUNTS)
        beyond = self.divergence(weights, counts, log_variance) / limit
        known: Tensor = ((SILENT - beyond) / (SILENT - 1)).clamp(min=0, max=1)
        return known

    def learn(self, seen: Histograms, held_out: Histograms, draw: Callable[[int], Tensor]) -> None:
        """Learn the histograms by maximum likelihood, and the limits as quantiles of the divergence."""
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
        groups = [rows for rows in torch.argsort(total).tensor_split(_GROUPS) if len(rows)]
        middle = torch.stack([found[rows].median() for rows in groups])
        inverse = torch.stack([(1 / total[rows]).mean() for rows in groups])
        off = inverse - inverse.mean()
        slope = ((off * (middle - middle.mean())).sum() / (off**2).sum().clamp(min=1e-12)).clamp(min=0)
        self.slope.copy_(slope)
        left = found - slope / total
        common = torch.quantile(left, FAMILIAR)
        for noise_model in range(len(self.level)):
            mine = weights[:, noise_model] > 0.5
            level = torch.quantile(left[mine], FAMILIAR) if mine.sum() >= 100 else common
            self.level[noise_model] = level.clamp(min=1e-3)


BOUND = 1.5  # standard deviations of an innovation that count in full
BEFORE = 10.0  # counts by which half of the observed share of tails is used
NORMAL_LOG = -(math.log(2) + 0.5772156649) / 2  # mean of log |x| under a normal distribution of variance 1
HEAVY = 0.8  # ratio of variances below which tails are heavy: what is above is chance


class Verdict(NamedTuple):
    """Reliance on the fallback, and its view of the noise; all (B,)."""

    strange: Tensor  # from 0, the noise is like that of the training, to 1
    narrower: Tensor  # what R is multiplied by

    def bound(self, innovation: Tensor, variance: Tensor) -> Tensor:
        """Return (B,) the share of an innovation [deg] that counts, by its variance [deg^2]."""
        largest = BOUND * torch.sqrt(variance)
        return 1 - self.strange + self.strange * largest / torch.maximum(innovation.abs(), largest)


class Fallback(torch.nn.Module):
    """Tails of a noise by its histogram; nothing in it is learned."""

    def __init__(self) -> None:
        super().__init__()
        centres = torch.linspace(-LARGEST_RESIDUAL, LARGEST_RESIDUAL, BINS)
        residual = torch.sinh(centres) / 4
        within = float(centres[1] - centres[0]) / 4  # spread of what a middle bin counts
        self.least = within**2 / 4  # [R]: narrower parts are not resolved
        self.square = torch.nn.Buffer(residual**2)
        self.logarithm = torch.nn.Buffer(torch.log(residual**2 + self.least) / 2)

    def narrower(self, counts: Tensor) -> Tensor:
        """Return (B,) what R is multiplied by: less than 1 where tails are heavy, by the width of the middle.

        Counts (B, BINS) are a histogram of residuals in units of sqrt(R).
        """
        total = counts.sum(dim=-1)
        some = total.clamp(min=LEAST_COUNTS)
        logarithm = along(counts, self.logarithm) / some
        ratio = torch.exp(2 * (logarithm - NORMAL_LOG)) / (along(counts, self.square) / some + self.least)
        share: Tensor = (1 + total / (total + BEFORE) * (ratio - 1)) / HEAVY
        return share.clamp(min=0, max=1)

    def forward(self, strange: Tensor, counts: Tensor) -> Verdict:
        """Return the verdict on noise of counts (B, BINS), which is strange (B,) from 0 to 1."""
        narrower = 1 - strange * (1 - self.narrower(counts))
        return Verdict(strange, narrower)
