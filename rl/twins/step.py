"""One sample of RAM (twins) as a module of torch: trained, exported and deployed as it stands here.

The active model (eqs. 4-9) predicts by M twins that follow the command:

    theta = mean of the members + c . a + d,      y = theta + noise,

where a are the anomalies of the members along r fixed directions, c their coefficients (Evensen 2003) and d
what no member does, which decays with the way of the tendon (`rl/twins/motion.py`). It is told R. What else
the noise is, its mean above all, is recognised: a bank of such filters, one for each law that the noise may
have, is weighed by what is measured (`rl/twins/bank.py`).

RAM (eq. 10) then adds K_RAM phi, phi = y - y_AM, along the filter's own direction P a. Of the gains it is the
*sum* that is bounded,

    K_AM + (1 - K_AM) K_RAM = sigmoid(logit K_AM + 5 tanh u)    in [0, 1],

for each part of each law, so that K_RAM may be negative: it takes back what the active model believed of an
outlier. Three more actions set the R by which P shrinks, the growth of d and that of c. A policy that does
nothing (u = 0) changes nothing.

Beside it goes the filter alone, which is told R and nothing more (`rl/twins/plain_filter.py`). Where the
noise is like none of the training (`rl/twins/familiarity.py`), recogniser and policy fall silent, and the
filter alone is left, as a robust one (`rl/twins/fallback.py`).
"""

import math
from typing import Any

import torch

from rl.twins.bank import HISTORY, Bank, BankState
from rl.twins.fallback import Fallback
from rl.twins.familiarity import Familiarity
from rl.twins.features import SCALARS, Features, recent
from rl.twins.filter_state import STATISTICS, FilterState, Predicted
from rl.twins.filter_step import LEAST_VARIANCE, FilterStep, Output
from rl.twins.histogram import BINS, ResidualHistogram
from rl.twins.motion import MemberMotion
from rl.twins.networks import last_layer, network
from rl.twins.plain_filter import PlainFilter
from rl.twins.products import along

ACTIONS = 4  # on the total gain, on R for the covariance, on the growth of d, on that of c
REACH = (5.0, 4.0, 3.0, 3.0)  # of the actions, in logarithms

Tensor = torch.Tensor


class TwinsStep(FilterStep):
    """Active model on twins, recogniser of the noise, policy and interval; see the module.

    Attributes:
        guarded: whether recogniser and policy fall silent under strange noise; while it learns, all is heard.
        goes_along: whether the filter alone is computed too; while the policy learns, nothing asks for it.
    """

    actions = ACTIONS
    slow = tuple(f"bank.laws.{name}" for name in ("places", "weights", "widths", "effective"))

    def __init__(
        self,
        directions: Tensor,
        laws: int,
        hidden: int = 96,
        *,
        policy_layers: int = 2,
        with_error: bool = True,
    ):
        """Start untrained, with a policy that does nothing.

        Args:
            directions: (M, r) orthonormal directions among the members.
            laws: J, of the noise.
            hidden: units of each layer of the policy.
            policy_layers: of the policy; 0 for one that is linear in what it sees.
            with_error: whether there is a d, what no member does.
        """
        super().__init__(laws + SCALARS)
        members, rank = directions.shape
        scaled = torch.cat([directions / math.sqrt(members - 1), torch.zeros(members, 1)], dim=1)
        self.directions = torch.nn.Buffer(scaled)
        self.reach = torch.nn.Buffer(torch.tensor(REACH))
        self.motion = MemberMotion(rank, with_error=with_error)
        self.bank = Bank(self.motion, laws)
        self.plain = PlainFilter(self.motion)
        self.features = Features(self.motion)
        self.histogram = ResidualHistogram()
        self.familiarity, self.fallback = Familiarity(laws), Fallback()
        self.guarded, self.goes_along = False, True
        self.policy = network(laws + SCALARS, hidden, ACTIONS, policy_layers)
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
            *self.bank.start(variance),
        )

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
        angle = (members_deg - middle[:, None]) @ self.directions + self.motion.of_error
        keep = self.motion.keep(way_mm)
        bank = self.bank.predict(_of_bank(state), angle, keep, variance)
        belief = bank.belief

        offset = (belief.weights * bank.offset).sum(dim=1)
        expected = offset + belief.bias * torch.sqrt(variance)
        is_seen = ~torch.isnan(measurement_deg)
        measured = torch.where(is_seen, measurement_deg - middle, expected)
        innovation = (measured - expected).detach()
        doubt = (angle * bank.towards).sum(dim=1).clamp(min=LEAST_VARIANCE).detach()
        of_error = along(along(bank.covariance.detach(), self.motion.of_error), self.motion.of_error)
        mean = (belief.weights[:, :, None] * bank.rows).sum(dim=1).detach()
        features = self.features(
            state, belief, mean, doubt, of_error, innovation, way_mm, variance, sample_time
        )
        verdict = None
        if self.guarded:
            known = self.familiarity(belief.weights, state.counts, torch.log(variance))
            verdict = self.fallback(hears * (1 - known), state.counts)
            acts, hears = acts * known[:, None], hears * known
        return Predicted(
            state=state,
            bank=bank,
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
            acts=acts,
            hears=hears,
            verdict=verdict,
        )

    def update(self, prior: Predicted, action: Tensor) -> tuple[Output, FilterState]:
        """Return the estimates and the states after a sample.

        Args:
            prior: from `predict`.
            action: (B, ACTIONS) of the policy, before it is bounded.
        """
        state, seen = prior.state, prior.seen
        said = action * prior.acts
        on_gain, on_noise, on_error, on_members = (torch.tanh(said) * self.reach).split(1, dim=1)
        of_error, of_members = prior.growth
        bank, of_bank = self.bank.update(
            prior.bank,
            of_error * torch.exp(on_error) + of_members * torch.exp(on_members),
            prior.measured,
            seen,
            prior.variance,
            on_gain[:, 0],
            on_noise[:, 0],
        )
        offset, variance = bank.offset, bank.variance
        mean, covariance, counts = state.mean, state.covariance, state.counts
        if self.goes_along:
            given = prior.bank.angle, prior.keep, of_error + of_members, prior.measured, seen
            alone, mean, covariance = self.plain(
                mean, covariance, *given, prior.variance, prior.sample_time, prior.verdict
            )
            counted = seen[:, None] * self.histogram(alone.residual, alone.doubt)
            counts = counts * (1 - seen / HISTORY)[:, None] + counted
            hears, apart = prior.hears, offset - alone.offset
            offset = alone.offset + hears * apart
            variance = hears * variance + (1 - hears) * (alone.variance + hears * apart * apart)
        statistics = recent(state, seen, prior.innovation, prior.doubt)
        after = FilterState(mean, covariance, counts, state.samples + seen, statistics, *of_bank)

        deviation = torch.sqrt(variance.clamp(min=LEAST_VARIANCE))
        half_width = deviation * self.widen(prior.features)
        bend, belief = prior.middle + offset, bank.belief
        return Output(
            bend, half_width, belief.bias, belief.bias_variance, said, deviation, prior.features
        ), after


def _of_bank(state: FilterState) -> BankState:
    return BankState(state.rows, state.rows_covariance, state.evidence)
