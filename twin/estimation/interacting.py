"""Interacting multiple models: active models of different Q side by side, weighed by what they explain.

One filter trusts the model as far as on the endoscope that it was identified on, the other as far as on
randomised twins. Between samples a device may go from one to the other by a Markov chain: the beliefs are
mixed by its probabilities, each filter takes its step, and the probability of each is multiplied by the
likelihood of the measurement under it (Blom and Bar-Shalom 1988).
"""

import dataclasses
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import Belief, half_width_of
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.tuning import TUNED
from twin.estimation.tuning_on_twins import TUNED_ON_TWINS

Array = NDArray[np.float64]
STAYS = 0.95
"""Probability that a device is the same kind at the next sample as at this one."""


class InteractingState(NamedTuple):
    """Beliefs of K filters, each of B records, and how likely each filter is.

    Attributes:
        beliefs: of each filter.
        probability: (K, B).
    """

    beliefs: tuple[Belief, ...]
    probability: Array


@dataclasses.dataclass(frozen=True)
class InteractingModels(Estimator[InteractingState]):
    """Active models that share one state and differ in their variances.

    Attributes:
        filters: K of them.
        stays: probability that the same one holds at the next sample.
    """

    filters: tuple[ActiveModel, ...]
    stays: float = STAYS

    def __post_init__(self) -> None:
        """Refuse what cannot interact.

        Raises:
            ValueError: there are fewer than two filters, or the probability is none.
        """
        if len(self.filters) < 2:
            raise InputError(f"{len(self.filters)} filters: interacting models are at least two")
        if not 0 < self.stays < 1:
            raise InputError(f"stays = {self.stays}: must be above 0 and below 1")

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filters that take the sensor's variance as R."""
        return dataclasses.replace(self, filters=tuple(of.with_sensor(sensor) for of in self.filters))

    def start(self, pull_mm: Array, bend_deg: Array) -> InteractingState:
        """Return the state at the first sample: all filters are equally likely."""
        count = len(self.filters)
        beliefs = tuple(of.start(pull_mm, bend_deg) for of in self.filters)
        return InteractingState(beliefs, np.full((count, bend_deg.size), 1 / count))

    def step(
        self, state: InteractingState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> InteractingState:
        """Mix, predict, update and weigh by one sample."""
        count = len(self.filters)
        chain = np.full((count, count), (1 - self.stays) / (count - 1))
        np.fill_diagonal(chain, self.stays)
        before = chain.T @ state.probability  # of each filter at this sample, unmeasured
        beliefs, logs = [], []
        for place, filter_ in enumerate(self.filters):
            shares = chain[:, place, None] * state.probability / before[place]
            belief = filter_.predict(_mixed(state.beliefs, shares, place), pull_mm, previous_pull_mm)
            logs.append(filter_.log_likelihood(belief, measurement_deg))
            beliefs.append(filter_.update(belief, measurement_deg))
        likelihood = np.array(logs)
        weights = before * np.exp(likelihood - likelihood.max(axis=0))
        return InteractingState(tuple(beliefs), weights / weights.sum(axis=0))

    def bend_deg(self, state: InteractingState) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        bend: Array = np.sum(state.probability * [of.mean[0] for of in state.beliefs], axis=0)
        return bend

    @property
    def states_interval(self) -> bool:
        """True: the filters say how sure they are, and how far they are apart."""
        return True

    def half_width_deg(self, state: InteractingState) -> Array:
        """Return half of the (B,) 95 % intervals of a normal law of the mixture's variance [deg]."""
        angle = np.array([of.mean[0] for of in state.beliefs])
        within = np.array([of.covariance[0, 0] for of in state.beliefs])
        away = angle - self.bend_deg(state)
        return half_width_of(np.sum(state.probability * (within + away**2), axis=0))


def _mixed(beliefs: tuple[Belief, ...], shares: Array, place: int) -> Belief:
    """Return the belief of all filters in (K, B) shares as one; what a model remembers is that of a place."""
    means = np.array([of.mean for of in beliefs])
    mean = np.einsum("kb,knb->nb", shares, means)
    away = means - mean
    covariances = np.array([of.covariance for of in beliefs]) + away[:, :, None] * away[:, None, :]
    return Belief(mean, np.einsum("kb,knmb->nmb", shares, covariances), beliefs[place].memory)


def _build(known: Knowledge) -> InteractingModels:
    return InteractingModels((TUNED.filter(known), TUNED_ON_TWINS.filter(known)))


register_method(
    MethodSpec(
        name="IMM",
        noise_information="R",
        build=_build,
        models=(TUNED.model,),
        fits=(TUNED, TUNED_ON_TWINS),
    )
)
