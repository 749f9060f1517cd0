"""Bounds on a model's error in one step, found on training records: what a set-membership filter stands on.

The error of a step is e = theta_{k+1} - model(theta_k) = T f_k + w_k. The endoscope does not depend on rate,
nor do the models: what they get wrong is a slope, so that |w_k| <= slope |dl| + floor. f is the error of the
active model, known to stay in bounds and to change slowly.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class ErrorBound:
    """Bounds on the one-step error of a model.

    Attributes:
        slope_deg_per_mm: of w, per move of the command [deg / mm].
        floor_deg: of w, at rest [deg].
        error_deg_per_s: of f [deg / s].
        increment_deg_per_s: of the change of f from sample to sample [deg / s].
    """

    slope_deg_per_mm: float
    floor_deg: float
    error_deg_per_s: float = 0.0
    increment_deg_per_s: float = 0.0

    def __post_init__(self) -> None:
        values = dataclasses.astuple(self)
        if not (np.isfinite(values).all() and min(values) >= 0):
            raise InputError(f"bounds {values} of a model's error; valid: finite numbers, none negative")

    def of_step(self, pull_mm: Array, previous_pull_mm: Array) -> Array:
        """Return the bound (B,) on w for steps between commands (B,) [deg]."""
        return self.slope_deg_per_mm * np.abs(pull_mm - previous_pull_mm) + self.floor_deg


def geometric_error_bound(wire_offset: float, floor_deg: float) -> ErrorBound:
    """Return the bound that geometry suggests, for endoscopes that have left no record.

    A wire that runs at an offset r from the middle bends the section by dl / r, if neither wire nor sheath
    yields, and by less if they do. The slopes of endoscope and model then lie near [0, 1 / r], and differ by
    no more than 1 / r. That is an assumption with a margin, not a theorem: a stretched wire that slips may
    bend the section against the pull for a moment, and a Coleman-Hodgdon model may fall while the pull rises.

    Args:
        wire_offset: r, the smallest that the endoscope may have [m].
        floor_deg: what the angle may change by at rest, by creep and the sheath's own motion [deg].
    """
    return ErrorBound(float(np.degrees(1e-3 / wire_offset)), floor_deg)


def bound_model_error(
    model: HysteresisModel,
    records: Sequence[tuple[Array, Array]],
    sample_time: float,
    *,
    factor: float = 2.0,
    increment_deg_per_s: float = 0.0,
) -> ErrorBound:
    """Return the least bounds that hold on all records, times a factor for what the records do not show.

    Of all pairs (slope, floor) that hold, the one with the least mean bound: a linear programme.

    Args:
        model: the model of hysteresis, parameters scalar.
        records: `(pull_mm, bend_deg)` with the true angle; noise in it would count as error of the model.
        sample_time: T [s].
        factor: safety factor on all bounds. The default was chosen before any test, and is no guarantee.
        increment_deg_per_s: how much f may change from sample to sample (before the factor). At 0 there is no
            f, and w alone explains the error.

    Raises:
        ValueError: no record has two samples, or the factor is below 1.
    """
    if not factor >= 1:
        raise InputError(
            f"safety factor {factor} would break the bound on the very records; valid: 1 or more"
        )
    errors = [_step_errors(model, np.asarray(pull), np.asarray(bend)) for pull, bend in records]
    errors = [(move, error) for move, error in errors if error.size]
    if not errors:
        raise InputError("no record to bound the model's error on: each needs two samples or more")
    move = np.concatenate([moves for moves, _ in errors])
    error = np.concatenate([found for _, found in errors])
    programme = _without_f(move, error)
    if increment_deg_per_s > 0:
        lengths = [found.size for _, found in errors]
        programme = _with_f(move, error, lengths, sample_time, increment_deg_per_s)
    from scipy.optimize import linprog  # imported when used: a table of methods needs none of it

    slope, floor, *f = linprog(**programme, method="highs").x
    # Rounding of the programme must not break the bound on the records themselves.
    w = error - sample_time * np.asarray(f) if f else error
    floor += max(float((np.abs(w) - slope * move - floor).max()), 0.0)
    return ErrorBound(
        factor * float(slope),
        factor * float(floor),
        factor * float(np.abs(f).max(initial=0.0)),
        factor * increment_deg_per_s,
    )


def _step_errors(model: HysteresisModel, pull_mm: Array, bend_deg: Array) -> tuple[Array, Array]:
    """Return |dl| (N - 1,) and e (N - 1,) along one record."""
    memory = model.start(pull_mm[:1])
    error = np.empty(max(len(pull_mm) - 1, 0))
    for k in range(len(error)):
        before, now = pull_mm[k : k + 1], pull_mm[k + 1 : k + 2]
        predicted, memory = model.step(bend_deg[k : k + 1], memory, now, before)
        error[k] = bend_deg[k + 1] - predicted[0]
    return np.abs(np.diff(pull_mm)), error


def _without_f(move: Array, error: Array) -> dict[str, object]:
    """Least mean of slope |dl| + floor with slope |dl| + floor >= |e|."""
    bound = np.stack([move, np.ones_like(move)], axis=1)
    return {"c": bound.mean(axis=0), "A_ub": -bound, "b_ub": -np.abs(error), "bounds": (0, None)}


def _with_f(
    move: Array, error: Array, lengths: Sequence[int], sample_time: float, increment: float
) -> dict[str, object]:
    """The same with slope |dl| + floor >= |e - T f|, over all f whose changes within a record are bounded."""
    from scipy import sparse

    count = len(error)
    bound = sparse.csr_array(np.stack([move, np.ones(count)], axis=1))
    f = sparse.eye_array(count, format="csr")
    inside = np.ones(count - 1, dtype=bool)
    inside[np.cumsum(lengths)[:-1] - 1] = False  # a change from one record to the next is free
    change = (f[1:] - f[:-1])[np.flatnonzero(inside)]
    none = sparse.csr_array((change.shape[0], 2))
    rows = [[-bound, -sample_time * f], [-bound, sample_time * f], [none, change], [none, -change]]
    limits = [-error, error, *[np.full(change.shape[0], increment)] * 2]
    return {
        "c": np.concatenate([[move.mean(), 1], np.zeros(count)]),
        "A_ub": sparse.block_array(rows, format="csr"),
        "b_ub": np.concatenate(limits),
        "bounds": [(0, None)] * 2 + [(None, None)] * count,
    }
