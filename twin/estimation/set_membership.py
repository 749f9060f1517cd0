"""The extended set-membership filter: where [theta, f] must lie if noise and model keep within their bounds.

Schweppe (1968); for nonlinear models Scholte and Campbell (2003). No density is assumed, and what comes out
is a guarantee. An ellipsoid alone gives a poor one: the smallest around what a narrow strip leaves is sqrt(2)
times as wide as the strip, so that on the twin its interval of theta is hardly narrower than that of the last
measurement. The box that the bounds give is therefore carried beside the ellipsoid, each cuts the other, and
the set is what both hold. Without f the box is exact: the state is one number, and the model keeps order.
"""

import dataclasses
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.estimation.ellipsoid import ROUNDING, Ellipsoid, add_segment, around_box, cut
from twin.estimation.error_bound import ErrorBound, bound_model_error, geometric_error_bound
from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec, register_method
from twin.hysteresis import ColemanHodgdon, HysteresisModel

Array = NDArray[np.float64]
LEAST = 1e-6  # half width that bounds of zero are taken to have: a flat set has no ellipsoid [deg], [deg / s]


class FeasibleSet(NamedTuple):
    """The set of B filters: the points of [theta, f] that lie in an ellipsoid and in a box.

    Attributes:
        ellipsoid: one of the two sets.
        low: (2, B) of the box [deg], [deg / s].
        high: (2, B).
        memory: (m, B) of the model of hysteresis.
    """

    ellipsoid: Ellipsoid
    low: Array
    high: Array
    memory: Array


