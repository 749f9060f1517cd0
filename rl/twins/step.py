"""One sample of RAM (twins) as a module of torch: trained, exported and deployed as it stands here.

The active model (eqs. 4-9) predicts by M twins that follow the command:

    theta = mean of the members + c . a + d,      y = theta + noise,

where a are the anomalies of the members along r fixed directions, c their coefficients (Evensen 2003) and d
what no member does, which decays with the way of the tendon (`rl/twins/filter_step.py`). It knows R. What
else the noise is, its mean above all, is classified: a bank of such filters, one for each noise model
that the noise may have, is weighed by what is measured (`rl/twins/filter_bank.py`).

RAM (eq. 10) then adds K_RAM phi, phi = y - y_AM, along the filter's own direction P a. Of the gains it is the
*sum* that is bounded,

    K_AM + (1 - K_AM) K_RAM = sigmoid(logit K_AM + 5 tanh u)    in [0, 1],

for each part of each noise model, so that K_RAM may be negative: it takes back what the active model took
of an outlier. Three more actions set the R by which P shrinks, the growth of d and that of c. A policy that
does nothing (u = 0) changes nothing.

The filter alone runs alongside, which knows R and nothing more (`PlainFilter`). Where the
noise is like none of the training (`OodDetector`), classifier and policy are disabled, and
the filter alone is left, as a robust one (`Fallback`).
"""

import math
from typing import Any, NamedTuple

import torch

from rl.policies import log_scale
from rl.twins.filter_bank import HISTORY, FilterBank, FilterBankPrediction, FilterBankState, NoiseBelief
from rl.twins.filter_step import LEAST_VARIANCE, FilterStep, MemberMotion, Output, along, last_layer, network
from rl.twins.ood_detector import BINS, Fallback, OodDetector, ResidualHistogram, Verdict

Tensor = torch.Tensor

STATISTICS = 4


class FilterState(NamedTuple):
    """State of B filters."""

    mean: Tensor  # (B, r + 2) of c, d [deg] and b [deg], of the filter alone
    covariance: Tensor  # (B, r + 2, r + 2) of it
    counts: Tensor  # (B, BINS) histogram of its residuals
    samples: Tensor  # (B,) measured so far
    statistics: Tensor  # (B, STATISTICS) running means of the innovation, see `recent`
    rows: Tensor  # (B, J, r + 1) of c and d, by noise model of the noise
    rows_covariance: Tensor  # (B, r + 1, r + 1) of each of them
    evidence: Tensor  # (B, J) logarithm of how likely each noise model made what was measured


class Predicted(NamedTuple):
    """Prediction for a sample, and its innovation."""

    state: FilterState  # after the sample before
    filter_bank: FilterBankPrediction  # as predicted, with its belief about the noise
    middle: Tensor  # (B,) mean angle of the members [deg]
    keep: Tensor  # (B, r + 1) what is left of c and d since the sample before
    growth: tuple[Tensor, Tensor]  # of variances: (B, r + 1) of d, times an action of the policy, and of c
    measured: Tensor  # (B,) measurement about the middle [deg]; where there is none, what was expected
    innovation: Tensor  # (B,) in units of sqrt(R)
    doubt: Tensor  # (B,) variance of the angle in units of R
    seen: Tensor  # (B,) 1 where something was measured
    variance: Tensor  # (B,) R [deg^2]
    sample_time: Tensor  # (B,) T [s]
    features: Tensor  # (B, J + SCALARS) what the policy sees
    policy_on: Tensor  # weight of the policy
    classifier_on: Tensor  # weight of the noise classifier
    verdict: Verdict | None  # of the fallback; None while the step learns, when nothing is strange


FIRST_BIAS = 0.85  # variance of b in units of R before anything is measured
BIAS_PER_S = 3e-4  # growth of the variance of b in units of R: a sensor may change in an hour


