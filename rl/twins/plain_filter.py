"""The filter alone: the paper's active model on twins, told R and nothing else of the noise.

Its state is X = [c, d, b], where b is the mean of the noise, and its update that of Kalman. It learns
nothing, and so it is what is left where the noise is like none of the training; then it is a robust filter
(`rl/twins/fallback.py`).
"""

from typing import NamedTuple

import torch

from rl.twins.fallback import Verdict
from rl.twins.filter_step import LEAST_VARIANCE
from rl.twins.motion import MemberMotion
from rl.twins.products import along

Tensor = torch.Tensor

FIRST_BIAS = 0.85  # variance of b in units of R before anything is measured
BIAS_PER_S = 3e-4  # growth of the variance of b in units of R: a sensor may change in an hour


class PlainEstimate(NamedTuple):
    """Estimate of the filter alone; all (B,).

    Attributes:
        offset: angle about the mean of the members [deg].
        variance: of it [deg^2].
        residual: what is left of the measurement, in units of sqrt(R).
        doubt: variance of the prediction of the measurement, in units of R.
    """

    offset: Tensor
    variance: Tensor
    residual: Tensor
    doubt: Tensor


class PlainFilter(torch.nn.Module):
    """Kalman filter of c, d and b."""

    def __init__(self, motion: MemberMotion):
        """Take the motion of c and d."""
        super().__init__()
        self.motion = motion
        units = torch.eye(len(motion.of_error) + 1)
        self.unit = torch.nn.Buffer(units)
        self.of_bias = torch.nn.Buffer(units[-1])
        self.widened = torch.nn.Buffer(units[:-1])  # from c and d to the whole state

    def first_covariance(self, variance: Tensor) -> Tensor:
        """Return P (B, n + 1, n + 1) before anything is measured."""
        first: Tensor = self.motion.first_covariance(variance).sum(dim=-1) @ self.widened
        told = (FIRST_BIAS * variance)[:, None]
        return (first + told * self.of_bias)[:, :, None] * self.unit

    def forward(
        self,
        mean: Tensor,
        covariance: Tensor,
        angle: Tensor,
        keep: Tensor,
        grows: Tensor,
        measured: Tensor,
        seen: Tensor,
        variance: Tensor,
        sample_time: Tensor,
        verdict: Verdict | None = None,
    ) -> tuple[PlainEstimate, Tensor, Tensor]:
        """Return the estimate, and mean and covariance, one sample later.

        Args:
            mean: (B, n + 1) after the sample before.
            covariance: (B, n + 1, n + 1).
            angle: (B, n) of theta on c and d.
            keep: (B, n) what is left of them.
            grows: (B, n) what their variances grow by.
            measured: (B,) measurement about the mean of the members [deg].
            seen: (B,) 1 where there is one.
            variance: (B,) R [deg^2].
            sample_time: (B,) T [s].
            verdict: of the fallback, if it is asked.
        """
        angle, keep = angle @ self.widened, keep @ self.widened + self.of_bias
        grows = grows @ self.widened + BIAS_PER_S * (sample_time * variance)[:, None] * self.of_bias
        seen_as = angle + self.of_bias  # h: of the measurement
        mean = mean * keep
        covariance = covariance * (keep[:, :, None] * keep[:, None, :]) + grows[:, :, None] * self.unit
        towards = torch.bmm(covariance, seen_as[:, :, None])[:, :, 0]  # P h
        doubt = (seen_as * towards).sum(dim=1).clamp(min=LEAST_VARIANCE)
        innovation = seen * (measured - (seen_as * mean).sum(dim=1))
        told, certain = variance, 0 * variance
        if verdict is not None:
            told, certain = variance * verdict.narrower, verdict.even
            seen = seen * verdict.bound(innovation, doubt + told)
        shrink = (seen / (doubt + told))[:, None]
        mean = mean + towards * (shrink * innovation[:, None])
        covariance = torch.baddbmm(covariance, towards[:, :, None], (towards * shrink)[:, None, :], alpha=-1)

        # That b is zero, if it is, is one more measurement, at the output alone.
        with_b = along(covariance, self.of_bias)
        of_bend = torch.bmm(covariance, angle[:, :, None])[:, :, 0]
        with_bend, own = along(of_bend, self.of_bias), along(with_b, self.of_bias)
        heard = with_bend * certain / (own * certain + variance)
        bend = (angle * mean).sum(dim=1) - heard * along(mean, self.of_bias)
        left = (angle * of_bend).sum(dim=1) - heard * with_bend
        residual = (measured - (seen_as * mean).sum(dim=1)) / torch.sqrt(variance)
        return PlainEstimate(bend, left, residual, doubt / variance), mean, covariance
