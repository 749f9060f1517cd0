"""The extended set-membership filter: where [theta, f] must be if noise and model keep within their bounds.

Schweppe (1968); for nonlinear models Scholte and Campbell (2003). No density is assumed, and the interval is
a guarantee. An ellipsoid alone gives a poor one: the smallest around what a narrow strip leaves is sqrt(2)
times as wide as the strip, so that on the twin its interval of theta is hardly narrower than that of the last
measurement. The box of the bounds is therefore carried with the ellipsoid, each cuts the other, and the set
is their intersection. Without f the box is exact: the state is one number, and the model keeps order.

The error of a step of the model is e = theta_{k+1} - model(theta_k) = T f_k + w_k. Neither endoscope nor
models depend on rate: their error is one of slope, so that |w_k| <= slope |dl| + floor. f is the error of the
active model, known to stay in bounds and to change slowly. The bounds are found on training records.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.estimation.knowledge import Knowledge
from twin.estimation.registry import MethodSpec, register_method
from twin.hysteresis import ColemanHodgdon, HysteresisModel

Array = NDArray[np.float64]
LEAST = 1e-6  # half width of a bound of zero: a flat set has no ellipsoid [deg], [deg / s]
ROUNDING = 1e-9  # every shape is widened by this share: rounding can then neither lose a point nor flatten it


class Ellipsoid(NamedTuple):
    """B ellipsoids {x: (x - c)^T P^-1 (x - c) <= 1}, each the smallest of its family (Schweppe 1968).

    Areas are minimised, so that units of the coordinates do not matter.
    """

    centre: Array  # c, (2, B)
    shape: Array  # P, (2, 2, B)

    @property
    def covariance(self) -> Array:
        """Shape, which must be positive definite as a covariance."""
        return self.shape

    def half_width(self, axis: int) -> Array:
        """Return how far (B,) they reach from their centres along a coordinate."""
        reach: Array = np.sqrt(self.shape[axis, axis])
        return reach


def around_box(low: Array, high: Array) -> Ellipsoid:
    """Return the smallest ellipsoid around boxes from low to high, both (2, B), none of them flat."""
    half = (high - low) / 2
    shape = np.zeros((2, 2, half.shape[1]))
    shape[0, 0], shape[1, 1] = 2 * half**2
    return _widened((low + high) / 2, shape)


def add_segment(ellipsoid: Ellipsoid, axis: int, half_length: ArrayLike) -> Ellipsoid:
    """Return the smallest ellipsoid around all sums with a point of a segment of half length b along an axis.

    The family is (1 + 1/p) P + (1 + p) b^2 e e^T, p > 0 (Schweppe 1968). With h = b^2 e^T P^-1 e its area is
    least where h p^2 - h p - 2 = 0.
    """
    P = ellipsoid.shape
    square = np.square(np.asarray(half_length, dtype=float))
    determinant = P[0, 0] * P[1, 1] - P[0, 1] * P[1, 0]
    determinant = np.maximum(determinant, 1e-12 * P[0, 0] * P[1, 1])  # flat to rounding; any p is safe
    h = np.maximum(square * P[1 - axis, 1 - axis] / determinant, 1e-200)
    p = (1 + np.sqrt(1 + 8 / h)) / 2
    shape = P * (1 + 1 / p)
    shape[axis, axis] += (1 + p) * square
    return _widened(ellipsoid.centre, shape)


def cut(ellipsoid: Ellipsoid, axis: int, low: Array, high: Array) -> tuple[Ellipsoid, NDArray[np.bool_]]:
    """Return the smallest ellipsoid around its part between two bounds (B,) on one coordinate.

    Fogel and Huang (1982). Seen as the unit disc, with t along the normal of a strip of middle m and half
    width d, the family is |z|^2 + q (t - m)^2 <= 1 + q d^2. The strip is first cut down to where it meets the
    disc (Belforte and Bona 1985). With s = 1 + q the area is least where
    d^2 s^2 - (1 - d^2 - m^2) s - 3 m^2 = 0. Where that is below s = 1, as for a strip around the ellipsoid,
    nothing is gained and it stays. Also returns (B,) whether nothing is left; there it is as it was.
    """
    centre, P = ellipsoid
    half = ellipsoid.half_width(axis)
    t_low = np.maximum((low - centre[axis]) / half, -1)
    t_high = np.minimum((high - centre[axis]) / half, 1)
    empty = t_low > t_high
    m = (t_low + t_high) / 2
    d = np.maximum((t_high - t_low) / 2, 1e-7)  # a wider strip is safe, a flat one has no ellipsoid
    k = 1 - d**2 - m**2
    s = (k + np.sqrt(k**2 + 12 * d**2 * m**2)) / (2 * d**2)
    s = np.where(empty, 1, np.maximum(s, 1))
    shift = np.where(empty, 0, m * (1 - 1 / s))
    scale = np.where(empty, 1, 1 + (s - 1) * d**2 - m * shift)
    normal = P[axis] / half
    shape = scale * (P - (1 - 1 / s) * normal[:, None] * normal[None])
    return _widened(centre + shift * normal, shape), empty


def _widened(centre: Array, shape: Array) -> Ellipsoid:
    for axis in (0, 1):
        shape[axis, axis] *= 1 + ROUNDING
    return Ellipsoid(centre, shape)


@dataclasses.dataclass(frozen=True)
class ErrorBound:
    """Bounds on the one-step error of a model."""

    slope_deg_per_mm: float  # of w, per move of the command [deg / mm]
    floor_deg: float  # of w, at rest [deg]
    error_deg_per_s: float = 0.0  # of f [deg / s]
    increment_deg_per_s: float = 0.0  # of the change of f from sample to sample [deg / s]

    def __post_init__(self) -> None:
        values = dataclasses.astuple(self)
        if not (np.isfinite(values).all() and min(values) >= 0):
            raise InputError(f"bounds {values} of a model's error; valid: finite numbers, none negative")

    def of_step(self, pull_mm: Array, previous_pull_mm: Array) -> Array:
        """Return the bound (B,) on w for steps between commands (B,) [deg]."""
        return self.slope_deg_per_mm * np.abs(pull_mm - previous_pull_mm) + self.floor_deg


def geometric_error_bound(wire_offset: float, floor_deg: float) -> ErrorBound:
    """Return the bound that geometry suggests, for endoscopes without a record.

    A wire at an offset r [m] from the middle bends the section by dl / r, if neither wire nor sheath yields,
    and by less if they do. The slopes of endoscope and model are then near [0, 1 / r], and differ by
    no more than 1 / r: an assumption with a margin, not a theorem. `floor_deg` is the largest change of the
    angle at rest, by creep and the sheath's own motion.
    """
    return ErrorBound(float(np.degrees(1e-3 / wire_offset)), floor_deg)


def bound_model_error(
    model: HysteresisModel, records: Sequence[tuple[Array, Array]], *, factor: float = 2.0
) -> ErrorBound:
    """Return the least bounds without f that hold on all records, times a safety factor.

    Of all pairs (slope, floor) that hold, the one with the least mean bound: a linear programme. The default
    of the factor was chosen before any test, and is no guarantee. The records are `(pull_mm, bend_deg)` with
    the true angle: noise in it would count as error of the model.
    """
    if not factor >= 1:
        raise InputError(
            f"safety factor {factor} would break the bound on the very records; valid: 1 or more"
        )
    errors = [_step_errors(model, np.asarray(pull), np.asarray(bend)) for pull, bend in records]
    move, error = (np.concatenate([of[part] for of in errors] or [np.empty(0)]) for part in (0, 1))
    if not error.size:
        raise InputError("no record to bound the model's error on: each needs two samples or more")
    from scipy.optimize import linprog  # imported when used: a table of methods needs none of it

    bound = np.stack([move, np.ones_like(move)], axis=1)
    slope, floor = linprog(bound.mean(axis=0), -bound, -np.abs(error), bounds=(0, None), method="highs").x
    # Rounding of the programme must not break the bound on the records themselves.
    floor += max(float((np.abs(error) - slope * move - floor).max()), 0.0)
    return ErrorBound(factor * float(slope), factor * float(floor))


def _step_errors(model: HysteresisModel, pull_mm: Array, bend_deg: Array) -> tuple[Array, Array]:
    """Return |dl| (N - 1,) and e (N - 1,) along one record."""
    memory = model.start(pull_mm[:1])
    error = np.empty(max(len(pull_mm) - 1, 0))
    for k in range(len(error)):
        before, now = pull_mm[k : k + 1], pull_mm[k + 1 : k + 2]
        predicted, memory = model.step(bend_deg[k : k + 1], memory, now, before)
        error[k] = bend_deg[k + 1] - predicted[0]
    return np.abs(np.diff(pull_mm)), error


class FeasibleSet(NamedTuple):
    """The set of B filters: the points of [theta, f] in an ellipsoid and in a box."""

    ellipsoid: Ellipsoid  # one of the two sets
    low: Array  # (2, B) of the box [deg], [deg / s]
    high: Array  # (2, B)
    memory: Array  # (m, B) of the model of hysteresis


@dataclasses.dataclass(frozen=True)
class SetMembershipFilter(Estimator[FeasibleSet]):
    """The bounds of the filter.

    The model must be affine in the angle, or keep the order of two angles and never move them apart
    (0 <= slope <= 1), as the model of Bouc and Wen does.
    """

    model: HysteresisModel  # the reference model
    sample_time: float  # T [s]
    error_bound: ErrorBound  # bounds on the model's error; `bound_model_error` finds them on training records
    measurement_bound: ArrayLike = 3 * np.sqrt(0.1)  # largest magnitude of the noise, scalar or (B,) [deg]
    initial_bound_deg: float = 20.0  # largest error of the first estimate [deg]

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

        Where it allows nothing, the noise or the model broke its bound. The filter then restarts from the
        interval that holds both the set and the strip of the measurement, with any f.
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

    def intervals(
        self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike
    ) -> tuple[Array, Array]:
        """Filter complete records, as `estimate` does, to the (B, N) lowest and highest angle [deg]."""
        pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
        low, high = np.empty_like(measurement), np.empty_like(measurement)
        state = self.start(pull[0], initial)
        low[0], high[0] = state.low[0], state.high[0]
        for k in range(1, len(measurement)):
            state = self.step(state, pull[k], pull[k - 1], measurement[k])
            low[k], high[k] = state.low[0], state.high[0]
        return low.T, high.T


def _from_records(knowledge: Knowledge) -> SetMembershipFilter:
    bound = bound_model_error(knowledge.reference, knowledge.records)
    return SetMembershipFilter(knowledge.reference, knowledge.sample_time, bound)


def _from_geometry(knowledge: Knowledge) -> SetMembershipFilter:
    assert knowledge.smallest_wire_offset is not None
    filter_ = _from_records(knowledge)
    bound = geometric_error_bound(knowledge.smallest_wire_offset, filter_.error_bound.floor_deg)
    return dataclasses.replace(filter_, error_bound=bound)


for _name, _build in {"ESMF": _from_records, "ESMF (geometry)": _from_geometry}.items():
    register_method(
        MethodSpec(
            name=_name,
            build=_build,
            noise_information="the largest magnitude of the noise",
            models=(ColemanHodgdon.name,),
            records=True,
            wire_offset=_build is _from_geometry,
        )
    )
