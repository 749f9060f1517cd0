"""The active model with a bias of the sensor as third state: y = theta + bias + noise (Friedland 1969).

The state is X = [theta, f, bias]. A measurement sees the sum of angle and bias alone; what tells them apart
is that the model pins the absolute angle: Coleman and Hodgdon's draws theta towards b l wherever the tendon
moves. A bias found so is only as good as that pin: an error in the model's level is taken for a bias, and so
is a wrong first angle where `initial_variance` trusts it more than `bias_variance` trusts the sensor.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.gaussian import Belief, condition
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.tuning import TUNED

Array = NDArray[np.float64]
BIASED_ANGLE = np.array([1.0, 0.0, 1.0])  # the sensor sees the angle and the bias


@dataclasses.dataclass(frozen=True)
class BiasedActiveModel(ActiveModel):
    """The active model for a sensor that may be off by a constant, or by a slow drift.

    Attributes:
        bias_variance: of the bias at the first sample, where zero is expected [deg^2].
        bias_process_variance: of its random walk, per sample; 1e-6 is 0.02 deg in a minute at 0.1 s, zero a
            constant [deg^2].
    """

    bias_variance: float = 1.0
    bias_process_variance: float = 1e-6

    def start(self, pull_mm: Array, bend_deg: Array) -> Belief:
        """Return the belief at the first sample: no known error of the model and no known bias."""
        pair = super().start(pull_mm, bend_deg)
        mean = np.concatenate([pair.mean, np.zeros((1, bend_deg.size))])
        covariance = np.zeros((3, 3, bend_deg.size))
        covariance[:2, :2] = pair.covariance
        covariance[2, 2] = self.bias_variance
        return Belief(mean, covariance, pair.memory)

    def resume(self, trusted: Belief, pull_mm: Array, bend_deg: Array) -> Belief:
        """Begin anew with the bias that was known: it takes minutes to find."""
        belief = self.start(pull_mm, bend_deg - trusted.mean[2])
        belief.mean[2] = trusted.mean[2]
        belief.covariance[2, 2] = trusted.covariance[2, 2]
        return belief

    def predict(self, belief: Belief, pull_mm: Array, previous_pull_mm: Array) -> Belief:
        """Advance the belief by one sample: angle and error as the active model does, the bias stays."""
        pair = Belief(belief.mean[:2], belief.covariance[:2, :2], belief.memory)
        ahead = super().predict(pair, pull_mm, previous_pull_mm)
        slope = self.model.slope(belief.mean[0], pull_mm, previous_pull_mm)
        with_angle, with_error = belief.covariance[0, 2], belief.covariance[1, 2]
        covariance = np.empty_like(belief.covariance)
        covariance[:2, :2] = ahead.covariance
        covariance[0, 2] = covariance[2, 0] = slope * with_angle + self.sample_time * with_error
        covariance[1, 2] = covariance[2, 1] = with_error
        covariance[2, 2] = belief.covariance[2, 2] + self.bias_process_variance
        return Belief(np.concatenate([ahead.mean, belief.mean[2:]]), covariance, ahead.memory)

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on one measurement of the angle and the bias together."""
        mean, covariance = condition(
            belief.mean, belief.covariance, BIASED_ANGLE, measurement_deg, self.measurement_variance
        )
        return Belief(mean, covariance, belief.memory)


register_method(
    MethodSpec(
        name="AM with bias",
        noise_information="R",
        build=lambda known: TUNED.filter(known, BiasedActiveModel),
        models=(TUNED.model,),
        fits=(TUNED,),
    )
)
