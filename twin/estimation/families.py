"""A bank of filters of twins, one for each law that the noise may have: what can be known without being told.

The limit of the benchmark is told the density of the noise, which no device knows. Here it is told R and a
list of families alone. Each family has a particle filter of its own, told the density that it would have with
that R; each is weighed by how likely it made all measurements (the marginal likelihood, Bayes). Estimate and
variance are those of the mixture.
"""

import dataclasses
from typing import Self

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import DEVIATIONS_OF_95, half_width_of
from twin.estimation.particles import ParticleFilter, ParticleState, normed

Array = NDArray[np.float64]
FamilyState = tuple[ParticleState, ...]
"""State of the filter of each family."""


@dataclasses.dataclass(frozen=True)
class FamilyFilter(Estimator[FamilyState]):
    """Particle filters along one command, one for each family of noise.

    Attributes:
        filters: of the families, equally likely before anything is measured; of the same members.
    """

    filters: tuple[ParticleFilter, ...]

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter itself: its densities say the variance."""
        return self

    def start(self, pull_mm: Array, bend_deg: Array) -> FamilyState:
        """Return the state at the first sample; the initial estimate is not used."""
        return tuple(each.start(pull_mm, bend_deg) for each in self.filters)

    def step(
        self, state: FamilyState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> FamilyState:
        """Step the filter of each family.

        Raises:
            ValueError: a measurement is there for some of the batch only.
        """
        return tuple(
            each.step(of, pull_mm, previous_pull_mm, measurement_deg)
            for each, of in zip(self.filters, state, strict=True)
        )

    def bend_deg(self, state: FamilyState) -> Array:
        """Return the (B,) mean of the angle over families [deg]."""
        mean: Array = np.sum(self.weights(state) * self._bends(state), axis=0)
        return mean

    @property
    def states_interval(self) -> bool:
        """True: it has those of its filters."""
        return True

    def half_width_deg(self, state: FamilyState) -> Array:
        """Return half of the (B,) 95 % intervals of a normal law of the mixture's variance [deg]."""
        weights, bends = self.weights(state), self._bends(state)
        widths = np.array([each.half_width_deg(of) for each, of in zip(self.filters, state, strict=True)])
        within = np.sum(weights * (widths / DEVIATIONS_OF_95) ** 2, axis=0)
        mean = np.sum(weights * bends, axis=0)
        return half_width_of(within + np.sum(weights * (bends - mean) ** 2, axis=0))

    def weights(self, state: FamilyState) -> Array:
        """Return the (families, B) probabilities of the families."""
        return normed(np.array([of.log_evidence for of in state]))

    def _bends(self, state: FamilyState) -> Array:
        return np.array([each.bend_deg(of) for each, of in zip(self.filters, state, strict=True)])
