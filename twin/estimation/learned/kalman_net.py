"""The active model with a learned gain, after KalmanNet (Revach et al. 2022, arXiv 2107.10043).

The state is that of the active model, X = [theta, f]: the bending angle [deg] and the error of the model
[deg / s]. The prediction is its too,

    theta_k|k-1 = step(theta_{k-1}) + f T,

and the correction K (y_k - theta_k|k-1) has its gain from a small recurrent network in place of P, Q and R.
It sees the paper's four features, F1 the difference of successive measurements, F2 the innovation, F3 the
difference of successive estimates and F4 the latest correction, in units of sqrt(R) as told. From F1 and F3
we take what the model predicts: a pull that moves the angle is then nothing new, and errors that grow
together with sqrt(R) are filtered alike. Of f, F3 and F4 are one.

The gains are bounded: K_theta in [0, 1], a convex step towards the measurement, and K_f in [0, 2] per second.
Without a measurement the filter predicts, and the network stays as it is.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.learned import scale
from twin.estimation.learned.recurrent import RecurrentNetwork, read_network
from twin.estimation.registry import MethodSpec, Training, register_method
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]
FEATURES = 5  # that the gain sees


class Corrected(NamedTuple):
    """State of B filters, apart from the memory of the model; arrays of NumPy or of torch.

    Attributes:
        bend_deg: (B,) theta [deg].
        error: (B,) f [deg / s].
        measurement_deg: (B,) last measurement, or the prediction in its place [deg].
        correction: (2, B) latest K times innovation [deg], [deg / s].
        hidden: (B, hidden) of the network.
    """

    bend_deg: Any
    error: Any
    measurement_deg: Any
    correction: Any
    hidden: Any


class KalmanNetState(NamedTuple):
    """State of B filters and of their model.

    Attributes:
        filter: of the filters.
        memory: (m, B) of the model of hysteresis.
    """

    filter: Corrected
    memory: Array


@dataclasses.dataclass(frozen=True)
class KalmanNet(Estimator[KalmanNetState]):
    """A trained gain, the model that it was trained with, and what it is told of the noise.

    Attributes:
        network: says the (B, 2) gains of theta and of f [1 / s] for (B, 5) features in units of sqrt(R).
        model: of hysteresis, affine in the angle.
        sample_time: T [s].
        measurement_variance: R, one for all or (B,) [deg^2].
    """

    network: RecurrentNetwork
    model: HysteresisModel
    sample_time: float
    measurement_variance: ArrayLike = 0.1

    def __post_init__(self) -> None:
        """Refuse a model whose step cannot be taken as affine.

        Raises:
            ValueError: the model is not affine in the angle.
        """
        check_affine(self.model)

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def start(self, pull_mm: Array, bend_deg: Array) -> KalmanNetState:
        """Return the state at the first sample, with no known error of the model."""
        hidden = np.zeros((bend_deg.size, self.network.hidden), dtype=np.float32)
        return KalmanNetState(begin(np, bend_deg.copy(), hidden), self.model.start(pull_mm))

    def step(
        self, state: KalmanNetState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> KalmanNetState:
        """Predict and correct by one sample."""
        bend = state.filter.bend_deg
        drive, memory = self.model.step(np.zeros_like(bend), state.memory, pull_mm, previous_pull_mm)
        keep = self.model.slope(bend, pull_mm, previous_pull_mm)
        unit = scale.deviation(self.measurement_variance)
        stepped = advance(np, self._gain, state.filter, keep, drive, measurement_deg, unit, self.sample_time)
        return KalmanNetState(stepped, memory)

    def bend_deg(self, state: KalmanNetState) -> Array:
        """Return the (B,) estimate [deg]."""
        bend: Array = state.filter.bend_deg
        return bend

    def _gain(self, features: Array, hidden: Any) -> tuple[Array, Any]:
        gain, remembered = self.network(features, hidden[None])
        return gain, remembered[0]


def begin(xp: Any, bend_deg: Any, hidden: Any) -> Corrected:
    """Return filters at their (B,) initial estimates [deg]; `xp` is NumPy or torch."""
    zero = xp.zeros_like(bend_deg)
    return Corrected(bend_deg, zero, bend_deg, xp.stack([zero, zero]), hidden)


def advance(
    xp: Any,
    gain_of: Callable[[Any, Any], tuple[Any, Any]],
    state: Corrected,
    keep: Any,
    drive: Any,
    measurement_deg: Any,
    deviation_deg: Any,
    sample_time: float,
) -> Corrected:
    """Predict and correct by one sample: the same arithmetic for the running filter and for its training.

    Args:
        xp: NumPy, or torch where gradients are needed: the functions used have the same names in both.
        gain_of: returns (B, 2) gains and what is remembered, for (B, 5) features and (B, hidden).
        state: B filters at the sample before.
        keep: (B,) the model's step is keep theta + drive.
        drive: (B,) [deg].
        measurement_deg: (B,), NaN where there is none [deg].
        deviation_deg: sqrt(R), scalar or (B,) [deg].
        sample_time: T [s].
    """
    foretold = state.error * sample_time
    prediction = keep * state.bend_deg + drive + foretold
    seen = ~xp.isnan(measurement_deg)
    measurement = xp.where(seen, measurement_deg, prediction)
    innovation = measurement - prediction
    difference = measurement - keep * state.measurement_deg - drive  # F1, less what the model predicts
    of_bend, of_error = state.correction
    moved = (state.error - of_error) * sample_time + of_bend  # F3, less what the model predicts
    features = xp.stack([difference, innovation, moved, of_bend, of_error * sample_time]) / deviation_deg
    gain, hidden = gain_of(features.T, state.hidden)

    correction = gain.T * innovation
    return Corrected(
        prediction + correction[0],
        state.error + correction[1],
        measurement,
        correction,
        xp.where(seen[:, None], hidden, state.hidden),
    )


def check_affine(model: HysteresisModel) -> None:
    """Refuse a model that the gain cannot be trained through.

    Raises:
        ValueError: its step is not affine in the angle.
    """
    if not model.affine:
        raise InputError(
            f"the model {model.name!r} is not affine in the angle, as a learned gain needs to be "
            "trained through it; valid: 'coleman-hodgdon', 'prandtl-ishlinskii'"
        )


def load(path: Path) -> KalmanNet:
    """Read a trained gain.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    return KalmanNet(*read_network(path, TRAINING.agent, states=1, seen=(2, FEATURES), said=(2, 2)))


TRAINING = Training("kalman-net", "kalman_net.onnx", load, "active model with a learned gain")
KALMAN_NET = register_method(
    MethodSpec(
        name="KalmanNet",
        noise_information="R",
        build=lambda known: load(known.file_of(TRAINING.agent)),
        training=TRAINING,
    )
)
