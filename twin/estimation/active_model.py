"""The active model (AM), eqs. 4-9: a Kalman filter of the bending angle and of the error of its model.

The state is X = [theta, f]: the bending angle [deg] and the error of the model of hysteresis [deg / s], a
random walk. It is an extended filter (EKF), as in the paper; on a model that is affine in the angle it equals
the plain one (KF, Kalman 1960), for any other there is the unscented one (UKF, Julier and Uhlmann 1997).
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Sensor, SingleForm
from twin.estimation.gaussian import Belief, GaussianFilter, condition, propagate
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.two_states import TwoStatesForm
from twin.files.shown import shown
from twin.hysteresis import ColemanHodgdon, HysteresisModel, model_from_dict, model_to_dict

Array = NDArray[np.float64]
METHOD = "AM"  # name of the method in tables
ANGLE = np.array([1.0, 0.0])  # Omega: the sensor sees the angle


@dataclasses.dataclass(frozen=True)
class ActiveModel(GaussianFilter):
    """Parameters of the extended Kalman filter.

    Attributes:
        model: the reference model.
        sample_time: T [s].
        process_variance: diagonal of Q: of the angle [deg^2] and of the error [deg^2 / s^2] per sample; small
            as the paper's.
        measurement_variance: R [deg^2], one for all filters or (B,).
        initial_variance: diagonal of P at the first sample; not published; as small as Q: the first estimate
            is trusted.
    """

    model: HysteresisModel
    sample_time: float
    process_variance: tuple[float, float] = (1e-3, 1e-3)
    measurement_variance: ArrayLike = 0.1
    initial_variance: tuple[float, float] = (1e-2, 1e-2)

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def over(self, elapsed_s: float) -> Self:
        """Return the filter of another T [s]; Q is a random walk's: it grows with the time."""
        of_bend, of_error = self.process_variance
        longer = elapsed_s / self.sample_time
        return dataclasses.replace(
            self, sample_time=elapsed_s, process_variance=(of_bend * longer, of_error * longer)
        )

    def start(self, pull_mm: Array, bend_deg: Array) -> Belief:
        """Return the belief at the first sample, with no known error of the model."""
        covariance = np.repeat(np.diag(self.initial_variance)[:, :, None], bend_deg.size, axis=2)
        return Belief(np.stack([bend_deg, np.zeros_like(bend_deg)]), covariance, self.model.start(pull_mm))

    def predict(self, belief: Belief, pull_mm: Array, previous_pull_mm: Array) -> Belief:
        """Advance the belief by one sample (eqs. 6-8)."""
        T = self.sample_time
        bend, error = belief.mean
        mean = belief.mean.copy()
        mean[0], memory = self.model.step(bend, belief.memory, pull_mm, previous_pull_mm)
        mean[0] += error * T
        transition = np.zeros(belief.covariance.shape)  # Sigma = dF / dX (eq. 7)
        transition[0, 0] = self.model.slope(bend, pull_mm, previous_pull_mm)
        transition[0, 1] = T
        transition[1, 1] = 1
        covariance = propagate(belief.covariance, transition, np.diag(self.process_variance))
        return Belief(mean, covariance, memory)

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on one measurement of the angle (eqs. 8-9)."""
        mean, covariance = condition(
            belief.mean, belief.covariance, ANGLE, measurement_deg, self.measurement_variance
        )
        return Belief(mean, covariance, belief.memory)

    def single(self) -> SingleForm:
        """Return the filter on one stream: in plain numbers on Coleman and Hodgdon's model."""
        methods = ("start", "step", "predict", "update", "bend_deg")
        is_own = all(getattr(type(self), name) is getattr(ActiveModel, name) for name in methods)
        is_plain = isinstance(self.model, ColemanHodgdon) and np.size(self.measurement_variance) == 1
        return TwoStatesForm(self) if is_own and is_plain else super().single()

    def to_dict(self) -> dict[str, Any]:
        """Return model and variances as plain values, as a trained file holds them; R must be one number."""
        return {
            "model": model_to_dict(self.model),
            "sample_time": self.sample_time,
            "process_variance": list(self.process_variance),
            "measurement_variance": float(np.asarray(self.measurement_variance)),
            "initial_variance": list(self.initial_variance),
        }

    @classmethod
    def from_dict(cls, values: Any) -> Self:
        """Return the filter of what `to_dict` returned; raises `ValueError` where a value is wrong."""
        if not isinstance(values, Mapping):
            raise InputError(f"active_model = {shown(values)}: must be its parameters by name")
        # Imported here, so that a table of methods needs none of it.
        from twin.files.json_text import validated
        from twin.files.trained_schema import ActiveModelFile

        try:
            file = validated(ActiveModelFile, values)
            model = model_from_dict(file.model)
        except ValueError as error:
            raise InputError(f"active_model: {error}") from error
        return cls(
            model,
            file.sample_time,
            process_variance=(file.process_variance[0], file.process_variance[1]),
            measurement_variance=file.measurement_variance,
            initial_variance=(file.initial_variance[0], file.initial_variance[1]),
        )


