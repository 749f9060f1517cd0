"""A particle filter whose particles are twins: a nonlinear weighing of the ensemble, below the linear limit.

The belief of the coefficients of `EnsembleFilter` is no single normal law but a mixture, one narrow law about
each member (a Gaussian sum, Alspach and Sorenson 1972). Members are drawn towards their mean as far as the
laws are wide, so that mean and covariance stay those of the ensemble (West 1993). Every law is updated by the
same gains; its weight is multiplied by the likelihood of the measurement under it. Gains do not differ from
law to law, so that the laws of all filters of one noise keep the same places about their filter's mean.

With laws as wide as the ensemble it is the linear filter. Where the density of the noise is rough, so is the
weighing, and laws are nearly as wide as that. Where an innovation moves the belief by the score
of a density, the score is taken at the mean of the mixture, and is linear about it.
"""

import dataclasses
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.estimation.ensemble import EnsembleFilter, sole_measurement
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import half_width_of

Array = NDArray[np.float64]
BANDWIDTH = 0.7
"""Width of a law, as a share of the ensemble's. Chosen on reduced twins that no test has: 0.5 to 0.9 are all
below the linear limit, and 0.3 is above it for some noises, as few laws are left to count."""
ROUGH_BANDWIDTH = 0.95
"""The same where the density of the noise is rough. Chosen on such twins too: 0.95 is 1 to 3 % below the
linear limit, and 0.7 level with it or above."""


class ParticleState(NamedTuple):
    """Mixtures of B filters.

    Attributes:
        sample: number of the latest sample.
        centre: (M, B) coefficients that the places of the laws are counted from.
        places: (M, M) of the law of each member about the centre, a column each.
        covariance: (M, M) of each law.
        log_weights: (M, B) of the laws: the logarithm of how likely each made what was measured.
    """

    sample: int
    centre: Array
    places: Array
    covariance: Array
    log_weights: Array

    @property
    def log_evidence(self) -> Array:
        """Logarithm (B,) of how likely all laws together made what was measured."""
        top = self.log_weights.max(axis=0)
        found: Array = top + np.log(np.mean(np.exp(self.log_weights - top), axis=0))
        return found


@dataclasses.dataclass(frozen=True)
class ParticleFilter(Estimator[ParticleState]):
    """Particles along one command: all B filters follow that command and have one sensor.

    Attributes:
        ensemble: members, and what is known of the noise.
        bandwidth: h, width of a law as a share of that of the ensemble, from 0 to 1; None for that which
            suits the density of the noise.
    """

    ensemble: EnsembleFilter
    bandwidth: float | None = None

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R.

        Raises:
            ValueError: the filters of the batch have different sensors.
        """
        return dataclasses.replace(self, ensemble=self.ensemble.with_sensor(sensor))

    def start(self, pull_mm: Array, bend_deg: Array) -> ParticleState:
        """Return the state at the first sample; the initial estimate is not used."""
        count, batch = len(self.ensemble.members_deg), bend_deg.size
        members = np.sqrt(count - 1) * (np.eye(count) - 1 / count)
        density, width = self.ensemble.density, self.bandwidth
        if width is None:
            width = ROUGH_BANDWIDTH if density is not None and density.rough else BANDWIDTH
        return ParticleState(
            0,
            np.zeros((count, batch)),
            np.sqrt(1 - width**2) * members,
            width**2 * np.eye(count),
            np.zeros((count, batch)),
        )

    def step(
        self, state: ParticleState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> ParticleState:
        """Move and weigh the laws by one measurement, which is there for all filters or for none.

        Raises:
            ValueError: it is there for some of them only.
        """
        of = self.ensemble
        sample = min(state.sample + 1, of.members_deg.shape[1] - 1)
        if not sole_measurement(measurement_deg):
            return state._replace(sample=sample)
        mean, anomaly = of.mean_and_anomaly(sample)
        towards = state.covariance @ anomaly
        spread = float(np.sqrt(max(float(anomaly @ towards), 0.0)))
        away = anomaly @ state.places  # (M,) angle of each law about the centre's
        innovation = measurement_deg - mean - anomaly @ state.centre
        middle = away @ normed(state.log_weights)
        score, information = of.weigh(innovation - middle, spread)
        likelihood = of.log_likelihood(innovation - away[:, None], spread)
        taken = information * towards
        return ParticleState(
            sample,
            state.centre + np.outer(towards, score + information * middle),
            state.places - np.outer(taken, away),
            state.covariance - np.outer(taken, towards),
            state.log_weights + likelihood,
        )

    def bend_deg(self, state: ParticleState) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        mean, anomaly = self.ensemble.mean_and_anomaly(state.sample)
        away = anomaly @ state.places
        return mean + anomaly @ state.centre + away @ normed(state.log_weights)

    @property
    def states_interval(self) -> bool:
        """True: the laws that are left differ by what is not known, if the twin is like them."""
        return True

    def half_width_deg(self, state: ParticleState) -> Array:
        """Return half of the (B,) 95 % intervals of a normal law of the mixture's variance [deg]."""
        _, anomaly = self.ensemble.mean_and_anomaly(state.sample)
        away, weights = anomaly @ state.places, normed(state.log_weights)
        between = away**2 @ weights - (away @ weights) ** 2
        return half_width_of(anomaly @ state.covariance @ anomaly + np.maximum(between, 0.0))


def normed(log_weights: Array) -> Array:
    """Return (n, B) weights that add up to one, by their logarithms."""
    weights = np.exp(log_weights - log_weights.max(axis=0))
    normed: Array = weights / weights.sum(axis=0)
    return normed
