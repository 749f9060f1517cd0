"""The extended set-membership filter: where the angle must be if noise and model keep within their bounds.

Schweppe (1968); for nonlinear models Scholte and Campbell (2003). No density is assumed, and the interval is
a guarantee: theta moves by the model, is widened by the bound on the model's error, and is cut by the strip
that the measurement allows. The state is one number and the model keeps the order of two angles, so that the
interval is exact: an ellipsoid around theta and an error f of the model would be wider.

The error of a step of the model is w_k = theta_{k+1} - model(theta_k). Neither endoscope nor models depend on
rate: their error is one of slope, so that |w_k| <= slope |dl| + floor. The bounds are found on training
records.
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
ROUNDING = 1e-6  # by which every bound is widened: rounding can then not lose the truth [deg]


@dataclasses.dataclass(frozen=True)
class ErrorBound:
    """Bounds on the one-step error of a model."""

    slope_deg_per_mm: float  # of w, per move of the command [deg / mm]
    floor_deg: float  # of w, at rest [deg]

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
    """Return the least bounds that hold on all records, times a safety factor.

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
    """The sets of B filters: the angles from low to high."""

    low: Array  # (B,) [deg]
    high: Array  # (B,) [deg]
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
        """Return the interval around the first estimate."""
        half = self.initial_bound_deg + ROUNDING
        return FeasibleSet(bend_deg - half, bend_deg + half, self.model.start(pull_mm))

    def predict(self, state: FeasibleSet, pull_mm: Array, previous_pull_mm: Array) -> FeasibleSet:
        """Advance the set by one sample, and let the model's error widen it."""
        reach = self.error_bound.of_step(pull_mm, previous_pull_mm) + ROUNDING
        left, memory = self.model.step(state.low, state.memory, pull_mm, previous_pull_mm)
        right, _ = self.model.step(state.high, state.memory, pull_mm, previous_pull_mm)
        return FeasibleSet(np.minimum(left, right) - reach, np.maximum(left, right) + reach, memory)

    def update(self, state: FeasibleSet, measurement_deg: Array) -> FeasibleSet:
        """Keep what the measurement allows.

        Where it allows nothing, the noise or the model broke its bound. The filter then restarts from the
        interval that holds both the set and the strip of the measurement.
        """
        half = np.asarray(self.measurement_bound) + ROUNDING
        seen = ~np.isnan(measurement_deg)
        strip_low = np.where(seen, measurement_deg - half, -np.inf)
        strip_high = np.where(seen, measurement_deg + half, np.inf)
        low, high = np.maximum(state.low, strip_low), np.minimum(state.high, strip_high)
        empty = low > high
        return FeasibleSet(
            np.where(empty, np.minimum(state.low, strip_low), low),
            np.where(empty, np.maximum(state.high, strip_high), high),
            state.memory,
        )

    def step(
        self, state: FeasibleSet, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> FeasibleSet:
        """Predict and update by one sample."""
        return self.update(self.predict(state, pull_mm, previous_pull_mm), measurement_deg)

    def bend_deg(self, state: FeasibleSet) -> Array:
        """Return the (B,) middle of the interval, the estimate with the least worst error [deg]."""
        middle: Array = (state.low + state.high) / 2
        return middle

    def intervals(
        self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike
    ) -> tuple[Array, Array]:
        """Filter complete records, as `estimate` does, to the (B, N) lowest and highest angle [deg]."""
        pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
        low, high = np.empty_like(measurement), np.empty_like(measurement)
        state = self.start(pull[0], initial)
        low[0], high[0] = state.low, state.high
        for k in range(1, len(measurement)):
            state = self.step(state, pull[k], pull[k - 1], measurement[k])
            low[k], high[k] = state.low, state.high
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
            given=("bound", "ranges") if _build is _from_geometry else ("bound",),
            models=(ColemanHodgdon.name,),
            records=True,
            wire_offset=_build is _from_geometry,
        )
    )
