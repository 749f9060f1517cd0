"""The active model with Huber's update: a measurement far from the prediction counts for less.

Huber 1964; in Kalman filters Boncelet and Dickinson 1983, Karlgaard 2015. The updated state minimises

    (x - x_k|k-1)' P^-1 (x - x_k|k-1) / 2 + rho((y - theta) / sqrt(R)),

where rho(z) is z^2 / 2 up to the threshold k and rises linearly beyond it. The prediction stays
Gaussian: what it has wrong, a first angle or the model, makes measurements look like outliers too.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ANGLE, ActiveModel
from twin.estimation.gaussian import Belief, condition, innovation_of
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.tuning import TUNED

Array = NDArray[np.float64]
HUBER_THRESHOLD = 1.345  # 95 % as efficient as least squares where the noise is Gaussian (Huber 1964)


@dataclasses.dataclass(frozen=True)
class RobustActiveModel(ActiveModel):
    """The active model that trusts a measurement less the further it is off; infinite threshold: the same.

    Attributes:
        threshold: k: standard deviations sqrt(R) that the residual after the update may have at full weight.
    """

    threshold: float = HUBER_THRESHOLD

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on one measurement, its variance inflated where it is far off."""
        innovation, spread = innovation_of(belief.mean, belief.covariance, ANGLE, measurement_deg)
        told = np.asarray(self.measurement_variance, dtype=float)
        variance = huber_variance(np.abs(innovation), spread, told, self.threshold)
        mean, covariance = condition(belief.mean, belief.covariance, ANGLE, measurement_deg, variance)
        return Belief(mean, covariance, belief.memory)


def huber_variance(distance: Array, spread: Array, variance: Array, threshold: float) -> Array:
    """Return the variance with which a Kalman update is Huber's.

    Reweighting sets R / w with w = k sqrt(R) / |r| where the residual r = nu R_w / (P + R_w) is too large,
    and repeats. With one scalar measurement the fixed point can be written down: R_w = |nu| sqrt(R) / k - P.

    Args:
        distance: (B,) magnitude of the innovation nu [deg]; NaN where there is no measurement.
        spread: (B,) variance that the prediction gives the measurement, P [deg^2].
        variance: R, scalar or (B,) [deg^2].
        threshold: k.
    """
    inflated = np.nan_to_num(distance) * np.sqrt(variance) / threshold - spread
    return np.maximum(variance, inflated)


register_method(
    MethodSpec(
        name="Huber",
        noise_information="R",
        build=lambda known: TUNED.filter(known, RobustActiveModel),
        models=(TUNED.model,),
        fits=(TUNED,),
    )
)
