"""Base class of estimators of the bending angle: B records filtered side by side, sample by sample.

A complete record and a live stream go through the same `step`. A measurement that is NaN is missing: the
estimator predicts and does not update. A pull that is NaN counts as unchanged.
"""

import abc
import dataclasses
from collections.abc import Callable
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.soundness import is_sound
from twin.preset.preset import ZERO_DEVIATION_DEG

Array = NDArray[np.float64]
State = TypeVar("State")
_PROGRESS_SAMPLES = 10


@dataclasses.dataclass(frozen=True)
class Sensor:
    """Sensor, as far as an estimator knows it.

    Attributes:
        variance: R of the noise, scalar or (B,) [deg^2].
        zero_deviation_deg: standard deviation of the mean of its errors, scalar or (B,) [deg]. Zero means
            calibrated: the noise has mean zero, whatever its shape. Otherwise the mean is unknown by that
            much, and the physics alone can determine it.
        bound: largest magnitude of the noise, scalar or (B,); infinite where there is none [deg].
    """

    variance: ArrayLike
    zero_deviation_deg: ArrayLike = ZERO_DEVIATION_DEG
    bound: ArrayLike = np.inf

    def of_runs(self, runs: NDArray[np.intp]) -> "Sensor":
        """Return the sensors of some runs of a batch."""
        every = (self.variance, self.zero_deviation_deg, self.bound)
        return Sensor(*(np.asarray(of)[runs] if np.ndim(of) else of for of in every))


