"""Genetic algorithm over the unit cube, each generation as one batch (pymoo; Blank and Deb 2020)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.callback import Callback
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

Array = NDArray[np.float64]


def search(
    cost: Callable[[Array], Array],
    variables: int,
    seed: int,
    population: int,
    generations: int,
    on_generation: Callable[[int, float], None] | None = None,
) -> tuple[Array, float]:
    """Minimise a cost over the unit cube; returns the best point found.

    Args:
        cost: mean square errors (candidates,) [deg^2] of points (candidates, variables) of the unit cube.
        variables: number of variables.
        seed: of the genetic algorithm.
        population: candidates per generation.
        generations: number of generations.
        on_generation: called with the number of the generation and the best RMSE so far [deg].

    Returns:
        The best point (variables,), and its cost [deg^2].
    """
    result = minimize(
        _UnitCube(cost, variables),
        GA(pop_size=population, eliminate_duplicates=True),
        ("n_gen", generations),
        seed=seed,
        callback=_Progress(on_generation) if on_generation else Callback(),
        copy_algorithm=False,
    )
    return result.X, float(result.F[0])


class _UnitCube(Problem):  # type: ignore[misc]  # pymoo has no types
    def __init__(self, cost: Callable[[Array], Array], variables: int):
        super().__init__(n_var=variables, n_obj=1, xl=0.0, xu=1.0)
        self.cost = cost

    def _evaluate(self, x: Array, out: dict[str, Array], *args: object, **kwargs: object) -> None:
        out["F"] = self.cost(x)[:, None]


class _Progress(Callback):  # type: ignore[misc]  # pymoo has no types
    def __init__(self, on_generation: Callable[[int, float], None]):
        super().__init__()
        self.on_generation = on_generation

    def notify(self, algorithm: GA) -> None:
        self.on_generation(algorithm.n_gen, float(np.sqrt(algorithm.opt[0].F[0])))
