"""Identification of the Coleman-Hodgdon model by a genetic algorithm over batches, as in the RAM paper."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.callback import Callback
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]

LOWER = np.array([0.01, 0.1, 0.0])  # a [1/mm], b [deg/mm], c [deg/mm]
UPPER = np.array([6.0, 80.0, 80.0])
NEVER_REVERSES = "the command never reverses: a loop needs at least one reversal to identify hysteresis"


def identify(
    records: Sequence[tuple[Array, Array]],
    seed: int,
    *,
    monotone: bool = False,
    population: int = 80,
    generations: int = 150,
    on_generation: Callable[[int, float], None] | None = None,
) -> tuple[ColemanHodgdon, float]:
    """Fit one model to all records by pymoo's genetic algorithm (Blank and Deb 2020).

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of each record; the angle at the first sample is known.
        seed: of the genetic algorithm.
        monotone: constrain c >= b / 2, so that loops of any size are monotone.
        population: candidates per generation.
        generations: how many of them.
        on_generation: told the number of the generation and the best RMSE so far [deg].

    Returns:
        The best model and its RMSE over all samples [deg].

    Raises:
        ValueError: there is no record, a command does not move or never reverses, or a value is not finite.
    """
    _check(records)
    if population < 4 or generations < 1:
        raise ValueError(f"population {population}, generations {generations}: at least 4 and 1")
    problem = _FitProblem(records, monotone)
    result = minimize(
        problem,
        GA(pop_size=population, eliminate_duplicates=True),
        ("n_gen", generations),
        seed=seed,
        callback=_Progress(on_generation) if on_generation else Callback(),
    )
    return problem.decode(result.X[None])[0], float(np.sqrt(result.F[0]))


def mean_square_error(model: ColemanHodgdon, records: Sequence[tuple[Array, Array]]) -> Array:
    """Return the mean square error of candidates over all samples of all records [deg^2].

    Args:
        model: parameters of shape (candidates,) or scalars.
        records: `(pull_mm (N,), bend_deg (N,))` of each record.

    Returns:
        (candidates,) or a scalar array; 1e12 where a candidate diverges.
    """
    return _mean_square_error(model, _Stack(records))


class _Stack:
    """Records of any length side by side: shorter ones stand still at their end, with no weight there."""

    def __init__(self, records: Sequence[tuple[Array, Array]]):
        samples = max(len(pull) for pull, _ in records)
        self.pull = np.stack([np.pad(pull, (0, samples - len(pull)), mode="edge") for pull, _ in records])
        self.bend = np.stack([np.pad(bend, (0, samples - len(bend))) for _, bend in records])
        self.weight = np.stack([np.arange(samples) < len(pull) for pull, _ in records])


def _mean_square_error(model: ColemanHodgdon, stack: _Stack) -> Array:
    a, b, c = (np.asarray(v)[..., None] for v in dataclasses.astuple(model))  # candidates before records
    with np.errstate(over="ignore", invalid="ignore"):
        response = ColemanHodgdon(a, b, c).response(stack.pull, stack.bend[:, 0])
        total = np.where(stack.weight, (response - stack.bend) ** 2, 0).sum(axis=(-1, -2))
    return np.nan_to_num(total / stack.weight.sum(), nan=1e12, posinf=1e12)


class _FitProblem(Problem):
    """Search space of the unit cube: log a, b, and c (as its excess over b / 2 if monotone)."""

    def __init__(self, records: Sequence[tuple[Array, Array]], monotone: bool):
        super().__init__(n_var=3, n_obj=1, xl=0.0, xu=1.0)
        self.stack = _Stack(records)
        self.monotone = monotone

    def decode(self, unit: Array) -> list[ColemanHodgdon]:
        batch = self._batch(unit)
        a, b, c = (np.asarray(v) for v in (batch.a_per_mm, batch.b_deg_per_mm, batch.c_deg_per_mm))
        return [ColemanHodgdon(*map(float, p)) for p in zip(a, b, c, strict=True)]

    def _batch(self, unit: Array) -> ColemanHodgdon:
        a = LOWER[0] * (UPPER[0] / LOWER[0]) ** unit[:, 0]
        b = LOWER[1] + (UPPER[1] - LOWER[1]) * unit[:, 1]
        c = LOWER[2] + (UPPER[2] - LOWER[2]) * unit[:, 2]
        return ColemanHodgdon(a, b, c + b / 2 if self.monotone else c)

    def _evaluate(self, x: Array, out: dict, *args: object, **kwargs: object) -> None:
        out["F"] = _mean_square_error(self._batch(x), self.stack)[:, None]


class _Progress(Callback):
    def __init__(self, on_generation: Callable[[int, float], None]):
        super().__init__()
        self.on_generation = on_generation

    def notify(self, algorithm: GA) -> None:
        self.on_generation(algorithm.n_gen, float(np.sqrt(algorithm.opt[0].F[0])))


def _check(records: Sequence[tuple[Array, Array]]) -> None:
    if not records:
        raise ValueError("no record to identify from")
    for index, (pull, bend) in enumerate(records):
        if not (np.isfinite(pull).all() and np.isfinite(bend).all()):
            raise ValueError(f"record {index}: command and angle must be finite")
        moves = np.diff(pull)
        moves = moves[np.abs(moves) > 1e-9]
        if not moves.size:
            raise ValueError(f"record {index}: the command never moves")
    if not any((np.diff(pull) > 0).any() and (np.diff(pull) < 0).any() for pull, _ in records):
        raise ValueError(NEVER_REVERSES)
