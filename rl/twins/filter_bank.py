"""Noise models and the bank of filters that classifies the noise: one filter for each model.

Each noise model has a density and a mean of its own.

A noise model is a mixture of normal distributions in units of sqrt(R). Convolved with a normal belief of the
angle it is one again, so that how likely it made an innovation, and where the angle is then, are known in
closed form (Sorenson and Alspach 1971). Places, widths and weights change with R: a part of each is in units
of sqrt(R), another in degrees, as the counts of a Poisson noise model are whole degrees whatever its R.
"""

import math
from typing import NamedTuple

import torch

from rl.twins.filter_step import LEAST_VARIANCE, MemberMotion, network

Tensor = torch.Tensor

PARTS = 10  # K, normal distributions of a mixture
_IN_DEGREES = 4  # of them, begin as counts: at 0, 1, 2 and 3 deg
_R = (0.05, 24.0)  # of the noises of the training [deg^2]; beyond, noise models are those of the end
NARROWEST_DEG2 = 0.01  # of a part: no model of the angle is good enough for the lattice of counts to be sharp


class NoiseModels(NamedTuple):
    """J noise models of K parts at B values of R, in units of sqrt(R) and of R."""

    place: Tensor  # (B, J, K) mean of each part
    log_weight: Tensor  # (B, J, K) logarithm of how likely each is
    width: Tensor  # (B, J, K) variance of each
    mean: Tensor  # (B, J) of each noise_model
    effective: Tensor  # (B, J) variance of the normal distribution with the same information about the angle
    log_prior: Tensor  # (B, J) logarithm of how likely each noise model is before anything is measured

    def log_parts(self, residual: Tensor, doubt: Tensor) -> Tensor:
        """Return (B, J, K) log-densities of a residual from each part; the common 2 pi is left out.

        Residuals (B, J, K) are in units of sqrt(R), `doubt` (B,) is the variance of the angle in units of R.
        """
        return log_density(self.log_weight, residual, self.width + doubt[:, None, None])


