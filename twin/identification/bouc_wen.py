"""Identification of the Bouc-Wen model: a genetic algorithm over batches, then nonlinear least squares.

The search finds the basin. The trust region method of Branch, Coleman and Li (1999), in scipy, then goes to
its bottom, which five parameters that compensate each other make long and flat.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin.hysteresis import BoucWen
from twin.identification.error import Records, Stack, check
from twin.identification.genetic import search

Array = NDArray[np.float64]

LOWER = np.array([0.1, -60.0, 0.05, 0.5, 1.0])  # kappa_x [deg/mm], kappa_w [deg], rho [1/mm], sigma, n
UPPER = np.array([80.0, 60.0, 20.0, 5.0, 10.0])
LOGARITHMIC = np.array([False, False, True, False, True])
DIFFERENCE = 1e-6
"""Step of the finite differences, to either side, on the scale of the unit cube."""


def identify_bouc_wen(
    records: Records,
    seed: int,
    *,
    population: int = 80,
    generations: int = 150,
    on_generation: Callable[[int, float], None] | None = None,
) -> tuple[BoucWen, float]:
    """Fit one Bouc-Wen model to all records.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of each record; the angle at the first sample is known.
        seed: of the genetic algorithm.
        population: candidates per generation.
        generations: number of generations.
        on_generation: called with the number of the generation and the best RMSE so far [deg].

    Returns:
        The best model and its RMSE over all samples [deg].

    Raises:
        ValueError: there is no record, a command does not move or never reverses, or a value is not finite.
    """
    check(records)
    stack = Stack(records)

    def cost(unit: Array) -> Array:
        return stack.mean_square_error(model_at(unit.T[..., None]))  # candidates before records

    def errors(point: Array) -> Array:
        return stack.error(model_at(point)).ravel()

    def derivatives(point: Array) -> Array:
        """Return central differences of all variables in one batch; one-sided at the edge of the cube."""
        ends = [np.clip(point + sign * DIFFERENCE * np.eye(len(point)), 0, 1) for sign in (1, -1)]
        above, below = (stack.error(model_at(end.T[..., None])).reshape(len(point), -1) for end in ends)
        return ((above - below) / np.diagonal(ends[0] - ends[1])[:, None]).T

    best, _ = search(cost, len(LOWER), seed, population, generations, on_generation)
    best = least_squares(errors, best, derivatives, bounds=(0, 1), xtol=1e-10, ftol=1e-12, max_nfev=100).x
    found = model_at(best)
    parameters = (found.kappa_x_deg_per_mm, found.kappa_w_deg, found.rho_per_mm, found.sigma, found.n)
    model = BoucWen(*(float(np.asarray(value)) for value in parameters))
    return model, float(np.sqrt(stack.mean_square_error(model)))


def model_at(unit: Array) -> BoucWen:
    """Return the model at points (5, ...) of the unit cube."""
    kappa_x, kappa_w, rho, sigma, n = (
        low * (high / low) ** value if logarithmic else low + (high - low) * value
        for low, high, logarithmic, value in zip(LOWER, UPPER, LOGARITHMIC, unit, strict=True)
    )
    kappa_w = np.where(np.abs(kappa_w) < 1e-6, 1e-6, kappa_w)  # w of an angle is over kappa_w
    return BoucWen(kappa_x, kappa_w, rho, sigma, n)


def point_of(model: BoucWen) -> Array:
    """Return the point (5,) of the unit cube that a model is at, or the nearest one."""
    values = np.array(dataclasses.astuple(model), dtype=float)
    with np.errstate(invalid="ignore", divide="ignore"):
        logarithms = np.log(values / LOWER) / np.log(UPPER / LOWER)
    point: Array = np.where(LOGARITHMIC, logarithms, (values - LOWER) / (UPPER - LOWER)).clip(0, 1)
    return point
