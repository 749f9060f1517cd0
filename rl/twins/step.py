"""One sample of RAM (twins) as a module of torch: it is exported and deployed as it stands here.

The active model (eqs. 4-9) predicts by M twins that follow the command:

    theta = mean of the members + c . a + d,      y = theta + b + noise,

where a are the anomalies of the members along r fixed directions, c their coefficients (Evensen 2003) and d
the motion that no member has, which decays with the travel of the tendon (`rl/twins/filter_step.py`). It
knows R, and how well the sensor's zero b is known. The shape of the noise is classified: a bank of such
filters, one for each shape, is weighed by what is measured (`rl/twins/filter_bank.py`). The innovation moves
a filter by the share of each part of its shape, so that the gain depends on the innovation, as K_AM + K_RAM
of eq. 10 does.

A policy that acted on gain, R and growth was tried in three forms, learned by back-propagation and by PPO. It
gained nothing beyond the bank, and is left out (docs/ram_twins.md).

A filter that knows only R and the deviation of b runs alongside (`PlainFilter`). Where the
noise is like none of the training (`OodDetector`), the classifier is disabled, and only that filter is used,
in a robust form (`Fallback`).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch

from rl.policies import log_scale
from rl.twins.filter_bank import HISTORY, FilterBank, FilterBankState
from rl.twins.filter_step import LEAST_VARIANCE, FilterStep, MemberMotion, Output, along
from rl.twins.noises import ModelOf
from rl.twins.ood_detector import BINS, Fallback, OodDetector, ResidualHistogram, Verdict

Tensor = torch.Tensor

STATISTICS = 9


class FilterState(NamedTuple):
    """State of B filters."""

    mean: Tensor  # (B, n) of c, d and b [deg], of the filter alone
    covariance: Tensor  # (B, n, n) of it
    counts: Tensor  # (B, BINS) histogram of its residuals
    samples: Tensor  # (B,) measured so far
    statistics: Tensor  # (B, STATISTICS) running means of the innovation, see `recent`
    rows: Tensor  # (B, J, n) of c, d and b, by noise model
    rows_covariance: Tensor  # (B, n, n) of each of them
    evidence: Tensor  # (B, J) logarithm of how likely each noise model is, less that at the start


class PlainFilter(torch.nn.Module):
    """Kalman filter of c, d and b."""

    def __init__(self, motion: MemberMotion):
        super().__init__()
        self.motion = motion

    def forward(
        self,
        mean: Tensor,  # (B, n) after the sample before
        covariance: Tensor,  # (B, n, n)
        angle: Tensor,  # (B, n) of theta on c, d and b
        keep: Tensor,  # (B, n) what is left of them
        grows: Tensor,  # (B, n) what their variances grow by
        measured: Tensor,  # (B,) measurement about the mean of the members [deg]
        seen: Tensor,  # (B,) 1 where there is one
        variance: Tensor,  # (B,) R [deg^2]
        verdict: Verdict | None = None,  # of the fallback, if it is asked
    ) -> tuple[Tensor, ...]:
        """Return mean and covariance one sample later, and (B,) values of the estimate.

        These are the angle about the mean of the members [deg], its variance [deg^2], what is left of the
        measurement in units of sqrt(R), and the variance of its prediction in units of R.
        """
        seen_as = angle + self.motion.of_zero  # h: of the measurement
        mean = mean * keep
        covariance = covariance * (keep[:, :, None] * keep[:, None, :]) + grows[:, :, None] * self.motion.unit
        towards = torch.bmm(covariance, seen_as[:, :, None])[:, :, 0]  # P h
        doubt = (seen_as * towards).sum(dim=1).clamp(min=LEAST_VARIANCE)
        innovation = seen * (measured - (seen_as * mean).sum(dim=1))
        noise = variance
        if verdict is not None:
            noise = variance * verdict.narrower
            seen = seen * verdict.bound(innovation, doubt + noise)
        shrink = (seen / (doubt + noise))[:, None]
        mean = mean + towards * (shrink * innovation[:, None])
        covariance = torch.baddbmm(covariance, towards[:, :, None], (towards * shrink)[:, None, :], alpha=-1)
        left = (angle * torch.bmm(covariance, angle[:, :, None])[:, :, 0]).sum(dim=1)
        residual = (measured - (seen_as * mean).sum(dim=1)) / torch.sqrt(variance)
        return mean, covariance, (angle * mean).sum(dim=1), left, residual, doubt / variance


SCALARS = 20  # that the interval is made of, next to the probabilities of the noise models
RECENT, SLOW = 30.0, 200.0  # samples of the running statistics
BOUND = 3.0  # of an innovation in a covariance, in units of sqrt(R): outliers carry little information
CHANCE = 2.0  # standard deviations of a correlation that independent samples have by chance
MOST_CORRELATED = 0.95  # from one sample to the next


class Features(torch.nn.Module):
    """What the width of the interval is made of, in the units stated here."""

    def __init__(self, motion: MemberMotion) -> None:
        super().__init__()
        self.motion = motion
        self.angle_units = torch.nn.Buffer(torch.tensor([1.0, 1.0, 1.0, 5.0]))
        self.log_units = torch.nn.Buffer(torch.tensor([1, 1, 3, 3, 0.6, 1, 1.5, 1, 1]) / 3)

    def forward(
        self,
        state: FilterState,  # after the sample before
        weights: Tensor,  # (B, J) probabilities of the noise models
        mean: Tensor,  # (B, n) of c, d and b, as predicted
        covariance: Tensor,  # (B, n, n) of them
        doubt: Tensor,  # (B,) variance of the expected measurement [deg^2]
        innovation: Tensor,  # (B,) [deg]
        way_mm: Tensor,  # (B,) since the last sample [mm]
        variance: Tensor,  # (B,) R [deg^2]
        zero_deviation: Tensor,  # (B,) of what is known of the sensor's zero [deg]
        sample_time: Tensor,  # (B,) T [s]
    ) -> Tensor:
        """Return (B, J + SCALARS) numbers."""
        root = torch.sqrt(variance)
        statistics = state.statistics.split(1, dim=1)
        average, product, square, slow_product, slow_square, slow_average, *_ = statistics
        coefficients = mean * self.motion.of_members
        of_error, of_zero = self.motion.of_error, self.motion.of_zero
        angles = [
            innovation / root,
            innovation / torch.sqrt(doubt + variance),
            along(mean, of_error) / root,
            way_mm,
        ]
        positive = [
            doubt / variance,
            along(along(covariance, of_error), of_error) + 1e-3,
            square[:, 0] + 0.1,
            slow_square[:, 0] + 0.1,
            state.samples.clamp(max=HISTORY) + 1,
            variance,
            10 * sample_time,
            along(along(covariance, of_zero), of_zero) / variance + 1e-2,
            zero_deviation * zero_deviation / variance + 1e-2,
        ]
        return torch.cat(
            [
                weights,
                (along(mean, of_zero) / root / 3)[:, None],
                log_scale(torch.stack(angles, dim=1) * self.angle_units),
                torch.log(torch.stack(positive, dim=1)) * self.log_units,
                torch.tanh(innovation / root / 2)[:, None],
                (coefficients * coefficients).sum(dim=1, keepdim=True) / self.motion.of_members.sum(),
                average,
                product,
                slow_product,
                slow_average,
            ],
            dim=1,
        )


def recent(state: FilterState, seen: Tensor, innovation: Tensor, doubt: Tensor) -> Tensor:
    """Return the running statistics with one more innovation, in units of sqrt(R).

    Running means of the innovation, of its product with the one before and of its normalised square, over a
    few samples and over many; over many, of the product and the square as `independence` reads them; and the
    last one.
    """
    average, product, square, slow_product, slow_square, slow_average, lagged, power, last = (
        of[:, 0] for of in state.statistics.split(1, dim=1)
    )
    now = log_scale(innovation)
    with_last, normal = now * log_scale(last), innovation * innovation / (doubt + 1)
    bounded, last_bounded = innovation.clamp(-BOUND, BOUND), last.clamp(-BOUND, BOUND)
    fast, slow = (seen / (state.samples + 1).clamp(max=most) for most in (RECENT, SLOW))
    return torch.stack(
        [
            average + (now - average) * fast,
            product + (with_last - product) * fast,
            square + (normal - square) * fast,
            slow_product + (with_last - slow_product) * slow,
            slow_square + (normal - slow_square) * slow,
            slow_average + (now - slow_average) * slow,
            lagged + (bounded * last_bounded - lagged) * slow,
            power + (bounded * bounded - power) * slow,
            last + (innovation - last) * seen,
        ],
        dim=1,
    )


def independence(state: FilterState) -> Tensor:
    """Return (B,) for how many independent samples a sample counts, by the correlation of the innovations.

    A mean over samples with the correlation rho from one to the next is as uncertain as that over
    (1 - rho) / (1 + rho) times as many (Bayley and Hammersley 1946). Errors that twins do not explain are
    correlated too, but they make innovations larger than R and P allow: the correlation is reduced
    accordingly.
    """
    *_, lagged, power, _ = (of[:, 0] for of in state.statistics.split(1, dim=1))
    unexplained = torch.relu(power - 1)
    count = state.samples.clamp(1.0, SLOW)
    chance = CHANCE * torch.sqrt(count) / count
    correlation = (lagged - unexplained - chance).clamp(0.0, MOST_CORRELATED)
    counted: Tensor = (1 - correlation) / (1 + correlation)
    return counted


class TwinsStep(FilterStep):
    """Active model on twins, noise classifier and interval; see the module."""

    actions = 0

    def __init__(
        self,
        directions: Tensor,  # (M, r) orthonormal directions among the members
        noise_models: Sequence[ModelOf],  # J, that there are to choose among
        *,
        with_error: bool = True,  # whether there is a d, what no member does
    ):
        """Start untrained."""
        super().__init__(len(noise_models) + SCALARS)
        members, rank = directions.shape
        scaled = torch.cat([directions / math.sqrt(members - 1), torch.zeros(members, 2)], dim=1)
        self.directions = torch.nn.Buffer(scaled)
        self.motion = MemberMotion(rank, with_error=with_error)
        self.filter_bank = FilterBank(self.motion, noise_models)
        self.plain = PlainFilter(self.motion)
        self.features = Features(self.motion)
        self.histogram = ResidualHistogram()
        self.ood_detector, self.fallback = OodDetector(len(noise_models)), Fallback()
        self.guarded = False  # whether strange noise disables the classifier; after its lesson

    def start(self, zero_deviation: Tensor) -> FilterState:
        """Return the state before anything is measured, see `FilterStep.start`."""
        batch = len(zero_deviation)
        covariance = self.motion.first_covariance(zero_deviation)
        return FilterState(
            torch.zeros(covariance.shape[:2]),
            covariance,
            torch.zeros(batch, BINS),
            torch.zeros(batch),
            torch.zeros(batch, STATISTICS),
            *self.filter_bank.start(covariance),
        )

    def begun(self, state: FilterState, zero_deviation: Tensor) -> FilterState:
        """Return a state, or the first one where it is all zero; see `start`."""
        of_error = self.motion.of_error
        begins = 1 - torch.sign(along(along(state.rows_covariance, of_error), of_error))[:, None, None]
        first = begins * self.motion.first_covariance(zero_deviation)
        return state._replace(
            covariance=state.covariance + first, rows_covariance=state.rows_covariance + first
        )

    def forward(
        self,
        members_deg: Tensor,  # (B, M) angle of the members now [deg]
        way_mm: Tensor,  # (B,) that the tendon has gone since the last sample [mm]
        measurement_deg: Tensor,  # (B,) NaN where there is none [deg]
        variance: Tensor,  # (B,) R, as given [deg^2]
        zero_deviation: Tensor,  # (B,) of what is known of the sensor's zero, as given [deg]
        sample_time: Tensor,  # (B,) T [s]
        parts: Tensor,  # (2,) the second is 1 or 0: whether the noise classifier is on
        state: FilterState,  # after the sample before
    ) -> tuple[Output, FilterState]:
        """Return the estimates and the states one sample later."""
        _, classifier_on = parts.split(1)
        middle = members_deg.mean(dim=1)
        angle = (members_deg - middle[:, None]) @ self.directions + self.motion.of_error
        keep, grows = self.motion.keep(way_mm), self.motion.growth(way_mm, zero_deviation, sample_time)
        bank = FilterBankState(state.rows, state.rows_covariance, state.evidence)
        prior = self.filter_bank.predict(bank, angle, keep, variance)

        expected = (prior.weights * prior.expected).sum(dim=1)
        is_seen = ~torch.isnan(measurement_deg)
        seen = is_seen.to(measurement_deg.dtype)
        measured = torch.where(is_seen, measurement_deg - middle, expected)
        innovation = measured - expected
        doubt = (prior.seen_as * prior.towards).sum(dim=1).clamp(min=LEAST_VARIANCE)
        mean = (prior.weights[:, :, None] * prior.rows).sum(dim=1)
        features = self.features(
            *(state, prior.weights, mean, prior.covariance, doubt, innovation, way_mm),
            *(variance, zero_deviation, sample_time),
        )
        verdict = None
        if self.guarded:
            known = self.ood_detector(prior.weights, state.counts, torch.log(variance))
            verdict = self.fallback(classifier_on * (1 - known), state.counts)
            classifier_on = classifier_on * known

        found = self.filter_bank.update(prior, grows, measured, seen * independence(state), variance)
        plain, covariance, alone, of_alone, residual, plain_doubt = self.plain(
            *(state.mean, state.covariance, angle, keep, grows, measured, seen, variance, verdict)
        )
        apart = found.offset - alone
        offset = alone + classifier_on * apart
        spread = classifier_on * found.variance + (1 - classifier_on) * (
            of_alone + classifier_on * apart * apart
        )
        counts = state.counts * (1 - seen / HISTORY)[:, None]
        counts = counts + seen[:, None] * self.histogram(residual, plain_doubt)
        statistics = recent(state, seen, innovation / torch.sqrt(variance), doubt / variance)
        after = FilterState(plain, covariance, counts, state.samples + seen, statistics, *found.state)

        deviation = torch.sqrt(spread.clamp(min=LEAST_VARIANCE))
        return Output(
            middle + offset,
            deviation * self.widen(features),
            found.zero / torch.sqrt(variance),
            found.zero_variance / variance,
            offset.new_zeros(len(offset), 0),
            deviation,
            features,
        ), after
