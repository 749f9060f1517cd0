"""Identification of each model of hysteresis from records.

Coleman and Hodgdon's by a genetic algorithm over batches, as in the RAM paper. Bouc and Wen's by the same,
which finds the basin, then by the trust region method of Branch, Coleman and Li (1999) in scipy, which goes
to its bottom: five parameters that compensate each other make it long and flat. Prandtl and Ishlinskii's by
non-negative least squares (Lawson and Hanson 1974): the angle is linear in the weights, so the problem is
convex.
"""

import dataclasses
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from twin.errors import InputError
from twin.hysteresis import BoucWen, ColemanHodgdon, PrandtlIshlinskii
from twin.hysteresis.prandtl_ishlinskii import plays_along
from twin.identification.search import OnGeneration, Records, Stack, check, mean_square_error, search

Array = NDArray[np.float64]
Model = TypeVar("Model", bound=ColemanHodgdon | BoucWen)

LOWER = np.array([0.01, 0.1, 0.0])  # a [1/mm], b [deg/mm], c [deg/mm] of Coleman and Hodgdon
UPPER = np.array([6.0, 80.0, 80.0])
# kappa_x [deg/mm], kappa_w [deg], rho [1/mm], sigma, n
BOUC_WEN_LOWER = np.array([0.1, -60.0, 0.05, 0.5, 1.0])
BOUC_WEN_UPPER = np.array([80.0, 60.0, 20.0, 5.0, 10.0])
LOGARITHMIC = np.array([False, False, True, False, True])
DIFFERENCE = 1e-6  # step of the finite differences, to either side, on the scale of the unit cube
PLAYS = 8  # number of plays where no thresholds are given


def identify_coleman_hodgdon(
    records: Records,
    seed: int,
    *,
    monotone: bool = False,
    population: int = 80,
    generations: int = 150,
    on_generation: OnGeneration | None = None,
) -> tuple[ColemanHodgdon, float]:
    """Fit one Coleman-Hodgdon model to all records; returns it and its RMSE over all samples [deg].

    `monotone` constrains c >= b / 2. The options are those of `twin.identification.identify`.
    """
    check(records)
    stack = Stack(records)

    def cost(unit: Array) -> Array:
        return stack.mean_square_error(coleman_hodgdon_at(unit.T[..., None], monotone))

    best, mean_square = search(cost, len(LOWER), seed, population, generations, on_generation)
    return with_floats(coleman_hodgdon_at(best, monotone)), float(np.sqrt(mean_square))


def coleman_hodgdon_at(unit: Array, monotone: bool = False) -> ColemanHodgdon:
    """Return the model at points (3, ...) of the unit cube: log a, b and c, or c - b / 2 if monotone."""
    a = LOWER[0] * (UPPER[0] / LOWER[0]) ** unit[0]
    b = LOWER[1] + (UPPER[1] - LOWER[1]) * unit[1]
    c = LOWER[2] + (UPPER[2] - LOWER[2]) * unit[2]
    return ColemanHodgdon(a, b, c + b / 2 if monotone else c)


def coleman_hodgdon_point(model: ColemanHodgdon, monotone: bool = False) -> Array:
    """Return the point (3,) of the unit cube of a model, or the nearest one."""
    a, b, c = (float(np.asarray(value)) for value in dataclasses.astuple(model))
    above = (np.array([a, b, c - b / 2 if monotone else c]) - LOWER) / (UPPER - LOWER)
    above[0] = np.log(a / LOWER[0]) / np.log(UPPER[0] / LOWER[0])
    point: Array = above.clip(0, 1)
    return point