class NoiseModelParameters(torch.nn.Module):
    """Parameters of the noise_models."""

    def __init__(self, count: int):
        super().__init__()
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
        """J, number of noise_models."""
        return self.effective.shape[1]

    def forward(self, variance: Tensor) -> NoiseModels:
        """Return the noise models at (B,) values of R [deg^2]."""
        variance = variance.clamp(*_R)
        level = torch.log(variance)[:, None, None]
        size = variance[:, None, None]
        one, by_level, by_size = self.weights
        score = one + level * by_level + size / 4 * by_size
        weight, total = normed(score)
        place = self.places[0] + torch.exp(-level / 2) * self.places[1]
        in_degrees = torch.exp(2 * self.widths[1]) + NARROWEST_DEG2
        width = torch.exp(2 * self.widths[0]) + in_degrees / size
        one, by_level, by_size = self.effective
        effective = torch.exp((one + level[:, 0] * by_level + size[:, 0] / 4 * by_size).clamp(-4, 1))
        prior = self.prior(level[:, 0] / 3)
        return NoiseModels(
            place,
            score - total[..., None],
            width,
            (weight * place).sum(dim=-1),
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


HISTORY = 400.0  # samples after which what was seen of the noise is forgotten
CAUTION = 0.2  # added to R where P shrinks, as training begins, in units of R: no noise model is certain
WITHIN = 0.01  # variance of the mean of a noise about that of its noise model, in units of R


class FilterBankState(NamedTuple):
    """State of B banks of J filters."""

    rows: Tensor  # (B, J, n) of c and d [deg], by noise_model
    covariance: Tensor  # (B, n, n) of each of them
    evidence: Tensor  # (B, J) logarithm of how likely each noise model made what was measured


class NoiseBelief(NamedTuple):
    """Belief in the noise models."""

    noise_models: NoiseModels  # at the given R
    weights: Tensor  # (B, J) probabilities
    bias: Tensor  # (B,) mean of the noise in units of sqrt(R)
    bias_variance: Tensor  # (B,) how sure that is, in units of R


class FilterBankPrediction(NamedTuple):
    """State of the filter bank, as predicted for a sample."""

    belief: NoiseBelief  # in the noise models, before the sample
    evidence: Tensor  # (B, J) for them
    angle: Tensor  # (B, n) of theta on c and d
    rows: Tensor  # (B, J, n)
    covariance: Tensor  # (B, n, n) before it grows
    offset: Tensor  # (B, J) angle of each filter about the mean of the members [deg]
    towards: Tensor  # (B, n) P a, before P grows


class FilterBank(torch.nn.Module):
    """Filters of twins, one for each noise_model."""

    def __init__(self, motion: MemberMotion, noise_models: int):
        super().__init__()
        self.motion = motion
        self.noise_models = NoiseModelParameters(noise_models)
        self.sharpness = torch.nn.Parameter(torch.zeros(()))  # logarithm of what one sample counts
        self.caution = torch.nn.Parameter(torch.tensor(math.log(CAUTION)))

    def start(self, variance: Tensor) -> FilterBankState:
        """Return the state before anything is measured, for (B,) variances R [deg^2]."""
        batch, noise_models, size = len(variance), self.noise_models.count, len(self.motion.of_error)
        return FilterBankState(
            torch.zeros(batch, noise_models, size),
            self.motion.first_covariance(variance),
            torch.zeros(batch, noise_models),
        )

    def believe(self, evidence: Tensor, variance: Tensor) -> NoiseBelief:
        """Return the belief in the noise models by what was seen (B, J), for (B,) variances R [deg^2]."""
        return _believe(self.noise_models(variance), evidence)

    def predict(
        self, state: FilterBankState, angle: Tensor, keep: Tensor, variance: Tensor
    ) -> FilterBankPrediction:
        """Return the prediction, by theta on c and d and what is left of them (B, n), and R (B,) [deg^2]."""
        belief = self.believe(state.evidence, variance)
        rows = state.rows * keep[:, None, :]
        covariance = state.covariance * (keep[:, :, None] * keep[:, None, :])
        towards = torch.bmm(covariance, angle[:, :, None])[:, :, 0]
        offset = (rows * angle[:, None, :]).sum(dim=-1)
        return FilterBankPrediction(belief, state.evidence, angle, rows, covariance, offset, towards)

    def update(
        self,
        prior: FilterBankPrediction,  # from `predict`
        grows: Tensor,  # (B, n) what the variances of c and d grow by
        measured: Tensor,  # (B,) measurement about the mean of the members [deg]
        seen: Tensor,  # (B,) 1 where there is one
        variance: Tensor,  # (B,) R [deg^2]
        on_gain: Tensor,  # (B,) what the policy adds to the logit of every gain
        on_noise: Tensor,  # (B,) logarithm of what it multiplies R by, as P shrinks
    ) -> tuple[Tensor, Tensor, NoiseBelief, FilterBankState]:
        """Return angle and variance (B,) [deg], [deg^2], and belief and state after a sample.

        The angle is about the mean of the members.
        """
        angle, noise_models, root = prior.angle, prior.belief.noise_models, torch.sqrt(variance)
        covariance = prior.covariance + grows[:, :, None] * self.motion.unit
        towards = prior.towards + grows * angle
        doubt = (angle * towards).sum(dim=1).clamp(min=LEAST_VARIANCE)
        relative = doubt / variance

        innovation = (measured[:, None] - prior.offset) / root[:, None]
        residual = innovation[:, :, None] - noise_models.place  # from each part
        share, log_model = normed(noise_models.log_parts(residual, relative))
        logit = torch.log(relative[:, None, None] / noise_models.width)  # of K_AM
        gain = torch.sigmoid(logit + on_gain[:, None, None])
        step = (gain * residual * share).sum(dim=-1) * (root * seen / doubt)[:, None]
        rows = prior.rows + step[:, :, None] * towards[:, None, :]

        counts_as = (seen * torch.exp(self.sharpness))[:, None]
        evidence = prior.evidence * (1 - seen / HISTORY)[:, None] + counts_as * log_model
        after = _believe(noise_models, evidence)
        believed = (after.weights * noise_models.effective).sum(dim=-1)
        effective = (believed + torch.exp(self.caution)) * torch.exp(on_noise)
        shrink = (seen / (doubt + variance * effective))[:, None]
        covariance = torch.baddbmm(covariance, towards[:, :, None], (towards * shrink)[:, None, :], alpha=-1)

        offsets = (rows * angle[:, None, :]).sum(dim=-1)
        offset = (after.weights * offsets).sum(dim=-1)
        between = (after.weights * (offsets - offset[:, None]) ** 2).sum(dim=-1)
        own = doubt * (1 - doubt * shrink[:, 0])
        return offset, own + between, after, FilterBankState(rows, covariance, evidence)


def _believe(noise_models: NoiseModels, evidence: Tensor) -> NoiseBelief:
    weights = torch.softmax(noise_models.log_prior + evidence, dim=-1)
    bias = (weights * noise_models.mean).sum(dim=-1)
    variance = (weights * (noise_models.mean - bias[:, None]) ** 2).sum(dim=-1)
    return NoiseBelief(noise_models, weights, bias, variance + WITHIN)