class Estimator(abc.ABC, Generic[State]):
    """Parameters of an estimator, frozen; everything that changes is in its state."""

    @property
    def states_interval(self) -> bool:
        """True if it states a 95 % interval with every estimate: where `half_width_deg` is defined."""
        return type(self).half_width_deg is not Estimator.half_width_deg

    @property
    def has_physics(self) -> bool:
        """True if it predicts by twins of the endoscope, not by a model of hysteresis."""
        return False

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the estimator for this sensor; itself, if it does not use the sensor."""
        return self

    def begun(self, from_rest: bool, initial_deviation_deg: float = np.inf) -> Self:
        """Return the estimator for sessions that start from rest, or with an unknown history.

        The standard deviation of the initial estimate is infinite where nothing is known of it [deg]. Here
        itself: models of hysteresis have no history beyond the angle.
        """
        return self

    def over(self, elapsed_s: float) -> Self:
        """Return the estimator whose step spans a time [s] other than its sample time, on an uneven stream.

        Here itself: it counts samples. An estimator with time in its equations returns one for that time.
        """
        return self

    @abc.abstractmethod
    def start(self, pull_mm: Array, bend_deg: Array) -> State:
        """Return the state at the first sample, from pulls (B,) [mm] and first estimates (B,) [deg]."""

    def resume(self, trusted: State, now: State, pull_mm: Array, bend_deg: Array) -> State:
        """Return the state of a live stream that restarts after a fault; here as at the first sample.

        An estimator that learns something over minutes keeps it from `trusted`, the state before the fault;
        the parts that follow only the command are those of the state `now`. Pulls [mm] and present angles
        [deg] are (B,).
        """
        return self.start(pull_mm, bend_deg)

    @abc.abstractmethod
    def step(self, state: State, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array) -> State:
        """Return the state one sample later; the one given is left as it is.

        Pulls at this and the previous sample are (B,) and finite [mm], the measured angle (B,) is NaN where
        there is none [deg].
        """

    def single(self) -> "SingleForm":
        """Return the estimator on one stream; on plain numbers, where it has such a form."""
        return SingleForm(self)

    @abc.abstractmethod
    def bend_deg(self, state: State) -> Array:
        """Return the (B,) estimate that a state holds [deg]."""

    def half_width_deg(self, state: State) -> Array:
        """Return half of the (B,) 95 % intervals about the estimates [deg], where it states them."""
        raise NotImplementedError

    def model_error_deg(self, state: State) -> tuple[float, float]:
        """Return the part of one stream's angle that no twin explains, and its standard deviation [deg].

        Zero where the estimator has no such state.
        """
        return 0.0, 0.0

    def twins_deg(self, state: State) -> Array:
        """Return the (B, M) angles of the twins that follow the command [deg]; M = 0 without any."""
        return np.zeros((1, 0))

    def estimate(self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike) -> Array:
        """Filter complete records, as `estimate_with_interval` does; subclasses may have a faster form."""
        return self.estimate_with_interval(pull_mm, measurement_deg, initial_bend_deg)[0]

    def estimate_with_interval(
        self,
        pull_mm: Array,  # (N,) or (B, N) pulling distance [mm]
        measurement_deg: Array,  # (N,) or (B, N) measured angle [deg]; the first sample is not used
        initial_bend_deg: ArrayLike,  # scalar or (B,) initial estimate [deg]
        on_progress: Callable[[int, int], None] | None = None,  # called with samples done and their total
    ) -> tuple[Array, Array | None]:
        """Filter complete records: (B, N) angles and half of their 95 % intervals [deg], or None for that."""
        pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
        form: Any = self.single() if measurement.shape[1] == 1 else self
        pulls: Any = pull
        measured: Any = measurement
        first: Any = initial
        if form is not self and form.plain:  # the same bits as on a stream
            pulls, measured, first = pull[:, 0].tolist(), measurement[:, 0].tolist(), float(initial[0])
        else:
            form = self
        state = form.start(pulls[0], first)
        bend = np.empty_like(measurement)
        bend[0] = first
        half_width = np.empty_like(measurement) if form.states_interval else None
        if half_width is not None:
            half_width[0] = form.half_width_deg(state)
        for k in range(1, len(measurement)):
            state = form.step(state, pulls[k], pulls[k - 1], measured[k])
            bend[k] = form.bend_deg(state)
            if half_width is not None:
                half_width[k] = form.half_width_deg(state)
            if on_progress and (k % _PROGRESS_SAMPLES == 0 or k == len(measurement) - 1):
                on_progress(k, len(measurement) - 1)
        return bend.T, None if half_width is None else half_width.T


class SingleForm:
    """An estimator on one stream: a batch of one, or the same arithmetic on plain numbers.

    NumPy takes a microsecond to begin each operation; a filter of two states needs fifty of them and
    calculates for none of that time.
    """

    plain = False  # True where a subclass has arithmetic of its own

    def __init__(self, estimator: Estimator[Any]):
        self.estimator = estimator
        self.states_interval = estimator.states_interval

    def start(self, pull_mm: float, bend_deg: float) -> Any:
        """Return the state at the first sample, with an initial estimate of the angle [deg]."""
        return self.estimator.start(np.array([pull_mm]), np.array([bend_deg]))

    def resume(self, trusted: Any, now: Any, pull_mm: float, bend_deg: float) -> Any:
        """Return the state of a stream that restarts after a fault; see `Estimator.resume`."""
        return self.estimator.resume(trusted, now, np.array([pull_mm]), np.array([bend_deg]))

    def step(
        self,
        state: Any,
        pull_mm: float,
        previous_pull_mm: float,
        measurement_deg: float,
        elapsed_s: float | None = None,
    ) -> Any:
        """Return the state one sample later; NaN is a measurement that is missing.

        The time since the last sample [s] is the sample time, if not given; see `Estimator.over`.
        """
        now, before, measured = np.array([pull_mm]), np.array([previous_pull_mm]), np.array([measurement_deg])
        with np.errstate(all="ignore"):  # what overflows is not sound
            estimator = self.estimator if elapsed_s is None else self.estimator.over(elapsed_s)
            return estimator.step(state, now, before, measured)

    def bend_deg(self, state: Any) -> float:
        """Return the estimate that a state holds [deg]."""
        return float(self.estimator.bend_deg(state)[0])

    def half_width_deg(self, state: Any) -> float:
        """Return half of its 95 % interval [deg], where it states one."""
        return float(self.estimator.half_width_deg(state)[0])

    def model_error_deg(self, state: Any) -> tuple[float, float]:
        """Return what no twin explains, and its standard deviation [deg]; see `Estimator.model_error_deg`."""
        return self.estimator.model_error_deg(state)

    def twins_deg(self, state: Any) -> Array:
        """Return the (M,) angles of the twins that follow the command [deg]."""
        angles: Array = self.estimator.twins_deg(state)[0]
        return angles

    def is_sound(self, state: Any) -> bool:
        """Return whether every number of a state is finite and possible, and variances are positive."""
        with np.errstate(all="ignore"):
            return is_sound(state)


def time_first(
    pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike
) -> tuple[Array, Array, Array]:
    """Return pull and measurement (N, B), gaps of the pull filled, and the initial estimate (B,)."""
    measurement = np.ascontiguousarray(np.atleast_2d(np.asarray(measurement_deg, dtype=float)).T)
    pull = hold(np.asarray(pull_mm, dtype=float))
    # A batch that follows one command shares its samples: nothing is copied.
    over_time = pull[:, None] if pull.ndim == 1 else np.ascontiguousarray(pull.T)
    pull = np.broadcast_to(over_time, measurement.shape)
    return pull, measurement, np.array(np.broadcast_to(initial_bend_deg, measurement.shape[1]), dtype=float)


def hold(values: Array) -> Array:
    """Return (..., N) values with each NaN replaced by the last value before it."""
    missing = np.isnan(values)
    if not missing.any():
        return values
    if missing[..., 0].any():
        raise InputError("the first pulling distance is missing: nothing can be held")
    last = np.maximum.accumulate(np.where(missing, 0, np.arange(values.shape[-1])), axis=-1)
    return np.take_along_axis(values, last, axis=-1)
