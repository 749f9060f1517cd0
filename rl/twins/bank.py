"""A bank of filters, one for each law that the noise may have: the recogniser of RAM (twins).

Every filter believes in its own law and has its own mean of c and d; all share one covariance, that under
the laws that are believed in. A filter is weighed by how likely its law made all innovations (Bayes; Magill
1965), so that shape and mean of the noise are told together with what the twins can do. Where the noise
changes, what was seen is forgotten.
"""

import math
from typing import NamedTuple

import torch

from rl.twins.filter_step import LEAST_VARIANCE
from rl.twins.laws import Laws, NoiseLaws, normed
from rl.twins.motion import MemberMotion

Tensor = torch.Tensor

HISTORY = 400.0  # samples after which what was seen of the noise is forgotten
CAUTION = 0.2  # added to R where P shrinks, as training begins, in units of R: no law is certain
WITHIN = 0.01  # variance of the mean of a noise about that of its law, in units of R


class BankState(NamedTuple):
    """State of B banks of J filters.

    Attributes:
        rows: (B, J, n) of c and d [deg], by law.
        covariance: (B, n, n) of each of them.
        evidence: (B, J) logarithm of how likely each law made what was measured.
    """

    rows: Tensor
    covariance: Tensor
    evidence: Tensor


class NoiseBelief(NamedTuple):
    """Belief in the laws of the noise.

    Attributes:
        laws: at the R that is told.
        weights: (B, J) probabilities.
        bias: (B,) mean of the noise in units of sqrt(R).
        bias_variance: (B,) how sure that is, in units of R.
    """

    laws: NoiseLaws
    weights: Tensor
    bias: Tensor
    bias_variance: Tensor


class BankPrediction(NamedTuple):
    """State of the bank, as predicted for a sample.

    Attributes:
        belief: in the laws, before the sample.
        evidence: (B, J) for them.
        angle: (B, n) of theta on c and d.
        rows: (B, J, n).
        covariance: (B, n, n) before it grows.
        offset: (B, J) angle of each filter about the mean of the members [deg].
        towards: (B, n) P a, before P grows.
    """

    belief: NoiseBelief
    evidence: Tensor
    angle: Tensor
    rows: Tensor
    covariance: Tensor
    offset: Tensor
    towards: Tensor


class BankEstimate(NamedTuple):
    """Estimate of the bank.

    Attributes:
        offset: (B,) angle about the mean of the members [deg].
        variance: (B,) of it [deg^2].
        belief: in the laws, after the sample.
    """

    offset: Tensor
    variance: Tensor
    belief: NoiseBelief


class Bank(torch.nn.Module):
    """Filters of twins, one for each law."""

    def __init__(self, motion: MemberMotion, laws: int):
        """Start with untrained laws.

        Args:
            motion: of c and d.
            laws: J.
        """
        super().__init__()
        self.motion = motion
        self.laws = Laws(laws)
        self.sharpness = torch.nn.Parameter(torch.zeros(()))  # logarithm of what one sample counts
        self.caution = torch.nn.Parameter(torch.tensor(math.log(CAUTION)))

    def start(self, variance: Tensor) -> BankState:
        """Return the state before anything is measured, for (B,) variances R [deg^2]."""
        batch, laws, size = len(variance), self.laws.count, len(self.motion.of_error)
        return BankState(
            torch.zeros(batch, laws, size),
            self.motion.first_covariance(variance),
            torch.zeros(batch, laws),
        )

    def believe(self, evidence: Tensor, variance: Tensor) -> NoiseBelief:
        """Return the belief in the laws by what was seen (B, J), for (B,) variances R [deg^2]."""
        return _believe(self.laws(variance), evidence)

    def predict(self, state: BankState, angle: Tensor, keep: Tensor, variance: Tensor) -> BankPrediction:
        """Return the state as predicted.

        Args:
            state: after the sample before.
            angle: (B, n) of theta on c and d.
            keep: (B, n) what is left of them.
            variance: (B,) R [deg^2].
        """
        belief = self.believe(state.evidence, variance)
        rows = state.rows * keep[:, None, :]
        covariance = state.covariance * (keep[:, :, None] * keep[:, None, :])
        towards = torch.bmm(covariance, angle[:, :, None])[:, :, 0]
        offset = (rows * angle[:, None, :]).sum(dim=-1)
        return BankPrediction(belief, state.evidence, angle, rows, covariance, offset, towards)

    def update(
        self,
        prior: BankPrediction,
        grows: Tensor,
        measured: Tensor,
        seen: Tensor,
        variance: Tensor,
        on_gain: Tensor,
        on_noise: Tensor,
    ) -> tuple[BankEstimate, BankState]:
        """Return the estimate and the state after a sample.

        Args:
            prior: from `predict`.
            grows: (B, n) what the variances of c and d grow by.
            measured: (B,) measurement about the mean of the members [deg].
            seen: (B,) 1 where there is one.
            variance: (B,) R [deg^2].
            on_gain: (B,) what the policy adds to the logit of every gain.
            on_noise: (B,) logarithm of what it multiplies R by, as P shrinks.
        """
        angle, laws, root = prior.angle, prior.belief.laws, torch.sqrt(variance)
        covariance = prior.covariance + grows[:, :, None] * self.motion.unit
        towards = prior.towards + grows * angle
        doubt = (angle * towards).sum(dim=1).clamp(min=LEAST_VARIANCE)
        relative = doubt / variance

        innovation = (measured[:, None] - prior.offset) / root[:, None]
        residual = innovation[:, :, None] - laws.place  # from each part
        share, log_law = normed(laws.log_parts(residual, relative))
        logit = torch.log(relative[:, None, None] / laws.width)  # of K_AM
        gain = torch.sigmoid(logit + on_gain[:, None, None])
        step = (gain * residual * share).sum(dim=-1) * (root * seen / doubt)[:, None]
        rows = prior.rows + step[:, :, None] * towards[:, None, :]

        counts_as = (seen * torch.exp(self.sharpness))[:, None]
        evidence = prior.evidence * (1 - seen / HISTORY)[:, None] + counts_as * log_law
        after = _believe(laws, evidence)
        believed = (after.weights * laws.effective).sum(dim=-1)
        effective = (believed + torch.exp(self.caution)) * torch.exp(on_noise)
        shrink = (seen / (doubt + variance * effective))[:, None]
        covariance = torch.baddbmm(covariance, towards[:, :, None], (towards * shrink)[:, None, :], alpha=-1)

        offsets = (rows * angle[:, None, :]).sum(dim=-1)
        offset = (after.weights * offsets).sum(dim=-1)
        between = (after.weights * (offsets - offset[:, None]) ** 2).sum(dim=-1)
        own = doubt * (1 - doubt * shrink[:, 0])
        return BankEstimate(offset, own + between, after), BankState(rows, covariance, evidence)


def _believe(laws: NoiseLaws, evidence: Tensor) -> NoiseBelief:
    weights = torch.softmax(laws.log_prior + evidence, dim=-1)
    bias = (weights * laws.mean).sum(dim=-1)
    variance = (weights * (laws.mean - bias[:, None]) ** 2).sum(dim=-1)
    return NoiseBelief(laws, weights, bias, variance + WITHIN)