class PlainFilter(torch.nn.Module):
    """Kalman filter of c, d and b."""

    def __init__(self, motion: MemberMotion):
        super().__init__()
        self.motion = motion
        units = torch.eye(len(motion.of_error) + 1)
        self.unit = torch.nn.Buffer(units)
        self.of_bias = torch.nn.Buffer(units[-1])
        self.widened = torch.nn.Buffer(units[:-1])  # from c and d to the whole state

    def first_covariance(self, variance: Tensor) -> Tensor:
        """Return P (B, n + 1, n + 1) before anything is measured."""
        first: Tensor = self.motion.first_covariance(variance).sum(dim=-1) @ self.widened
        of_variance = (FIRST_BIAS * variance)[:, None]
        return (first + of_variance * self.of_bias)[:, :, None] * self.unit

    def forward(
        self,
        mean: Tensor,  # (B, n + 1) after the sample before
        covariance: Tensor,  # (B, n + 1, n + 1)
        angle: Tensor,  # (B, n) of theta on c and d
        keep: Tensor,  # (B, n) what is left of them
        grows: Tensor,  # (B, n) what their variances grow by
        measured: Tensor,  # (B,) measurement about the mean of the members [deg]
        seen: Tensor,  # (B,) 1 where there is one
        variance: Tensor,  # (B,) R [deg^2]
        sample_time: Tensor,  # (B,) T [s]
        verdict: Verdict | None = None,  # of the fallback, if it is asked
    ) -> tuple[Tensor, ...]:
        """Return mean and covariance one sample later, and (B,) values of the estimate.

        These are the angle about the mean of the members [deg], its variance [deg^2], what is left of the
        measurement in units of sqrt(R), and the variance of its prediction in units of R.
        """
        angle, keep = angle @ self.widened, keep @ self.widened + self.of_bias
        grows = grows @ self.widened + BIAS_PER_S * (sample_time * variance)[:, None] * self.of_bias
        seen_as = angle + self.of_bias  # h: of the measurement
        mean = mean * keep
        covariance = covariance * (keep[:, :, None] * keep[:, None, :]) + grows[:, :, None] * self.unit
        towards = torch.bmm(covariance, seen_as[:, :, None])[:, :, 0]  # P h
        doubt = (seen_as * towards).sum(dim=1).clamp(min=LEAST_VARIANCE)
        innovation = seen * (measured - (seen_as * mean).sum(dim=1))
        noise, certain = variance, 0 * variance
        if verdict is not None:
            noise, certain = variance * verdict.narrower, verdict.even
            seen = seen * verdict.bound(innovation, doubt + noise)
        shrink = (seen / (doubt + noise))[:, None]
        mean = mean + towards * (shrink * innovation[:, None])
        covariance = torch.baddbmm(covariance, towards[:, :, None], (towards * shrink)[:, None, :], alpha=-1)

        # That b is zero, if it is, is one more measurement, at the output alone.
        with_b = along(covariance, self.of_bias)
        of_bend = torch.bmm(covariance, angle[:, :, None])[:, :, 0]
        with_bend, own = along(of_bend, self.of_bias), along(with_b, self.of_bias)
        share = with_bend * certain / (own * certain + variance)
        bend = (angle * mean).sum(dim=1) - share * along(mean, self.of_bias)
        left = (angle * of_bend).sum(dim=1) - share * with_bend
        residual = (measured - (seen_as * mean).sum(dim=1)) / torch.sqrt(variance)
        return mean, covariance, bend, left, residual, doubt / variance


SCALARS = 16  # that the policy sees next to the probabilities of the noise models
RECENT = 30.0  # samples of the running statistics


class Features(torch.nn.Module):
    """Observation of the policy, in the units stated here."""

    def __init__(self, motion: MemberMotion) -> None:
        super().__init__()
        self.motion = motion
        self.angle_units = torch.nn.Buffer(torch.tensor([1.0, 1.0, 1.0, 5.0]))
        self.log_units = torch.nn.Buffer(torch.tensor([1 / 3, 1 / 3, 1.0, 0.2, 1 / 3, 0.5]))

    def forward(
        self,
        state: FilterState,  # after the sample before
        belief: NoiseBelief,  # in the noise models
        mean: Tensor,  # (B, n) of c and d, as predicted
        doubt: Tensor,  # (B,) variance of the prediction [deg^2]
        of_error: Tensor,  # (B,) that of d [deg^2]
        innovation: Tensor,  # (B,) [deg]
        way_mm: Tensor,  # (B,) since the last sample [mm]
        variance: Tensor,  # (B,) R [deg^2]
        sample_time: Tensor,  # (B,) T [s]
    ) -> Tensor:
        """Return (B, J + SCALARS) what the policy sees; with gradients by the belief in the noise models."""
        root = torch.sqrt(variance)
        average, product, square, _ = state.statistics.split(1, dim=1)
        coefficients = mean * self.motion.of_members
        angles = [
            innovation / root,
            innovation / torch.sqrt(doubt + variance),
            along(mean, self.motion.of_error) / root,
            way_mm,
        ]
        positive = [
            doubt / variance,
            of_error + 1e-3,
            square[:, 0] + 1,
            state.samples.clamp(max=HISTORY) + 1,
            variance,
            10 * sample_time,
        ]
        return torch.cat(
            [
                belief.weights,
                belief.bias[:, None],
                torch.log(belief.bias_variance)[:, None] / 3,
                log_scale(torch.stack(angles, dim=1) * self.angle_units),
                torch.log(torch.stack(positive, dim=1)) * self.log_units,
                torch.tanh(innovation / root / 2)[:, None],
                (coefficients * coefficients).sum(dim=1, keepdim=True) / self.motion.of_members.sum(),
                average,
                product,
            ],
            dim=1,
        )


