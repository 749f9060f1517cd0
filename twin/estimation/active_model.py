"""The active model (AM): an extended Kalman filter of the bending angle and of the model's error, eqs. 4-9.

The state is X = [theta, f]: the bending angle [deg] and the error of the model of hysteresis [deg / s], a
random walk.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Sensor
from twin.estimation.gaussian import Belief, condition, propagate
from twin.estimation.gaussian_filter import GaussianFilter
from twin.estimation.registry import MethodSpec, register_method
from twin.estimation.single import SingleForm
from twin.estimation.two_states import TwoStatesForm
from twin.files.shown import shown
from twin.hysteresis import ColemanHodgdon, HysteresisModel, model_from_dict, model_to_dict

Array = NDArray[np.float64]
METHOD = "AM"
"""Name of the method in tables."""
ANGLE = np.array([1.0, 0.0])  # Omega: the sensor sees the angle


@dataclasses.dataclass(frozen=True)
class ActiveModel(GaussianFilter):
    """Everything that the filter is told before it runs.

    Attributes:
        model: the reference model.
        sample_time: T [s].
        process_variance: diagonal of Q: of the angle [deg^2] and of the error [deg^2 / s^2] per sample; small
            as the paper's.
        measurement_variance: R [deg^2], one for all filters or (B,).
        initial_variance: diagonal of P at the first sample; not published, so small as Q: the first estimate
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

    def single(self) -> SingleForm[Any]:
        """Return the filter on one stream; one of another algebra, or on another model, has no plain form."""
        told = np.asarray(self.measurement_variance, dtype=float)
        methods = ("start", "step", "predict", "update", "bend_deg")
        is_own = all(getattr(type(self), name) is getattr(ActiveModel, name) for name in methods)
        if not (is_own and isinstance(self.model, ColemanHodgdon) and told.size == 1):
            return super().single()
        return TwoStatesForm(
            self.model, self.sample_time, self.process_variance, told.item(), self.initial_variance
        )

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
        """Return the filter of what `to_dict` returned.

        Raises:
            ValueError: a value is missing, is no number or is out of range, or the model cannot be.
        """
        if not isinstance(values, Mapping):
            raise InputError(f"active_model = {shown(values)}: must be its parameters by name")
        # Here, so that a table of methods needs none of it.
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


register_method(
    MethodSpec(
        name=METHOD,
        noise_information="R",
        build=lambda known: ActiveModel(known.reference, known.sample_time),
        models=(ColemanHodgdon.name,),
    )
)
