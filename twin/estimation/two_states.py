"""The active model in plain arithmetic, on one stream or on many (Kalman 1960; eqs. 4-9 of the paper).

Two states, the angle and the model's error, and an affine model of hysteresis: every number of the filter is
a few products. They are written out here, on floats for one stream, where NumPy needs ten times as long to
begin as to calculate, and on arrays for the many candidates of a search.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import SingleForm
from twin.estimation.gaussian import DEVIATIONS_OF_95
from twin.estimation.soundness import LARGEST, ROUNDING
from twin.hysteresis import ColemanHodgdon

if TYPE_CHECKING:
    from twin.estimation.active_model import ActiveModel

Number = TypeVar("Number", float, NDArray[np.float64])


class TwoStates(NamedTuple):
    """Belief of one filter, and the innovation of its last measurement."""

    bend_deg: float  # angle [deg]
    error: float  # of the model [deg / s]
    p: float  # variance of the angle [deg^2]
    r: float  # covariance of both [deg^2 / s]
    q: float  # variance of the error [deg^2 / s^2]
    innovation_deg: float = 0.0  # measurement minus prediction; zero without a measurement [deg]
    expected: float = 1.0  # variance of the innovation that the belief expected, R included [deg^2]


def predicted(
    p: Number, r: Number, q: Number, keep: Number, sample_time: float, noise: tuple[Number, Number]
) -> tuple[Number, Number, Number]:
    """Return the covariance p, r, q one sample later: F P F^T + Q with F = [[keep, T], [0, 1]].

    p is the variance of the angle, q that of the error, r their covariance; Q is diagonal.
    """
    q_bend, q_error = noise
    drift = sample_time * q
    spread = keep * (keep * p + 2 * sample_time * r) + sample_time * drift
    return spread + q_bend, keep * r + drift, q + q_error


def updated(
    p: Number, r: Number, q: Number, variance: float | Number
) -> tuple[Number, Number, Number, Number, Number, Number]:
    """Return both gains, the covariance p, r, q after a measurement of the angle of this variance, and S.

    p R / S is p - K p without its rounding, so that no variance becomes negative.
    """
    expected = p + variance
    of_bend, of_error = p / expected, r / expected
    return of_bend, of_error, of_bend * variance, of_error * variance, q - of_error * r, expected


class TwoStatesForm(SingleForm):
    """The active model on Coleman-Hodgdon, on one stream; R is one number."""

    plain = True

    def __init__(self, estimator: "ActiveModel"):
        super().__init__(estimator)
        assert isinstance(estimator.model, ColemanHodgdon)
        self.a, self.b, self.c = (float(np.asarray(of)) for of in dataclasses.astuple(estimator.model))
        self.sample_time = estimator.sample_time
        self.noise = of_bend, of_error = estimator.process_variance
        self.noise_per_s = of_bend / self.sample_time, of_error / self.sample_time
        self.variance = float(np.asarray(estimator.measurement_variance).item())
        self.first = estimator.initial_variance

    def start(self, pull_mm: float, bend_deg: float) -> TwoStates:
        """Return the belief at the first sample, with no known error of the model."""
        return TwoStates(bend_deg, 0.0, self.first[0], 0.0, self.first[1])

    def resume(self, trusted: TwoStates, now: TwoStates, pull_mm: float, bend_deg: float) -> TwoStates:
        """Return the belief of a stream that restarts, as at the first sample."""
        return self.start(pull_mm, bend_deg)

    def step(
        self,
        state: TwoStates,
        pull_mm: float,
        previous_pull_mm: float,
        measurement_deg: float,
        elapsed_s: float | None = None,
    ) -> TwoStates:
        """Predict and update by one sample; see `SingleForm.step`."""
        T, noise = self.sample_time, self.noise
        if elapsed_s is not None:  # as `ActiveModel.over`
            T, noise = elapsed_s, (self.noise_per_s[0] * elapsed_s, self.noise_per_s[1] * elapsed_s)
        bend, error, p, r, q, _, _ = state
        increment = pull_mm - previous_pull_mm
        forget = self.a * abs(increment)
        bend += forget * (self.b * pull_mm - bend) + self.c * increment + error * T
        p, r, q = predicted(p, r, q, 1.0 - forget, T, noise)
        innovation = measurement_deg - bend
        if innovation != innovation:  # NaN: nothing was measured
            return TwoStates(bend, error, p, r, q, 0.0, p + self.variance)
        of_bend, of_error, p, r, q, expected = updated(p, r, q, self.variance)
        bend += of_bend * innovation
        return TwoStates(bend, error + of_error * innovation, p, r, q, innovation, expected)

    def bend_deg(self, state: TwoStates) -> float:
        """Return the mean of the angle [deg]."""
        return state[0]

    def half_width_deg(self, state: TwoStates) -> float:
        """Return half of the 95 % interval that the variance of the angle states [deg]."""
        return DEVIATIONS_OF_95 * math.sqrt(max(state[2], 0.0))

    def is_sound(self, state: TwoStates) -> bool:
        """Return whether every number is possible, and the covariance positive."""
        bend, error, p, r, q, innovation, _ = state
        return (
            0.0 < p < LARGEST
            and 0.0 < q < LARGEST
            and p * q - r * r > -ROUNDING * p * q
            and -LARGEST < bend < LARGEST
            and -LARGEST < error < LARGEST
            and -LARGEST < innovation < LARGEST
        )
