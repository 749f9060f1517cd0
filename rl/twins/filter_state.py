"""State of RAM (twins) from sample to sample, and what is known of a sample before its policy acts."""

from typing import NamedTuple

import torch

from rl.twins.bank import BankPrediction
from rl.twins.fallback import Verdict

Tensor = torch.Tensor

STATISTICS = 4


class FilterState(NamedTuple):
    """State of B filters.

    Attributes:
        mean: (B, r + 2) of c, d [deg] and b [deg], of the filter alone.
        covariance: (B, r + 2, r + 2) of it.
        counts: (B, BINS) histogram of its residuals.
        samples: (B,) measured so far.
        statistics: (B, STATISTICS) running means of the innovation, of its product with the one before and of
            its normalised square, and the last one.
        rows: (B, J, r + 1) of c and d, by law of the noise.
        rows_covariance: (B, r + 1, r + 1) of each of them.
        evidence: (B, J) logarithm of how likely each law made what was measured.
    """

    mean: Tensor
    covariance: Tensor
    counts: Tensor
    samples: Tensor
    statistics: Tensor
    rows: Tensor
    rows_covariance: Tensor
    evidence: Tensor


class Predicted(NamedTuple):
    """Prediction for a sample, and its innovation.

    Attributes:
        state: after the sample before.
        bank: as predicted, with what it believes of the noise.
        middle: (B,) mean angle of the members [deg].
        keep: (B, r + 1) what is left of c and d since the sample before.
        growth: what their variances grow by, (B, r + 1) of d, times what the policy says, and of c.
        measured: (B,) measurement about the middle [deg]; where there is none, what was expected.
        innovation: (B,) in units of sqrt(R).
        doubt: (B,) variance of the angle in units of R.
        seen: (B,) 1 where something was measured.
        variance: (B,) R [deg^2].
        sample_time: (B,) T [s].
        features: (B, J + SCALARS) what the policy sees.
        acts: how far it is listened to.
        hears: how far the recogniser is.
        verdict: of the fallback; None while the step learns, when nothing is strange.
    """

    state: FilterState
    bank: BankPrediction
    middle: Tensor
    keep: Tensor
    growth: tuple[Tensor, Tensor]
    measured: Tensor
    innovation: Tensor
    doubt: Tensor
    seen: Tensor
    variance: Tensor
    sample_time: Tensor
    features: Tensor
    acts: Tensor
    hears: Tensor
    verdict: Verdict | None