@dataclasses.dataclass(frozen=True)
class SetMembershipFilter(Estimator[FeasibleSet]):
    """The bounds that the filter believes in.

    The model must be affine in the angle, or keep the order of two angles and never move them apart
    (0 <= slope <= 1), as the model of Bouc and Wen does.

    Attributes:
        model: the reference model.
        sample_time: T [s].
        error_bound: bounds on the model's error; `bound_model_error` finds them on training records.
        measurement_bound: largest magnitude of the measurement noise, scalar or (B,) [deg].
        initial_bound_deg: largest error of the first estimate [deg].
    """

    model: HysteresisModel
    sample_time: float
    error_bound: ErrorBound
    measurement_bound: ArrayLike = 3 * np.sqrt(0.1)
    initial_bound_deg: float = 20.0

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the noise's largest magnitude; if it has none, 3 deviations."""
        bound = np.asarray(sensor.bound, dtype=float)
        bound = np.where(np.isfinite(bound), bound, 3 * np.sqrt(np.asarray(sensor.variance)))
        return dataclasses.replace(self, measurement_bound=bound)

    def start(self, pull_mm: Array, bend_deg: Array) -> FeasibleSet:
        """Return the box around the first estimate, and the ellipsoid around it."""
        centre = np.stack([bend_deg, np.zeros_like(bend_deg)])
        half = np.maximum([[self.initial_bound_deg], [self.error_bound.error_deg_per_s]], LEAST) + ROUNDING
        low, high = centre - half, centre + half
        return FeasibleSet(around_box(low, high), low, high, self.model.start(pull_mm))

    def predict(self, state: FeasibleSet, pull_mm: Array, previous_pull_mm: Array) -> FeasibleSet:
        """Advance the set by one sample, and let the model's error widen it."""
        T, bound = self.sample_time, self.error_bound
        reach = bound.of_step(pull_mm, previous_pull_mm) + ROUNDING
        ends = (state.low[0], state.high[0])
        left, memory = self.model.step(ends[0], state.memory, pull_mm, previous_pull_mm)
        right, _ = self.model.step(ends[1], state.memory, pull_mm, previous_pull_mm)

        # The model on the box: the chord between its ends, and how far it can depart from the chord. Between
        # the ends a rise of slope 0 to 1 and mean s leaves the chord by s (1 - s) of the width at most.
        width = ends[1] - ends[0]
        s = (right - left) / width
        remainder = 0.0 if self.model.affine else np.clip(s * (1 - s), 0, None) * width
        centre, P = state.ellipsoid
        moved = np.stack([left + s * (centre[0] - ends[0]) + T * centre[1], centre[1]])
        shape = np.empty_like(P)  # F P F^T, F = [[s, T], [0, 1]]
        shape[0, 0] = s * s * P[0, 0] + 2 * s * T * P[0, 1] + T * T * P[1, 1]
        shape[0, 1] = shape[1, 0] = s * P[0, 1] + T * P[1, 1]
        shape[1, 1] = P[1, 1]
        ellipsoid = add_segment(Ellipsoid(moved, shape), 0, reach + remainder)
        if bound.increment_deg_per_s > 0:
            ellipsoid = add_segment(ellipsoid, 1, bound.increment_deg_per_s)

        change = bound.increment_deg_per_s + ROUNDING
        limit = max(bound.error_deg_per_s, LEAST) + ROUNDING
        low = np.stack([np.minimum(left, right) + T * state.low[1] - reach, state.low[1]])
        high = np.stack([np.maximum(left, right) + T * state.high[1] + reach, state.high[1]])
        low[1] = np.maximum(low[1] - change, -limit)
        high[1] = np.minimum(high[1] + change, limit)
        return FeasibleSet(ellipsoid, low, high, memory)

    def update(self, state: FeasibleSet, measurement_deg: Array) -> FeasibleSet:
        """Keep what the measurement allows.

        Where it allows nothing, the noise or the model broke its bound, and nobody knows which. The filter
        then starts again from the interval that holds both the set and the strip of the measurement, with any
        f.
        """
        half = np.maximum(np.asarray(self.measurement_bound), LEAST) + ROUNDING
        seen = ~np.isnan(measurement_deg)
        strip_low = np.where(seen, measurement_deg - half, -np.inf)
        strip_high = np.where(seen, measurement_deg + half, np.inf)
        low, high, ellipsoid = state.low.copy(), state.high.copy(), state.ellipsoid
        low[0], high[0] = np.maximum(low[0], strip_low), np.minimum(high[0], strip_high)

        empty = low[0] > high[0]
        for axis in (0, 1):
            ellipsoid, missed = cut(ellipsoid, axis, low[axis], high[axis])
            empty |= missed
        for axis in (0, 1):
            reach = (1 + ROUNDING) * ellipsoid.half_width(axis) + ROUNDING
            low[axis] = np.maximum(low[axis], ellipsoid.centre[axis] - reach)
            high[axis] = np.minimum(high[axis], ellipsoid.centre[axis] + reach)
            empty |= low[axis] > high[axis]
        if empty.any():
            limit = max(self.error_bound.error_deg_per_s, LEAST)
            hull_low = np.stack([np.minimum(state.low[0], strip_low), np.full_like(strip_low, -limit)])
            hull_high = np.stack([np.maximum(state.high[0], strip_high), np.full_like(strip_low, limit)])
            low, high = np.where(empty, hull_low, low), np.where(empty, hull_high, high)
            again = around_box(low, high)
            ellipsoid = Ellipsoid(
                np.where(empty, again.centre, ellipsoid.centre), np.where(empty, again.shape, ellipsoid.shape)
            )
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, LEAST)
        return FeasibleSet(ellipsoid, middle - half, middle + half, state.memory)

    def step(
        self, state: FeasibleSet, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> FeasibleSet:
        """Predict and update by one sample."""
        return self.update(self.predict(state, pull_mm, previous_pull_mm), measurement_deg)

    def bend_deg(self, state: FeasibleSet) -> Array:
        """Return the (B,) middle of the interval, the estimate with the least worst error [deg]."""
        middle: Array = (state.low[0] + state.high[0]) / 2
        return middle

    def interval(self, state: FeasibleSet) -> tuple[Array, Array]:
        """Return the (B,) lowest and highest angle in the set [deg]."""
        return state.low[0], state.high[0]

    def intervals(
        self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike
    ) -> tuple[Array, Array]:
        """Filter whole records, as `estimate` does, to the (B, N) lowest and highest angle [deg]."""
        pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
        low, high = np.empty_like(measurement), np.empty_like(measurement)
        state = self.start(pull[0], initial)
        low[0], high[0] = self.interval(state)
        for k in range(1, len(measurement)):
            state = self.step(state, pull[k], pull[k - 1], measurement[k])
            low[k], high[k] = self.interval(state)
        return low.T, high.T


def _found(knowledge: Knowledge) -> ErrorBound:
    return bound_model_error(knowledge.reference, knowledge.records, knowledge.sample_time)


def _from_records(knowledge: Knowledge) -> SetMembershipFilter:
    return SetMembershipFilter(knowledge.reference, knowledge.sample_time, _found(knowledge))


def _from_geometry(knowledge: Knowledge) -> SetMembershipFilter:
    assert knowledge.smallest_wire_offset is not None
    bound = geometric_error_bound(knowledge.smallest_wire_offset, _found(knowledge).floor_deg)
    return SetMembershipFilter(knowledge.reference, knowledge.sample_time, bound)


register_method(
    MethodSpec(
        name="ESMF",
        noise_information="the largest magnitude of the noise",
        build=_from_records,
        models=(ColemanHodgdon.name,),
        records=True,
    )
)
register_method(
    MethodSpec(
        name="ESMF (geometry)",
        noise_information="the largest magnitude of the noise",
        build=_from_geometry,
        models=(ColemanHodgdon.name,),
        records=True,
        wire_offset=True,
    )
)