def recent(state: FilterState, seen: Tensor, innovation: Tensor, doubt: Tensor) -> Tensor:
    """Return the running statistics with one more innovation, in units of sqrt(R).

    Running means of the innovation, of its product with the one before and of its normalised square, and the
    last one.
    """
    average, product, square, last = (of[:, 0] for of in state.statistics.split(1, dim=1))
    now = log_scale(innovation)
    weight = seen / (state.samples + 1).clamp(max=RECENT)
    return torch.stack(
        [
            average + (now - average) * weight,
            product + (now * log_scale(last) - product) * weight,
            square + (innovation * innovation / (doubt + 1) - square) * weight,
            last + (innovation - last) * seen,
        ],
        dim=1,
    )


ACTIONS = 4  # on the total gain, on R for the covariance, on the growth of d, on that of c
REACH = (5.0, 4.0, 3.0, 3.0)  # of the actions, in logarithms


class TwinsStep(FilterStep):
    """Active model on twins, noise classifier, policy and interval; see the module."""

    actions = ACTIONS
    slow = tuple(f"filter_bank.noise_models.{name}" for name in ("places", "weights", "widths", "effective"))

    def __init__(
        self,
        directions: Tensor,  # (M, r) orthonormal directions among the members
        noise_models: int,  # J, of the noise
        hidden: int = 96,  # units of each layer of the policy
        *,
        policy_layers: int = 2,  # of the policy; 0 for one that is linear in what it sees
        with_error: bool = True,  # whether there is a d, what no member does
    ):
        """Start untrained, with a policy that does nothing."""
        super().__init__(noise_models + SCALARS)
        members, rank = directions.shape
        scaled = torch.cat([directions / math.sqrt(members - 1), torch.zeros(members, 1)], dim=1)
        self.directions = torch.nn.Buffer(scaled)
        self.reach = torch.nn.Buffer(torch.tensor(REACH))
        self.motion = MemberMotion(rank, with_error=with_error)
        self.filter_bank = FilterBank(self.motion, noise_models)
        self.plain = PlainFilter(self.motion)
        self.features = Features(self.motion)
        self.histogram = ResidualHistogram()
        self.ood_detector, self.fallback = OodDetector(noise_models), Fallback()
        self.guarded, self.goes_along = False, True  # strange noise disables; the filter alone runs too
        self.policy = network(noise_models + SCALARS, hidden, ACTIONS, policy_layers)
        with torch.no_grad():
            last_layer(self.policy).weight.mul_(0.1)
            last_layer(self.policy).bias.zero_()

    def start(self, variance: Tensor) -> FilterState:
        """Return the state before anything is measured, for (B,) variances R of the noise [deg^2]."""
        batch = len(variance)
        covariance = self.plain.first_covariance(variance)
        return FilterState(
            torch.zeros(covariance.shape[:2]),
            covariance,
            torch.zeros(batch, BINS),
            torch.zeros(batch),
            torch.zeros(batch, STATISTICS),
            *self.filter_bank.start(variance),
        )

    def begun(self, state: FilterState, variance: Tensor) -> FilterState:
        """Return a state, or the first one where it is all zero; for (B,) variances R [deg^2]."""
        of_error = self.motion.of_error
        begins = 1 - torch.sign(along(along(state.rows_covariance, of_error), of_error))[:, None, None]
        return state._replace(
            covariance=state.covariance + begins * self.plain.first_covariance(variance),
            rows_covariance=state.rows_covariance + begins * self.motion.first_covariance(variance),
        )

    def forward(self, *given: Any) -> tuple[Output, FilterState]:
        """Return the estimates and the states one sample later; arguments as in `predict`."""
        prior = self.predict(*given)
        return self.update(prior, self.policy(prior.features))

    def predict(
        self,
        members_deg: Tensor,  # (B, M) angle of the members now [deg]
        way_mm: Tensor,  # (B,) that the tendon has gone since the last sample [mm]
        measurement_deg: Tensor,  # (B,) NaN where there is none [deg]
        variance: Tensor,  # (B,) R, as given [deg^2]
        sample_time: Tensor,  # (B,) T [s]
        parts: Tensor,  # (2,) 1 or 0: whether the policy and the noise classifier are on
        state: FilterState,  # after the sample before
    ) -> Predicted:
        """Return what is known before the policy acts."""
        policy_on, classifier_on = parts.split(1)
        middle = members_deg.mean(dim=1)
        angle = (members_deg - middle[:, None]) @ self.directions + self.motion.of_error
        keep = self.motion.keep(way_mm)
        filter_bank = self.filter_bank.predict(_of_bank(state), angle, keep, variance)
        belief = filter_bank.belief

        offset = (belief.weights * filter_bank.offset).sum(dim=1)
        expected = offset + belief.bias * torch.sqrt(variance)
        is_seen = ~torch.isnan(measurement_deg)
        measured = torch.where(is_seen, measurement_deg - middle, expected)
        innovation = (measured - expected).detach()
        doubt = (angle * filter_bank.towards).sum(dim=1).clamp(min=LEAST_VARIANCE).detach()
        of_error = along(along(filter_bank.covariance.detach(), self.motion.of_error), self.motion.of_error)
        mean = (belief.weights[:, :, None] * filter_bank.rows).sum(dim=1).detach()
        features = self.features(
            state, belief, mean, doubt, of_error, innovation, way_mm, variance, sample_time
        )
        verdict = None
        if self.guarded:
            known = self.ood_detector(belief.weights, state.counts, torch.log(variance))
            verdict = self.fallback(classifier_on * (1 - known), state.counts)
            policy_on, classifier_on = policy_on * known[:, None], classifier_on * known
        return Predicted(
            state=state,
            filter_bank=filter_bank,
            middle=middle,
            keep=keep,
            growth=self.motion.growth(way_mm, sample_time),
            measured=measured,
            innovation=innovation / torch.sqrt(variance),
            doubt=doubt / variance,
            seen=is_seen.to(measured.dtype),
            variance=variance,
            sample_time=sample_time,
            features=features,
            policy_on=policy_on,
            classifier_on=classifier_on,
            verdict=verdict,
        )

    def update(self, prior: Predicted, action: Tensor) -> tuple[Output, FilterState]:
        """Return estimates and states after a sample, by the action (B, ACTIONS) before it is bounded."""
        state, seen = prior.state, prior.seen
        actions = action * prior.policy_on
        on_gain, on_noise, on_error, on_members = (torch.tanh(actions) * self.reach).split(1, dim=1)
        of_error, of_members = prior.growth
        offset, variance, belief, of_bank = self.filter_bank.update(
            prior.filter_bank,
            of_error * torch.exp(on_error) + of_members * torch.exp(on_members),
            prior.measured,
            seen,
            prior.variance,
            on_gain[:, 0],
            on_noise[:, 0],
        )
        mean, covariance, counts = state.mean, state.covariance, state.counts
        if self.goes_along:
            given = prior.filter_bank.angle, prior.keep, of_error + of_members, prior.measured, seen
            mean, covariance, alone, of_alone, residual, doubt = self.plain(
                mean, covariance, *given, prior.variance, prior.sample_time, prior.verdict
            )
            counted = seen[:, None] * self.histogram(residual, doubt)
            counts = counts * (1 - seen / HISTORY)[:, None] + counted
            classifier_on, apart = prior.classifier_on, offset - alone
            offset = alone + classifier_on * apart
            variance = classifier_on * variance + (1 - classifier_on) * (
                of_alone + classifier_on * apart * apart
            )
        statistics = recent(state, seen, prior.innovation, prior.doubt)
        after = FilterState(mean, covariance, counts, state.samples + seen, statistics, *of_bank)

        deviation = torch.sqrt(variance.clamp(min=LEAST_VARIANCE))
        half_width = deviation * self.widen(prior.features)
        bend, bias = prior.middle + offset, (belief.bias, belief.bias_variance)
        return Output(bend, half_width, *bias, actions, deviation, prior.features), after


def _of_bank(state: FilterState) -> FilterBankState:
    return FilterBankState(state.rows, state.rows_covariance, state.evidence)
