"""Trials: two estimators on the same runs under one noise, and the paired comparison of their errors.

Runs are nested: a twin (or log) along its command, and draws of the noise on it. Intervals are those of a
jackknife with Student's t: one twin is left out with all its draws (`twin.evaluation.metrics.jackknife`). Of
fewer than five units the draws are left out instead: the interval is then about these units alone. Both
estimators see the same runs, so that their difference is free of what twin and noise have in common.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import DEVIATIONS_OF_95
from twin.estimation.knowledge import Case
from twin.evaluation.metrics import jackknife, student_interval

Array = NDArray[np.float64]
WORST_DEG2 = 1e8  # square error of an estimate that is not a number [deg^2]
LEAST_UNITS = 5  # that an interval about other units takes
_LARGEST_LOG = 20.0  # of a ratio of errors


class Paired(NamedTuple):
    """Root mean square errors of two estimators, and the 95 % interval of their difference."""

    rmse_deg: float  # of the first [deg]
    rival_deg: float  # of the second [deg]
    difference_deg: float  # first minus second [deg]
    low_deg: float  # lower end of the interval of that [deg]
    high_deg: float  # upper end of it [deg]

    @property
    def relative_high(self) -> float:
        """Upper end of the interval in units of the second's error: below 0, the first is better."""
        return self.high_deg / max(self.rival_deg, 1e-9)


def compare_paired(squares: Array, rival: Array) -> Paired:
    """Compare two estimators by their (units, draws) mean square errors [deg^2] on the same runs."""
    low, high = _interval(lambda mine, other: _rmse(mine) - _rmse(other), LEAST_UNITS, squares, rival)
    mine, other = _rmse(squares), _rmse(rival)
    return Paired(mine, other, mine - other, low, high)


def reduction_interval(squares: Array, rival: Array) -> tuple[float, float]:
    """Return the 95 % interval of how much smaller the first's error is, as a share of the second's.

    Of one unit the draws are left out; of a single run both ends are the share itself.
    """

    def log_ratio(mine: Array, other: Array) -> float:
        return math.log(max(_rmse(mine), 1e-9) / max(_rmse(other), 1e-9))

    if squares.size == 1:
        low = high = log_ratio(squares, rival)
    else:
        low, high = _interval(log_ratio, 2, squares, rival)
    return 1 - math.exp(min(high, _LARGEST_LOG)), 1 - math.exp(max(low, -_LARGEST_LOG))


def mean_interval(values: Array) -> tuple[float, float]:
    """Return the 95 % interval of the mean of (units, draws) values."""
    return _interval(lambda of: float(of.mean()), LEAST_UNITS, values)


def _rmse(squares: Array) -> float:
    return float(np.sqrt(squares.mean()))


def _interval(figure: Callable[..., float], least: int, *values: Array) -> tuple[float, float]:
    """Return the 95 % interval of a figure of arrays (units, draws); an infinite one of a single run.

    Units are left out if there are at least so many, draws otherwise.
    """
    units, draws = values[0].shape
    if any(of.shape != (units, draws) for of in values) or not values[0].size:
        raise ValueError(f"runs of shapes {[of.shape for of in values]}: must be the same, and not empty")
    axis = 0 if units >= least or draws == 1 else 1
    count = values[0].shape[axis]
    if count == 1:
        return -math.inf, math.inf
    left_out = [figure(*(np.delete(of, place, axis) for of in values)) for place in range(count)]
    return student_interval(figure(*values), *jackknife([np.array(left_out)]))


class PairedTrial(NamedTuple):
    """Errors of two estimators on U units (twins or logs) with D draws of one noise on each."""

    noise: tuple[str, float]  # kind and level
    units: tuple[Any, ...]  # (U,) the stroke of each twin, or the name of each log
    squares: Array  # (U, D) mean square error of the policy [deg^2]
    rival: Array  # the same of its rival [deg^2]
    inside: Array | None  # (U, D) share of samples in their 95 % interval; None where none is stated
    nees: Array | None  # (U, D) mean square error in units of the variance that the interval states; likewise
    half_width_deg: Array | None  # (U, D) mean half width of the interval [deg]; likewise
    left_out: int  # twins that found no equilibrium
    finite: bool  # whether every estimate was a number


def joined_cases(cases: Sequence[Case]) -> Case:
    """Return the runs of several cases, with the truth, as one."""

    def joined(of: Callable[[Case], Any]) -> Any:
        return np.concatenate([np.asarray(of(case)) for case in cases])

    return Case(
        pull_mm=joined(lambda case: case.pull_mm),
        measurement_deg=joined(lambda case: case.measurement_deg),
        initial_bend_deg=joined(lambda case: case.initial_bend_deg),
        sensor=Sensor(
            joined(lambda case: case.sensor.variance),
            joined(lambda case: case.sensor.zero_deviation_deg),
            joined(lambda case: case.sensor.bound),
        ),
        noises=tuple(noise for case in cases for noise in case.noises),
        truth_deg=joined(lambda case: case.truth_deg),
    )


def run_trials(
    policy: Estimator[Any],
    rival: Estimator[Any] | None,
    cases: Sequence[Case],
    units: Sequence[Any],
    left_out: int,
    on_progress: Callable[[int, int], None],
    truth_deviation_deg: Array | float = 0.0,
) -> list[PairedTrial]:
    """Run two estimators on all noises at once; the first sample, which is given, is not scored.

    What counts as the truth of a run has a standard deviation of its own, scalar or (runs,), by which stated
    intervals are wider [deg].
    """
    case = joined_cases(cases)
    measured, truth = case.measurement_deg, np.asarray(case.truth_deg)
    runs = case.pull_mm, measured, case.initial_bend_deg
    with np.errstate(all="ignore"):  # a policy that diverges is a result
        bend, half = policy.with_sensor(case.sensor).estimate_with_interval(*runs, on_progress)
        other = rival.with_sensor(case.sensor).estimate_with_interval(*runs)[0] if rival else bend
    scored = ~np.isnan(measured)
    scored[:, 0] = False
    shape = len(cases), len(units), -1

    def mean(values: Array) -> Array:
        by_run = np.where(scored, values, 0.0).sum(axis=1) / np.maximum(scored.sum(axis=1), 1)
        by_case: Array = by_run.reshape(shape)
        return by_case

    with np.errstate(all="ignore"):
        square, rivals = (
            np.nan_to_num((of - truth) ** 2, nan=WORST_DEG2, posinf=WORST_DEG2).clip(max=WORST_DEG2)
            for of in (bend, other)
        )
        errors, rival_errors = mean(square), mean(rivals)
        stated: list[Any] = [(None, None, None)] * len(cases)
        if half is not None:
            of_truth = DEVIATIONS_OF_95 * np.resize(truth_deviation_deg, len(truth))[:, None]
            half = np.hypot(half, of_truth)
            normalised = (square / np.maximum(half / DEVIATIONS_OF_95, 1e-9) ** 2).clip(max=1e6)
            covered = (np.abs(bend - truth) <= half).astype(float)
            widths = np.nan_to_num(half, nan=1e6, posinf=1e6)
            stated = list(zip(mean(covered), mean(normalised), mean(widths), strict=True))
    finite = np.asarray(np.isfinite(bend).all(axis=1)).reshape(shape)
    return [
        PairedTrial(
            case.noises[0],
            tuple(units),
            errors[place],
            rival_errors[place],
            inside,
            nees,
            width,
            left_out,
            bool(finite[place].all()),
        )
        for place, (case, (inside, nees, width)) in enumerate(zip(cases, stated, strict=True))
    ]
