"""State of RAM (twins) from sample to sample, and what is known of a sample before its policy acts."""

from typing import NamedTuple

import torch

from rl.twins.fallback import Verdict

Tensor = torch.Tensor

STATISTICS = 4


class FilterState(NamedTuple):
    """State of B filters.

    Attributes:
        mean: (B, r + 2) of c, d [deg] and b [deg].
        covariance: (B, r + 2, r + 2).
        counts: (B, BINS) histogram of residuals.
        samples: (B,) measured so far.
        statistics: (B, STATISTICS) running means of the innovation, of its product with the one before and of
            its normalised square, and the last one.
        weights: (B, LAWS) of the laws of the noise, as recognised.
        bias: (B,) mean of the noise in units of sqrt(R), as recognised.
        bias_variance: (B,) how sure that is, in units of R.
    """

    mean: Tensor
    covariance: Tensor
    counts: Tensor
    samples: Tensor
    statistics: Tensor
    weights: Tensor
    bias: Tensor
    bias_variance: Tensor


class Predicted(NamedTuple):
    """Prediction for a sample, and its innovation.

    Attributes:
        state: after the sample before.
        mean: (B, r + 2) of the state, as predicted.
        covariance: (B, r + 2, r + 2) before it grows.
        towards: (B, r + 2) P h, before P grows.
        middle: (B,) mean angle of the members [deg].
        angle: (B, r + 2) of theta on the state.
        predicted: (B,) measurement [deg].
        innovation: (B,) 0 where nothing was measured [deg].
        seen: (B,) 1 where something was.
        variance: (B,) R [deg^2].
        growth: of P along d, along the members and along b, each (B, r + 2), times what the policy says.
        features: (B, LAWS + SCALARS) what the policy sees.
        acts: how far it is listened to.
        hears: how far the recogniser is.
        verdict: of the fallback; None while the step learns, when nothing is strange.
    """

    state: FilterState
    mean: Tensor
    covariance: Tensor
    towards: Tensor
    middle: Tensor
    angle: Tensor
    predicted: Tensor
    innovation: Tensor
    seen: Tensor
    variance: Tensor
    growth: tuple[Tensor, Tensor, Tensor]
    features: Tensor
    acts: Tensor
    hears: Tensor
    verdict: Verdict | None