@dataclasses.dataclass(frozen=True)
class KalmanActiveModel(ActiveModel):
    """The active model without linearisation, for a model that is affine in the angle.

    Given the command, eq. 4 then reads x_k = F_k x_{k-1} + u_k: F_k and u_k are found from two steps of the
    model, without its slope.
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


@dataclasses.dataclass(frozen=True)
class UnscentedActiveModel(ActiveModel):
    """The active model without a slope: mean and covariance of five points that go through the model.

    Scaled as by Wan and van der Merwe (2000). At alpha = 1 the weights are between 1/6 and 1/3 and the
    covariance is positive for any model; 1e-3, as often printed, gives weights of 1e6 that cancel. kappa =
    3 - n and beta = 2 (1 - alpha^2) = 0 then match the fourth moment of a normal angle.
    """

    alpha: float = 1.0  # spread of the points, above 0
    beta: float = 0.0  # added to the weight of the centre in the covariance
    kappa: float = 1.0  # second parameter of the spread, above -2

    def __post_init__(self) -> None:
        if not (self.alpha > 0 and self.kappa > -2):
            raise InputError(
                f"no points for alpha = {self.alpha}, kappa = {self.kappa}; valid: alpha > 0, kappa > -2"
            )

    def predict(self, belief: Belief, pull_mm: Array, previous_pull_mm: Array) -> Belief:
        """Advance the belief by one sample, point by point."""
        points = sigma_points(belief.mean, belief.covariance, self.alpha, self.kappa)
        moved = np.empty_like(points)
        # A step of the model does not depend on f, so that points 0, 2 and 4 of one angle share it.
        moved[0, 0], memory = self.model.step(points[0, 0], belief.memory, pull_mm, previous_pull_mm)
        moved[0, 2] = moved[0, 4] = moved[0, 0]
        for point in (1, 3):
            moved[0, point], _ = self.model.step(points[0, point], belief.memory, pull_mm, previous_pull_mm)
        moved[0] += points[1] * self.sample_time
        moved[1] = points[1]
        # Weights of the points in the mean and in the covariance (Wan and van der Merwe, eq. 15).
        spread = 2 * self.alpha**2 + self.alpha**2 * self.kappa  # n + lambda
        mean_weights = np.full(5, 0.5 / spread)
        mean_weights[0] = 1 - 2 / spread
        weights = mean_weights.copy()
        weights[0] += 1 - self.alpha**2 + self.beta
        mean = np.einsum("s,isb->ib", mean_weights, moved)
        off = moved - mean[:, None]
        covariance = np.einsum("isb,jsb->ijb", weights[:, None] * off, off)
        covariance = (covariance + covariance.swapaxes(0, 1)) / 2
        return Belief(mean, covariance + np.diag(self.process_variance)[:, :, None], memory)


def sigma_points(mean: Array, covariance: Array, alpha: float, kappa: float) -> Array:
    """Return points (2, 5, B): the mean (2, B), plus and minus the columns of a root of (n + lambda) P.

    The points 2 and 4 have the mean's first coordinate: the root is Cholesky's, lower triangular.
    """
    root = alpha * np.sqrt(2 + kappa) * cholesky(covariance)
    points = np.repeat(mean[:, None], 5, axis=1)
    points[:, 1:3] += root
    points[:, 3:5] -= root
    return points


def cholesky(covariance: Array) -> Array:
    """Return the lower triangular root (2, 2, B) of covariances (2, 2, B); rounding may leave none."""
    root = np.zeros_like(covariance)
    root[0, 0] = np.sqrt(np.maximum(covariance[0, 0], 0))
    np.divide(covariance[1, 0], root[0, 0], out=root[1, 0], where=root[0, 0] > 0)
    root[1, 1] = np.sqrt(np.maximum(covariance[1, 1] - root[1, 0] ** 2, 0))
    return root


def _register(name: str, kind: type[ActiveModel]) -> None:
    register_method(
        MethodSpec(
            name=name,
            build=lambda known: kind(known.reference, known.sample_time),
            given=("R",),
            models=(ColemanHodgdon.name,),
        )
    )


_register(METHOD, ActiveModel)
_register("KF", KalmanActiveModel)
_register("UKF", UnscentedActiveModel)
