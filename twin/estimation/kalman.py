"""The active model as a plain Kalman filter (Kalman 1960), for models that are affine in the angle.

Given the command, eq. 4 of the RAM paper reads x_k = F_k x_{k-1} + u_k with x = [theta, f]: nothing is left
for an extended filter to linearise. This filter finds F_k and u_k from two steps of the model, without its
slope.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.gaussian import Belief, propagate
from twin.estimation.registry import MethodSpec, register_method
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class KalmanActiveModel(ActiveModel):
    """The active model without linearisation.

    Raises:
        ValueError: the model is not affine in the angle.
    """

    def __post_init__(self) -> None:
        if not self.model.affine:
            raise InputError(
                f"the model {self.model.name!r} is not affine in the angle, as a plain Kalman filter needs; "
                "valid filters: ActiveModel, an extended one (EKF), and UnscentedActiveModel (UKF)"
            )

    def predict(self, belief: Belief, pull_mm: Array, previous_pull_mm: Array) -> Belief:
        """Advance the belief by x_k = F_k x_{k-1} + u_k."""
        zero = np.zeros_like(belief.mean[0])
        drive, memory = self.model.step(zero, belief.memory, pull_mm, previous_pull_mm)
        one, _ = self.model.step(zero + 1, belief.memory, pull_mm, previous_pull_mm)
        transition = np.empty_like(belief.covariance)  # F_k
        transition[0, 0] = one - drive
        transition[0, 1] = self.sample_time
        transition[1, 0] = 0
        transition[1, 1] = 1
        mean = np.einsum("ijb,jb->ib", transition, belief.mean)
        mean[0] += drive  # u_k = [drive, 0]
        return Belief(mean, propagate(belief.covariance, transition, np.diag(self.process_variance)), memory)


register_method(
    MethodSpec(
        name="KF",
        noise_information="R",
        build=lambda known: KalmanActiveModel(known.reference, known.sample_time),
        models=(ColemanHodgdon.name,),
    )
)