def identify_bouc_wen(
    records: Records,
    seed: int,
    *,
    population: int = 80,
    generations: int = 150,
    on_generation: OnGeneration | None = None,
) -> tuple[BoucWen, float]:
    """Fit one Bouc-Wen model to all records; returns it and its RMSE over all samples [deg]."""
    check(records)
    stack = Stack(records)

    def cost(unit: Array) -> Array:
        return stack.mean_square_error(bouc_wen_at(unit.T[..., None]))  # candidates before records

    def errors(point: Array) -> Array:
        return stack.error(bouc_wen_at(point)).ravel()

    def derivatives(point: Array) -> Array:
        """Return central differences of all variables in one batch; one-sided at the edge of the cube."""
        ends = [np.clip(point + sign * DIFFERENCE * np.eye(len(point)), 0, 1) for sign in (1, -1)]
        above, below = (stack.error(bouc_wen_at(end.T[..., None])).reshape(len(point), -1) for end in ends)
        return ((above - below) / np.diagonal(ends[0] - ends[1])[:, None]).T

    best, _ = search(cost, len(BOUC_WEN_LOWER), seed, population, generations, on_generation)
    best = least_squares(errors, best, derivatives, bounds=(0, 1), xtol=1e-10, ftol=1e-12, max_nfev=100).x
    model = with_floats(bouc_wen_at(best))
    return model, float(np.sqrt(stack.mean_square_error(model)))


def bouc_wen_at(unit: Array) -> BoucWen:
    """Return the model at points (5, ...) of the unit cube."""
    kappa_x, kappa_w, rho, sigma, n = (
        low * (high / low) ** value if logarithmic else low + (high - low) * value
        for low, high, logarithmic, value in zip(
            BOUC_WEN_LOWER, BOUC_WEN_UPPER, LOGARITHMIC, unit, strict=True
        )
    )
    kappa_w = np.where(np.abs(kappa_w) < 1e-6, 1e-6, kappa_w)  # w of an angle is over kappa_w
    return BoucWen(kappa_x, kappa_w, rho, sigma, n)


def bouc_wen_point(model: BoucWen) -> Array:
    """Return the point (5,) of the unit cube of a model, or the nearest one."""
    low, high = BOUC_WEN_LOWER, BOUC_WEN_UPPER
    values = np.array(dataclasses.astuple(model), dtype=float)
    with np.errstate(invalid="ignore", divide="ignore"):
        logarithms = np.log(values / low) / np.log(high / low)
    point: Array = np.where(LOGARITHMIC, logarithms, (values - low) / (high - low)).clip(0, 1)
    return point


def with_floats(model: Model) -> Model:
    """Return the model with each parameter as a float."""
    return type(model)(*(float(np.asarray(value)) for value in vars(model).values()))


def identify_prandtl_ishlinskii(
    records: Records, *, thresholds_mm: Sequence[float] = ()
) -> tuple[PrandtlIshlinskii, float]:
    """Fit the weights of one Prandtl-Ishlinskii model to all records, which begin with a pull from rest.

    The first angle of a record is measured with noise that a play never forgets, so the level of each record
    is free in the fit. The returned error is that of the response from the measured first angle, as for other
    models.
    """
    check(records)
    thresholds = tuple(map(float, thresholds_mm)) or spread_thresholds(records)
    if not (
        np.isfinite(thresholds).all() and min(thresholds) >= 0 and len(set(thresholds)) == len(thresholds)
    ):
        raise InputError(f"thresholds {list(thresholds)} mm: must be different and not negative")
    plays = np.concatenate([_centred(plays_along(pull, thresholds)) for pull, _ in records], axis=1)
    bend = np.concatenate([_centred(angle) for _, angle in records])
    weights, _ = nnls(plays.T, bend)
    model = PrandtlIshlinskii(tuple(map(float, weights)), thresholds)
    return model, float(np.sqrt(mean_square_error(model, records)))


def spread_thresholds(records: Records) -> tuple[float, ...]:
    """Return `PLAYS` thresholds [mm], evenly spaced from 0 to just below half the largest command range.

    A play of half the range is dragged once and never comes back.
    """
    half = max(float(np.ptp(pull)) for pull, _ in records) / 2
    return tuple(float(threshold) for threshold in np.arange(PLAYS) * half / PLAYS)


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean(axis=-1, keepdims=True))
