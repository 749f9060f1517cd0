"""Noise models and the bank of filters that classifies the noise: one filter for each model.

A noise model is a shape of mean zero. The mean of the noise is the sensor's zero b, a state of every filter,
whose prior the user states: shapes are learned, means are not. A skewed shape has its mirror image in the
bank, with the same parameters.

A noise model is a mixture of normal distributions in units of sqrt(R). Convolved with a normal belief of the
angle it remains such a mixture, so that the likelihood of an innovation and the angle given it have a closed
form (Sorenson and Alspach 1971). Places, widths and weights change with R: a part of each is in units of
sqrt(R), another in degrees, as the counts of a Poisson noise model are whole degrees whatever its R.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch

from rl.twins.filter_step import LEAST_VARIANCE, MemberMotion, along, network
from rl.twins.noises import ModelOf

Tensor = torch.Tensor

PARTS = 10  # K, normal distributions of a mixture
_IN_DEGREES = 4  # of them, begin as counts: at 0, 1, 2 and 3 deg
_R = (0.05, 24.0)  # of the noises of the training [deg^2]; beyond, noise models are those of the end
NARROWEST_DEG2 = 0.01  # of a part: no model of the angle is good enough for the lattice of counts to be sharp


class NoiseModels(NamedTuple):
    """J noise models of K parts at B values of R, in units of sqrt(R) and of R."""

    place: Tensor  # (B, J, K) mean of each part; that of all parts is zero
    log_weight: Tensor  # (B, J, K) logarithm of how likely each is
    width: Tensor  # (B, J, K) variance of each
    effective: Tensor  # (B, J) variance of the normal distribution with the same information about the angle
    log_prior: Tensor  # (B, J) logarithm of how likely each noise model is before anything is measured

    def log_parts(self, residual: Tensor, doubt: Tensor) -> Tensor:
        """Return (B, J, K) log-densities of a residual from each part; the common 2 pi is left out.

        Residuals (B, J, K) are in units of sqrt(R), `doubt` (B,) is the variance of the angle in units of R.
        """
        return log_density(self.log_weight, residual, self.width + doubt[:, None, None])

    def believed(self, evidence: Tensor) -> Tensor:
        """Return (B, J) probabilities of the noise models, for evidence (B, J) beyond the prior."""
        return torch.softmax(self.log_prior + evidence, dim=-1)


class NoiseModelParameters(torch.nn.Module):
    """Parameters of the noise_models."""

    def __init__(self, models: Sequence[ModelOf]):
        super().__init__()
        count = max(of.shape for of in models) + 1
        # Selected by a product: files of ours have no operator that indexes.
        shape = torch.tensor([of.shape for of in models])
        self.of_shape = torch.nn.Buffer(torch.nn.functional.one_hot(shape, count).float())  # (J, shapes)
        self.side = torch.nn.Buffer(torch.tensor([of.side for of in models])[:, None])
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
        """J, number of noise models."""
        return len(self.side)

    def forward(self, variance: Tensor) -> NoiseModels:
        """Return the noise models at (B,) values of R [deg^2]."""
        variance = variance.clamp(*_R)
        level = torch.log(variance)[:, None, None]
        size = variance[:, None, None]
        one, by_level, by_size = (self.of_shape @ of for of in self.weights)
        score = one + level * by_level + size / 4 * by_size
        weight, total = normed(score)
        of_deviation, of_degrees = (self.side * (self.of_shape @ of) for of in self.places)
        place = of_deviation + torch.exp(-level / 2) * of_degrees
        of_deviation, of_degrees = (self.of_shape @ torch.exp(2 * of) for of in self.widths)
        width = of_deviation + (of_degrees + NARROWEST_DEG2) / size
        one, by_level, by_size = (of @ self.of_shape.T for of in self.effective)
        effective = torch.exp((one + level[:, 0] * by_level + size[:, 0] / 4 * by_size).clamp(-4, 1))
        prior = self.prior(level[:, 0] / 3) @ self.of_shape.T
        return NoiseModels(
            place - (weight * place).sum(dim=-1)[..., None],
            score - total[..., None],
            width,
            effective,
            prior - normed(prior)[1][..., None],
        )


def log_density(log_weight: Tensor, residual: Tensor, variance: Tensor) -> Tensor:
    """Return the log-density of weighted normal distributions at residuals, without the 2 pi."""
    return log_weight - 0.5 * (residual * residual / variance + torch.log(variance))


def normed(logarithms: Tensor) -> tuple[Tensor, Tensor]:
    """Return the shares of values by their logarithms, and the logarithm of their sum, over the last axis.

    By hand: it takes one exponential of each, and ONNX Runtime has no such sum in double precision.
    """
    top = logarithms.amax(dim=-1, keepdim=True).detach()
    values = torch.exp(logarithms - top)
    total = values.sum(dim=-1, keepdim=True)
    return values / total, (top + torch.log(total))[..., 0]


HISTORY = 400.0  # samples for which a noise lasts in the mean (a Markov chain, Blom and Bar-Shalom 1988)
CAUTION = 0.05  # added to R where P shrinks, in units of R: no noise model is certain


class FilterBankState(NamedTuple):
    """State of B banks of J filters."""

    rows: Tensor  # (B, J, n) of c, d and b [deg], by noise model
    covariance: Tensor  # (B, n, n) of each of them
    evidence: Tensor  # (B, J) logarithm of how likely each noise model is, less that at the start


class FilterBankPrediction(NamedTuple):
    """State of the filter bank, as predicted for a sample."""

    weights: Tensor  # (B, J) probabilities of the noise models, before the sample
    noise_models: NoiseModels  # at the given R
    evidence: Tensor  # (B, J) for them
    angle: Tensor  # (B, n) of theta on c, d and b
    seen_as: Tensor  # (B, n) of the measurement on them: theta + b
    rows: Tensor  # (B, J, n)
    covariance: Tensor  # (B, n, n) before it grows
    offset: Tensor  # (B, J) angle of each filter about the mean of the members [deg]
    expected: Tensor  # (B, J) measurement that each expects, about the same [deg]
    towards: Tensor  # (B, n) P h, before P grows


class BankUpdate(NamedTuple):
    """Result of one sample."""

    offset: Tensor  # (B,) angle about the mean of the members [deg]
    variance: Tensor  # (B,) of it [deg^2]
    zero: Tensor  # (B,) b [deg]
    zero_variance: Tensor  # (B,) of it [deg^2]
    state: FilterBankState


class FilterBank(torch.nn.Module):
    """Filters of twins, one for each noise model."""

    def __init__(self, motion: MemberMotion, models: Sequence[ModelOf]):
        super().__init__()
        self.motion = motion
        self.noise_models = NoiseModelParameters(models)

    def start(self, first_covariance: Tensor) -> FilterBankState:
        """Return the state before anything is measured, for (B, n, n) covariances."""
        batch, models, size = len(first_covariance), self.noise_models.count, first_covariance.shape[-1]
        return FilterBankState(torch.zeros(batch, models, size), first_covariance, torch.zeros(batch, models))

    def believe(self, evidence: Tensor, variance: Tensor) -> Tensor:
        """Return (B, J) probabilities of the noise models, for (B,) variances R [deg^2]."""
        noise_models: NoiseModels = self.noise_models(variance)
        return noise_models.believed(evidence)

    def predict(
        self,
        state: FilterBankState,  # after the sample before
        angle: Tensor,  # (B, n) of theta on c, d and b
        keep: Tensor,  # (B, n) what is left of them
        variance: Tensor,  # (B,) R [deg^2]
    ) -> FilterBankPrediction:
        """Return the state as predicted for a sample."""
        rows = state.rows * keep[:, None, :]
        covariance = state.covariance * (keep[:, :, None] * keep[:, None, :])
        seen_as = angle + self.motion.of_zero
        towards = torch.bmm(covariance, seen_as[:, :, None])[:, :, 0]
        offset = (rows * angle[:, None, :]).sum(dim=-1)
        noise_models: NoiseModels = self.noise_models(variance)
        return FilterBankPrediction(
            noise_models.believed(state.evidence),
            noise_models,
            state.evidence,
            angle,
            seen_as,
            rows,
            covariance,
            offset,
            offset + along(rows, self.motion.of_zero),
            towards,
        )

    def update(
        self,
        prior: FilterBankPrediction,
        grows: Tensor,  # (B, n) what the variances grow by
        measured: Tensor,  # (B,) measurement about the middle of the members [deg]
        seen: Tensor,  # (B,) for how many independent samples it counts; 0 where there is none
        variance: Tensor,  # (B,) R [deg^2]
    ) -> BankUpdate:
        """Return angles, zeros and states after a sample."""
        noise_models, root = prior.noise_models, torch.sqrt(variance)
        angle, seen_as = prior.angle, prior.seen_as
        covariance = prior.covariance + grows[:, :, None] * self.motion.unit
        towards = prior.towards + grows * seen_as
        doubt = (seen_as * towards).sum(dim=1).clamp(min=LEAST_VARIANCE)
        relative = doubt / variance

        innovation = (measured[:, None] - prior.expected) / root[:, None]
        residual = innovation[:, :, None] - noise_models.place  # from each part
        share, log_model = normed(noise_models.log_parts(residual, relative))
        # P / (P + R), as a sigmoid: the gate looks for an operator that bounds it.
        gain = torch.sigmoid(torch.log(relative[:, None, None] / noise_models.width))
        step = (gain * residual * share).sum(dim=-1) * (root * seen / doubt)[:, None]
        rows = prior.rows + step[:, :, None] * towards[:, None, :]

        after = noise_models.believed(prior.evidence + seen[:, None] * log_model)
        # The noise may change at any sample: no model becomes so unlikely that it could not come back.
        first = torch.exp(noise_models.log_prior)
        after = after + (seen / HISTORY)[:, None] * (first - after)
        evidence = torch.log(after) - noise_models.log_prior
        believed = (after * noise_models.effective).sum(dim=-1)
        effective = believed + CAUTION
        shrink = (seen / (doubt + variance * effective))[:, None]
        covariance = torch.baddbmm(covariance, towards[:, :, None], (towards * shrink)[:, None, :], alpha=-1)

        of_zero = self.motion.of_zero
        offset, own = _mixed(after, (rows * angle[:, None, :]).sum(dim=-1))
        zero, of_zeros = _mixed(after, along(rows, of_zero))
        own = own + (angle * torch.bmm(covariance, angle[:, :, None])[:, :, 0]).sum(dim=1)
        of_zeros = of_zeros + along(along(covariance, of_zero), of_zero)
        return BankUpdate(offset, own, zero, of_zeros, FilterBankState(rows, covariance, evidence))


def _mixed(weights: Tensor, values: Tensor) -> tuple[Tensor, Tensor]:
    """Return the mean (B,) of values (B, J), and their variance."""
    mean = (weights * values).sum(dim=-1)
    return mean, (weights * (values - mean[:, None]) ** 2).sum(dim=-1)
