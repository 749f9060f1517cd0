"""One sample of RAM (twins) as a module of torch: trained, exported and deployed as it stands here.

The active model (eqs. 4-9) predicts by M twins that follow the command. The state is X = [c, d, b]:

    theta = mean of the members + c . a + d,      y = theta + b + noise,

where a are the anomalies of the members along r fixed directions, c their coefficients (Evensen 2003), d what
no member does, which decays with the way of the tendon, and b the mean of the noise, which nobody tells. c, d
and b have a joint covariance P and a Kalman filter that is told R, as the paper's active model.

RAM (eq. 10) then adds K_RAM phi, phi = y - y_AM, along the filter's own direction P h. Of the gains it is the
*sum* that is bounded,

    K_AM + (1 - K_AM) K_RAM = sigmoid(logit K_AM + 5 tanh u)    in [0, 1],

so that K_RAM may be negative: it takes back what the active model believed of an outlier. Three more
actions set the R by which P shrinks, the growth of d and that of c. A policy that does nothing (u = 0)
changes nothing.

What the recogniser (`rl/twins/recogniser.py`) says of b is taken as one more measurement, at the output
alone, so that the filter itself stays linear. Where the noise is like none of the training
(`rl/twins/familiarity.py`), recogniser and policy fall silent, and the filter goes on as a robust one
(`rl/twins/fallback.py`).
"""

import math
from typing import Any

import torch

from rl.twins.fallback import Fallback
from rl.twins.familiarity import Familiarity
from rl.twins.features import SCALARS, Features, recent
from rl.twins.filter_state import STATISTICS, FilterState, Predicted
from rl.twins.filter_step import LEAST_VARIANCE, FilterStep, Output
from rl.twins.networks import last_layer, network
from rl.twins.products import along
from rl.twins.recogniser import BINS, HISTORY, LAWS, Recogniser

ACTIONS = 4  # on the total gain, on R for the covariance, on the growth of d, on that of c
REACH = (5.0, 4.0, 3.0, 3.0)  # of the actions, in logarithms
MEMORY_MM = 5.0  # way of the tendon after which d is forgotten
GROWTH_DEG2_PER_MM, GROWTH_DEG2_PER_S = 0.05, 0.0065  # of the variance of d, times what the policy says
MEMBERS_PER_MM = 5e-4  # growth of the variance of the coefficients: what keeps them awake for hours
FIRST_ERROR_DEG2 = 0.02  # variance of d before anything is measured
FIRST_BIAS = 0.85  # variance of b in units of R before anything is measured
BIAS_PER_S = 3e-4  # growth of the variance of b in units of R: a sensor may change in an hour
UNHEARD = 1e-5  # least share of a recogniser that is not heard, in deviations
NO_ERROR = 1e-6  # share of the variances of d where there is to be none; zero would mark a first sample

Tensor = torch.Tensor


