"""The active model that finds R itself, by variational Bayes (Sarkka and Nummenmaa 2009).

R has an inverse-gamma belief of shape alpha and scale beta. Each measurement, with forgetting rho,

    alpha <- rho alpha + 1 / 2,    beta <- rho beta + ((y - theta)^2 + P_theta) / 2,    R = beta / alpha,

where theta and P_theta are those after an update with this very R: a fixed point, reached by iteration.
What the filter cannot explain, an error of its model too, counts as noise of the sensor.
"""

import dataclasses
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ANGLE, ActiveModel
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import Belief, innovation_of
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.tuning import TUNED

Array = NDArray[np.float64]
ITERATIONS = 5


class AdaptiveBelief(NamedTuple):
    """Belief in the state of B filters and in the variance of their measurements.

    Attributes:
        state: belief in angle and model error.
        shape: alpha, (B,).
        scale: beta, (B,) [deg^2].
    """

    state: Belief
    shape: Array
    scale: Array

    @property
    def measurement_variance(self) -> Array:
        """(B,) R [deg^2]."""
        return self.scale / self.shape


@dataclasses.dataclass(frozen=True)
class AdaptiveActiveModel(Estimator[AdaptiveBelief]):
    """An active model whose R is where the search begins: the one told, or its own if it is never told.

    Attributes:
        active_model: the filter; its R is the first guess.
        forgetting: rho: what is left of the evidence after a measurement; it remembers about 1 / (1 - rho) of
            them.
        first_shape: alpha at the first sample: the first guess weighs as 2 alpha measurements; 0.98 settles
            at 25.
    """

    active_model: ActiveModel
    forgetting: float = 0.98
    first_shape: float = 25.0

    def __post_init__(self) -> None:
        """Refuse a forgetting factor that is none.

        Raises:
            ValueError: a parameter is out of range.
        """
        if not 0 < self.forgetting <= 1:
            raise InputError(f"forgetting = {self.forgetting}: must be above 0 and at most 1")
        if not self.first_shape > 0:
            raise InputError(f"first_shape = {self.first_shape}: must be positive")

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that begins at the sensor's variance."""
        return dataclasses.replace(self, active_model=self.active_model.with_sensor(sensor))

    def start(self, pull_mm: Array, bend_deg: Array) -> AdaptiveBelief:
        """Return the belief at the first sample."""
        shape = np.full(bend_deg.size, float(self.first_shape))
        scale = shape * np.asarray(self.active_model.measurement_variance, dtype=float)
        return AdaptiveBelief(self.active_model.start(pull_mm, bend_deg), shape, scale)

    def step(
        self, state: AdaptiveBelief, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> AdaptiveBelief:
        """Predict, then find the update and R together; without a measurement nothing of R is forgotten."""
        predicted = self.active_model.predict(state.state, pull_mm, previous_pull_mm)
        seen = ~np.isnan(measurement_deg)
        shape = np.where(seen, self.forgetting * state.shape + 0.5, state.shape)
        kept = self.forgetting * state.scale
        innovation, spread = innovation_of(predicted.mean, predicted.covariance, ANGLE, measurement_deg)
        innovation = np.where(seen, innovation, 0.0)
        scale = kept
        for _ in range(ITERATIONS):
            variance = scale / shape
            left = variance / (spread + variance)  # of the innovation, and of the spread, by this update
            scale = kept + ((left * innovation) ** 2 + left * spread) / 2
        updated = dataclasses.replace(self.active_model, measurement_variance=variance).update(
            predicted, measurement_deg
        )
        return AdaptiveBelief(updated, shape, np.where(seen, scale, state.scale))

    def bend_deg(self, state: AdaptiveBelief) -> Array:
        """Return the (B,) mean of the angle [deg]."""
        return self.active_model.bend_deg(state.state)

    @property
    def states_interval(self) -> bool:
        """True where the filter states one."""
        return self.active_model.states_interval

    def half_width_deg(self, state: AdaptiveBelief) -> Array:
        """Return half of the (B,) 95 % intervals of the filter [deg]."""
        return self.active_model.half_width_deg(state.state)


register_method(
    MethodSpec(
        name="VB",
        noise_information="R, to begin with",
        build=lambda known: AdaptiveActiveModel(TUNED.filter(known)),
        models=(TUNED.model,),
        fits=(TUNED,),
    )
)
