"""The active model as an unscented Kalman filter, for models that are nonlinear in the angle.

Julier and Uhlmann (1997), scaled as Wan and van der Merwe (2000): the mean and the covariance of five points
of [theta, f], carried through the model itself, take the place of a slope.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.gaussian import Belief
from twin.estimation.registry import MethodSpec, register_method
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class UnscentedActiveModel(ActiveModel):
    """The active model without a slope.

    A small alpha, 1e-3 as often printed, gives weights of 1e6 that cancel and costs 6 digits of the mean.
    At alpha = 1 they lie between 1/6 and 1/3, the filter equals the plain one on a linear model to 1e-10, and
    the covariance is positive whatever the model. kappa = 3 - n then matches the fourth moment of a normal
    angle, with beta = 0: Wan and van der Merwe's beta = 2 does that for alpha near 0, in general it is
    beta = 2 (1 - alpha^2).

    Attributes:
        alpha: spread of the points, above 0.
        beta: what is added to the weight of the centre in the covariance.
        kappa: second parameter of the spread, above -2.
    """

    alpha: float = 1.0
    beta: float = 0.0
    kappa: float = 1.0

    def __post_init__(self) -> None:
        if not (self.alpha > 0 and self.kappa > -2):
            raise InputError(
                f"no points for alpha = {self.alpha}, kappa = {self.kappa}; valid: alpha > 0, kappa > -2"
            )

    def predict(self, belief: Belief, pull_mm: Array, previous_pull_mm: Array) -> Belief:
        """Advance the belief by one sample, point by point."""
        points = sigma_points(belief.mean, belief.covariance, self.alpha, self.kappa)
        moved = np.empty_like(points)
        # The model knows nothing of f, so that points with one angle share a step: 0, 2 and 4.
        moved[0, 0], memory = self.model.step(points[0, 0], belief.memory, pull_mm, previous_pull_mm)
        moved[0, 2] = moved[0, 4] = moved[0, 0]
        for point in (1, 3):
            moved[0, point], _ = self.model.step(points[0, point], belief.memory, pull_mm, previous_pull_mm)
        moved[0] += points[1] * self.sample_time
        moved[1] = points[1]
        mean_weights, weights = self._weights()
        mean = np.einsum("s,isb->ib", mean_weights, moved)
        off = moved - mean[:, None]
        covariance = np.einsum("isb,jsb->ijb", weights[:, None] * off, off)
        covariance = (covariance + covariance.swapaxes(0, 1)) / 2
        return Belief(mean, covariance + np.diag(self.process_variance)[:, :, None], memory)

    def _weights(self) -> tuple[Array, Array]:
        """Weights (5,) of the points in the mean and in the covariance (Wan and van der Merwe, eq. 15)."""
        spread = 2 * self.alpha**2 + self.alpha**2 * self.kappa  # n + lambda
        mean = np.full(5, 0.5 / spread)
        mean[0] = 1 - 2 / spread
        covariance = mean.copy()
        covariance[0] += 1 - self.alpha**2 + self.beta
        return mean, covariance


def sigma_points(mean: Array, covariance: Array, alpha: float, kappa: float) -> Array:
    """Return the points (2, 5, B): the mean (2, B), and beside it the columns of a root of (n + lambda) P.

    The points 2 and 4 have the mean's first coordinate: the root is Cholesky's, lower triangular.
    """
    root = alpha * np.sqrt(2 + kappa) * cholesky(covariance)
    points = np.repeat(mean[:, None], 5, axis=1)
    points[:, 1:3] += root
    points[:, 3:5] -= root
    return points


def cholesky(covariance: Array) -> Array:
    """Return the lower triangular root (2, 2, B) of covariances (2, 2, B).

    Rounding may leave a covariance on the edge of what has a root; the nearest that has one is taken.
    """
    root = np.zeros_like(covariance)
    root[0, 0] = np.sqrt(np.maximum(covariance[0, 0], 0))
    np.divide(covariance[1, 0], root[0, 0], out=root[1, 0], where=root[0, 0] > 0)
    root[1, 1] = np.sqrt(np.maximum(covariance[1, 1] - root[1, 0] ** 2, 0))
    return root


register_method(
    MethodSpec(
        name="UKF",
        noise_information="R",
        build=lambda known: UnscentedActiveModel(known.reference, known.sample_time),
        models=(ColemanHodgdon.name,),
    )
)