class TwinsStep(FilterStep):
    """Active model on twins, recogniser of the noise, policy and interval; see the module."""

    actions = ACTIONS
    slow = ("recogniser.likelihood",)  # counts are large numbers, and so is what they are multiplied by

    def __init__(
        self,
        directions: Tensor,
        hidden: int = 64,
        *,
        policy_layers: int = 2,
        with_error: bool = True,
        with_recogniser: bool = True,
    ):
        """Start untrained, with a policy that does nothing.

        Args:
            directions: (M, r) orthonormal directions among the members.
            hidden: units of each layer of the policy.
            policy_layers: of the policy; 0 for one that is linear in what it sees.
            with_error: whether there is a d, what no member does.
            with_recogniser: whether the recogniser is asked; without it, b is what the filter makes of it.
        """
        super().__init__(LAWS + SCALARS)
        members, rank = directions.shape
        # Parts of the state are picked by constant vectors: the exported graph needs no slices then.
        units = torch.eye(rank + 2)
        self.unit = torch.nn.Buffer(units)
        self.of_error = torch.nn.Buffer(units[rank])
        self.of_bias = torch.nn.Buffer(units[rank + 1])
        self.of_members = torch.nn.Buffer(units[:rank].sum(dim=0))
        scaled = torch.cat([directions / math.sqrt(members - 1), torch.zeros(members, 2)], dim=1)
        self.directions = torch.nn.Buffer(scaled)
        self.no_counts = torch.nn.Buffer(torch.zeros(BINS))
        self.reach = torch.nn.Buffer(torch.tensor(REACH))
        self.share_of_error = torch.nn.Buffer(torch.tensor(1.0 if with_error else NO_ERROR))
        self.asks = torch.nn.Buffer(torch.tensor(float(with_recogniser)))
        self.features = Features(rank)
        self.recogniser = Recogniser()
        self.familiarity, self.fallback = Familiarity(), Fallback()
        self.guarded = False  # while it learns, everything is heard
        self.policy = network(LAWS + SCALARS, hidden, ACTIONS, policy_layers)
        with torch.no_grad():
            last_layer(self.policy).weight.mul_(0.1)
            last_layer(self.policy).bias.zero_()

    def start(self, variance: Tensor) -> FilterState:
        """Return the state before anything is measured, for (B,) variances R of the noise [deg^2]."""
        batch, size = len(variance), len(self.unit)
        return FilterState(
            torch.zeros(batch, size),
            self.first_covariance(variance),
            torch.zeros(batch, BINS),
            torch.zeros(batch),
            torch.zeros(batch, STATISTICS),
            *self.first_noise(variance),
        )

    def first_noise(self, variance: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return weights, bias and variance of it before anything is measured; see `FilterState`."""
        # A product, as the exported graph has no operator that makes an array of the batch's size.
        known: tuple[Tensor, Tensor, Tensor] = self.recogniser(
            variance[:, None] * self.no_counts, torch.log(variance)
        )
        return known

    def first_covariance(self, variance: Tensor) -> Tensor:
        """Return P (B, r + 2, r + 2) before anything is measured."""
        told = (FIRST_BIAS * variance)[:, None]
        of_error = FIRST_ERROR_DEG2 * self.share_of_error * self.of_error
        first: Tensor = self.of_members + of_error + told * self.of_bias
        return first[:, :, None] * self.unit

    def forward(self, *given: Any) -> tuple[Output, FilterState]:
        """Return the estimates and the states one sample later; arguments as in `predict`."""
        prior = self.predict(*given)
        return self.update(prior, self.policy(prior.features))

    def predict(
        self,
        members_deg: Tensor,
        way_mm: Tensor,
        measurement_deg: Tensor,
        variance: Tensor,
        sample_time: Tensor,
        parts: Tensor,
        state: FilterState,
    ) -> Predicted:
        """Return what is known before the policy acts.

        Args:
            members_deg: (B, M) angle of the members now [deg].
            way_mm: (B,) that the tendon has gone since the last sample [mm].
            measurement_deg: (B,) NaN where there is none [deg].
            variance: (B,) R, as told [deg^2].
            sample_time: (B,) T [s].
            parts: (2,) 1 or 0: whether the policy acts, and whether the recogniser is heard.
            state: after the sample before.
        """
        acts, hears = parts.split(1)
        middle = members_deg.mean(dim=1)
        angle = (members_deg - middle[:, None]) @ self.directions + self.of_error  # of theta on the state
        seen_as = angle + self.of_bias  # h: of the measurement

        forgotten = 1 - torch.exp(-way_mm / MEMORY_MM)  # of d
        keep = 1 - forgotten[:, None] * self.of_error
        mean = state.mean * keep
        covariance = state.covariance * (keep[:, :, None] * keep[:, None, :])
        predicted = middle + (seen_as * mean).sum(dim=1)
        towards = torch.bmm(covariance, seen_as[:, :, None])[:, :, 0]  # P h
        is_seen = ~torch.isnan(measurement_deg)
        innovation = torch.where(is_seen, measurement_deg, predicted) - predicted

        features = self.features(
            state,
            mean.detach(),
            (seen_as * towards).sum(dim=1).clamp(min=LEAST_VARIANCE).detach(),
            along(along(covariance.detach(), self.of_error), self.of_error),
            innovation.detach(),
            way_mm,
            variance,
            sample_time,
        )
        verdict = None
        if self.guarded:
            known = self.familiarity(state.weights, state.counts, torch.log(variance))
            verdict = self.fallback(hears * (1 - known), state.counts)
            acts, hears = acts * known[:, None], hears * known
        of_error = (GROWTH_DEG2_PER_MM * way_mm + GROWTH_DEG2_PER_S * sample_time) * self.share_of_error
        of_members = MEMBERS_PER_MM * way_mm[:, None] * self.of_members
        of_bias = BIAS_PER_S * (sample_time * variance)[:, None] * self.of_bias
        seen = is_seen.to(predicted.dtype)
        return Predicted(
            state=state,
            mean=mean,
            covariance=covariance,
            towards=towards,
            middle=middle,
            angle=angle,
            predicted=predicted,
            innovation=innovation,
            seen=seen,
            variance=variance,
            growth=(of_error[:, None] * self.of_error, of_members, of_bias),
            features=features,
            acts=acts,
            hears=hears * self.asks,
            verdict=verdict,
        )

    def update(self, prior: Predicted, action: Tensor) -> tuple[Output, FilterState]:
        """Return the estimates and the states after a sample.

        Args:
            prior: from `predict`.
            action: (B, ACTIONS) of the policy, before it is bounded.
        """
        state, variance, innovation, angle = prior.state, prior.variance, prior.innovation, prior.angle
        seen_as = angle + self.of_bias
        said = action * prior.acts
        on_gain, on_noise, on_error, on_members = (torch.tanh(said) * self.reach).split(1, dim=1)

        of_error, of_members, of_bias = prior.growth
        grows = of_error * torch.exp(on_error) + of_members * torch.exp(on_members) + of_bias
        covariance = prior.covariance + grows[:, :, None] * self.unit
        towards = prior.towards + grows * seen_as
        doubt = (seen_as * towards).sum(dim=1).clamp(min=LEAST_VARIANCE)
        told, counts_as = variance, prior.seen
        certain: Tensor | float = 0.0  # of b = 0, by the fallback
        if prior.verdict is not None:
            told = variance * prior.verdict.narrower
            counts_as = prior.seen * prior.verdict.bound(innovation, doubt + told)
            certain = prior.verdict.even
        gain = counts_as * torch.sigmoid(torch.log(doubt / told) + on_gain[:, 0])
        mean = prior.mean + towards * (gain * innovation / doubt)[:, None]
        shrink = (counts_as / (doubt + told * torch.exp(on_noise[:, 0])))[:, None]
        covariance = torch.baddbmm(covariance, towards[:, :, None], (towards * shrink)[:, None, :], alpha=-1)

        root = torch.sqrt(variance)
        residual = (prior.predicted + innovation - prior.middle - (seen_as * mean).sum(dim=1)) / root
        relative = (doubt / variance).detach()
        counted = prior.seen[:, None] * self.recogniser.bins(residual.detach(), relative)
        counts = state.counts * (1 - prior.seen / HISTORY)[:, None] + counted
        statistics = recent(state, prior.seen, (innovation / root).detach(), relative)
        weights, bias, bias_variance = self.recogniser(counts * self.asks, torch.log(variance))
        samples = state.samples + prior.seen
        after = FilterState(mean, covariance, counts, samples, statistics, weights, bias, bias_variance)

        with_b = along(covariance, self.of_bias)  # covariance of the state with b, and with the angle:
        trust = towards * (1 - doubt[:, None] * shrink) - with_b
        with_bias, own = along(trust, self.of_bias), along(with_b, self.of_bias)
        sure = prior.hears.clamp(min=UNHEARD) ** 2 / bias_variance
        heard = with_bias / (own + variance / (sure + certain))
        believed = bias * root * sure / (sure + certain)
        bend = prior.middle + (angle * mean).sum(dim=1) + heard * (believed - along(mean, self.of_bias))
        left = ((angle * trust).sum(dim=1) - heard * with_bias).clamp(min=LEAST_VARIANCE)
        deviation = torch.sqrt(left)
        half_width = deviation * self.widen(prior.features)
        return Output(bend, half_width, bias, bias_variance, said, deviation, prior.features), after
