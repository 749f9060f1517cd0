"""Identification of the Coleman-Hodgdon model by a genetic algorithm over batches, as in the RAM paper."""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.hysteresis import ColemanHodgdon
from twin.identification.error import Records, Stack, check
from twin.identification.genetic import search

Array = NDArray[np.float64]

LOWER = np.array([0.01, 0.1, 0.0])  # a [1/mm], b [deg/mm], c [deg/mm]
UPPER = np.array([6.0, 80.0, 80.0])


def identify_coleman_hodgdon(
    records: Records,
    seed: int,
    *,
    monotone: bool = False,
    population: int = 80,
    generations: int = 150,
    on_generation: Callable[[int, float], None] | None = None,
) -> tuple[ColemanHodgdon, float]:
    """Fit one Coleman-Hodgdon model to all records by pymoo's genetic algorithm (Blank and Deb 2020).

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of each record; the angle at the first sample is known.
        seed: of the genetic algorithm.
        monotone: constrain c >= b / 2, so that loops of any size are monotone.
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
        return stack.mean_square_error(model_at(unit.T[..., None], monotone))  # candidates before records

    best, mean_square = search(cost, len(LOWER), seed, population, generations, on_generation)
    found = model_at(best, monotone)
    parameters = (found.a_per_mm, found.b_deg_per_mm, found.c_deg_per_mm)
    return ColemanHodgdon(*(float(np.asarray(value)) for value in parameters)), float(np.sqrt(mean_square))


def model_at(unit: Array, monotone: bool = False) -> ColemanHodgdon:
    """Return the model at points (3, ...) of the unit cube: log a, b and c, or c - b / 2 if monotone."""
    a = LOWER[0] * (UPPER[0] / LOWER[0]) ** unit[0]
    b = LOWER[1] + (UPPER[1] - LOWER[1]) * unit[1]
    c = LOWER[2] + (UPPER[2] - LOWER[2]) * unit[2]
    return ColemanHodgdon(a, b, c + b / 2 if monotone else c)


def point_of(model: ColemanHodgdon, monotone: bool = False) -> Array:
    """Return the point (3,) of the unit cube that a model is at, or the nearest one."""
    a, b, c = (float(np.asarray(value)) for value in dataclasses.astuple(model))
    above = (np.array([a, b, c - b / 2 if monotone else c]) - LOWER) / (UPPER - LOWER)
    above[0] = np.log(a / LOWER[0]) / np.log(UPPER[0] / LOWER[0])
    point: Array = above.clip(0, 1)
    return point
