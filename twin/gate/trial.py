"""Trials: a policy and its rival on the same runs under one noise, sample by sample."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.estimation.gaussian import DEVIATIONS_OF_95
from twin.estimation.knowledge import Case
from twin.gate.cases import Condition

Array = NDArray[np.float64]
WORST_DEG2 = 1e8
"""Square error of an estimate that is no number [deg^2]."""
_TOLD_EVERY = 10  # samples between two tellings of progress


class PairedTrial(NamedTuple):
    """Errors of two estimators on U units (twins or logs) with D draws of one noise on each.

    Attributes:
        noise: kind and level.
        units: (U,) what each unit is of: the stroke of a twin, the name of a log.
        squares: (U, D) mean square error of the policy [deg^2].
        rival: the same of its rival [deg^2].
        inside: (U, D) share of samples whose stated 95 % interval held the truth; None where none is stated.
        nees: (U, D) mean square error in units of the variance that the interval states; likewise.
        half_width_deg: (U, D) mean half width of the interval [deg]; likewise.
        left_out: twins that found no equilibrium.
        finite: whether every estimate was a number.
    """

    noise: Condition
    units: tuple[Any, ...]
    squares: Array
    rival: Array
    inside: Array | None
    nees: Array | None
    half_width_deg: Array | None
    left_out: int
    finite: bool


def run_trials(
    policy: Estimator[Any],
    rival: Estimator[Any],
    cases: Sequence[Case],
    units: Sequence[Any],
    left_out: int,
    on_progress: Callable[[int, int], None],
    *,
    once: bool = False,
) -> list[PairedTrial]:
    """Run both estimators on all noises at once; the first sample, which is given, is not scored.

    Args:
        policy: not told of a sensor yet.
        rival: likewise.
        cases: one for each noise, each with the same units in the same order; truths are with them.
        units: what each is of.
        left_out: twins that found no equilibrium.
        on_progress: told how many of how many samples are done.
        once: both are one estimator, which is run once.
    """
    pull, measured, initial, truth, variance = (
        np.concatenate(parts)
        for parts in zip(
            *(
                (c.pull_mm, c.measurement_deg, c.initial_bend_deg, c.truth_deg, c.sensor.variance)
                for c in cases
            ),
            strict=True,
        )
    )
    sensor = Sensor(variance, np.concatenate([np.asarray(c.sensor.bound) for c in cases]))
    bend, half = follow(policy.with_sensor(sensor), pull, measured, initial, on_progress)
    other = bend if once else follow(rival.with_sensor(sensor), pull, measured, initial)[0]
    scored = ~np.isnan(measured)
    scored[:, 0] = False
    shape = len(cases), len(units), -1

    def mean(values: Array) -> Array:
        whole = np.where(scored, values, 0.0).sum(axis=1) / np.maximum(scored.sum(axis=1), 1)
        by_case: Array = whole.reshape(shape)
        return by_case

    finite = np.asarray(np.isfinite(bend).all(axis=1)).reshape(shape)
    with np.errstate(all="ignore"):
        square, rivals = (
            np.nan_to_num((of - truth) ** 2, nan=WORST_DEG2, posinf=WORST_DEG2).clip(max=WORST_DEG2)
            for of in (bend, other)
        )
        inside = nees = width = None
        if half is not None:
            inside = mean(np.abs(bend - truth) <= half)
            nees = mean((square / np.maximum(half / DEVIATIONS_OF_95, 1e-9) ** 2).clip(max=1e6))
            width = mean(np.nan_to_num(half, nan=1e6, posinf=1e6))
        errors, rival_errors = mean(square), mean(rivals)
    return [
        PairedTrial(
            case.noises[0],
            tuple(units),
            errors[place],
            rival_errors[place],
            None if inside is None else inside[place],
            None if nees is None else nees[place],
            None if width is None else width[place],
            left_out,
            bool(finite[place].all()),
        )
        for place, case in enumerate(cases)
    ]


def follow(
    estimator: Estimator[Any],
    pull_mm: Array,
    measurement_deg: Array,
    initial_bend_deg: Array,
    on_progress: Callable[[int, int], None] | None = None,
) -> tuple[Array, Array | None]:
    """Return (B, N) estimates and half of their 95 % intervals [deg], or None, sample by sample."""
    pull, measured, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
    state = estimator.start(pull[0], initial)
    bend = np.empty_like(measured)
    half = np.empty_like(measured) if estimator.states_interval else None
    bend[0] = initial
    if half is not None:
        half[0] = estimator.half_width_deg(state)
    with np.errstate(all="ignore"):  # a policy that diverges is a result
        for k in range(1, len(measured)):
            state = estimator.step(state, pull[k], pull[k - 1], measured[k])
            bend[k] = estimator.bend_deg(state)
            if half is not None:
                half[k] = estimator.half_width_deg(state)
            if on_progress and (k % _TOLD_EVERY == 0 or k == len(measured) - 1):
                on_progress(k, len(measured) - 1)
    return bend.T, None if half is None else half.T
