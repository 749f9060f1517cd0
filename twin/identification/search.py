"""Search for a model of hysteresis: error of batches of candidates on records, and a genetic algorithm."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.callback import Callback
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

from twin.errors import InputError
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]
Records = Sequence[tuple[Array, Array]]
"""Records as pairs of pulling distance (N,) [mm] and bending angle (N,) [deg]; the first angle is known."""
OnGeneration = Callable[[int, float], None]
"""Called with the number of the generation and the best RMSE so far [deg]."""

NEVER_REVERSES = "the command never reverses: a loop needs at least one reversal to identify hysteresis"
DIVERGED = 1e12  # mean square error of a response that is not finite [deg^2]


def reverses(pull: Array) -> bool:
    """Return whether a command (N,) goes both ways."""
    steps = np.diff(pull)
    return bool((steps > 0).any() and (steps < 0).any())


def check(records: Records) -> None:
    """Check that a model can be identified: values are finite, every command moves, and one reverses."""
    if not records:
        raise InputError("no record to identify from")
    for index, (pull, bend) in enumerate(records):
        if not (np.isfinite(pull).all() and np.isfinite(bend).all()):
            raise InputError(f"record {index}: command and angle must be finite")
        if not (np.abs(np.diff(pull)) > 1e-9).any():
            raise InputError(f"record {index}: the command never moves")
    if not any(reverses(pull) for pull, _ in records):
        raise InputError(NEVER_REVERSES)


class Stack:
    """Records of any length in one array: shorter ones are padded, with zero weight there."""

    def __init__(self, records: Records):
        samples = max(len(pull) for pull, _ in records)
        self.pull = np.stack([np.pad(pull, (0, samples - len(pull)), mode="edge") for pull, _ in records])
        self.bend = np.stack([np.pad(bend, (0, samples - len(bend))) for _, bend in records])
        self.weight = np.stack([np.arange(samples) < len(pull) for pull, _ in records])

    def error(self, model: HysteresisModel) -> Array:
        """Return response minus angle (..., records, N) [deg]; 0 where a record has ended.

        The response starts from the measured angle at the first sample.
        """
        return np.where(self.weight, model.response(self.pull, self.bend[:, 0]) - self.bend, 0)

    def mean_square_error(self, model: HysteresisModel) -> Array:
        """Return `mean_square_error` of these records."""
        with np.errstate(over="ignore", invalid="ignore"):
            total = (self.error(model) ** 2).sum(axis=(-1, -2))
        mean: Array = np.nan_to_num(total / self.weight.sum(), nan=DIVERGED, posinf=DIVERGED)
        return mean


def mean_square_error(model: HysteresisModel, records: Records) -> Array:
    """Return the mean square error over all samples of all records [deg^2], `DIVERGED` where it diverges.

    A scalar array, or (candidates,) for a model whose parameters have the shape (candidates, 1).
    """
    return Stack(records).mean_square_error(model)


def search(
    cost: Callable[[Array], Array],
    variables: int,
    seed: int,
    population: int,
    generations: int,
    on_generation: OnGeneration | None = None,
) -> tuple[Array, float]:
    """Minimise over the unit cube by a genetic algorithm, each generation as one batch (Blank and Deb 2020).

    `cost` returns the mean square errors (candidates,) [deg^2] of points (candidates, variables). Returns the
    best point (variables,) and its cost.
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
    def __init__(self, on_generation: OnGeneration):
        super().__init__()
        self.on_generation = on_generation

    def notify(self, algorithm: GA) -> None:
        self.on_generation(algorithm.n_gen, float(np.sqrt(algorithm.opt[0].F[0])))
