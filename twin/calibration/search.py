"""Fit of a preset to logs: CMA-ES for the global search, then nonlinear least squares."""

import dataclasses
import pickle
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cma
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin import __version__
from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import residuals
from twin.calibration.parameters import FreeParameters
from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.preset.preset import Preset, parameter_limits

Array = NDArray[np.float64]

STARTS = 2  # of the evolution strategy: valleys are many, and the best one by the fitted samples is taken
STEP = 0.4  # of the first generation, on the scale of the search: a factor of 1.5
DIFFERENCE = 0.02  # of finite differences, on the same scale


@dataclasses.dataclass(frozen=True)
class Fit:
    """Fitted preset, with residuals and Jacobian at the fit.

    Attributes:
        preset: the fitted preset.
        cost: sum over logs of the mean square error, in units of `BEND_SCALE` and `TENSION_SHARE`.
        jacobian: derivative of the residuals with respect to the search space, (R, P).
        residual: weighted residuals, (R,).
        evaluations: number of simulations of all logs.
    """

    preset: Preset
    cost: float
    jacobian: Array
    residual: Array
    evaluations: int


def calibrate(
    free: FreeParameters,
    loops: Sequence[MeasuredLoop],
    *,
    seed: int,
    evaluations: int = 3000,
    state_file: Path | None = None,
    on_progress: Callable[[int, int, float], None] | None = None,
) -> Fit:
    """Fit a preset to logs.

    CMA-ES (Hansen 2016, package `cma`) spends most of the evaluations, in two starts at twice the time step;
    then least squares in a trust region (SciPy's `trf`) goes to the bottom of the better valley, with finite
    differences of all parameters in one batch.

    Args:
        free: the fitted parameters and their starting values.
        loops: the logs.
        seed: of the evolution strategy.
        evaluations: simulations of all logs that the evolution strategy may use.
        state_file: where its state is kept after each generation; an interrupted calibration goes on there.
        on_progress: called with the evaluations done, their total, and the best cost so far.

    Returns:
        The fit.

    Raises:
        ValueError: there is no log, or `evaluations` is too small for one generation.
    """
    if not loops:
        raise InputError("no log to calibrate on")
    if evaluations < 20:
        raise InputError(f"evaluations = {evaluations}: must be at least 20")
    key = _key(free, loops, seed, evaluations)
    finished, strategy = _resume(state_file, key)
    while len(finished) < STARTS:
        strategy = strategy or _new_strategy(free, seed + len(finished), evaluations // STARTS)
        while not strategy.stop():
            candidates = strategy.ask()
            off = residuals([_coarse(free.decode(numbers)) for numbers in candidates], loops)
            strategy.tell(candidates, (off**2).sum(axis=1).tolist())
            if state_file is not None:
                write_whole(state_file, pickle.dumps((key, finished, strategy)))
            if on_progress:
                done = len(finished) * (evaluations // STARTS) + int(strategy.countevals)
                best = min([float(strategy.best.f), *(cost for cost, _ in finished)])
                on_progress(min(done, evaluations - 1), evaluations, best)  # the last one is the polish
        finished = [*finished, (float(strategy.best.f), np.asarray(strategy.best.x))]
        strategy = None
    _, nearest = min(finished, key=lambda start: start[0])
    fit = _polish(free, loops, nearest, evaluations)
    if on_progress:
        on_progress(evaluations, evaluations, fit.cost)
    return fit


def _coarse(preset: Preset) -> Preset:
    """Return the preset with twice the time step, where the control period allows it."""
    doubled = 2 * preset.time_step
    fits = round(preset.control_period / preset.time_step) % 2 == 0
    return (
        preset.replace(time_step=doubled) if fits and doubled <= parameter_limits("time_step")[1] else preset
    )


def _polish(free: FreeParameters, loops: Sequence[MeasuredLoop], start: Array, used: int) -> Fit:
    def of_one(numbers: Array) -> Array:
        residual: Array = residuals([free.decode(numbers)], loops)[0]
        return residual

    def jacobian(numbers: Array) -> Array:
        up = np.minimum(numbers + DIFFERENCE, free.upper)
        down = np.maximum(numbers - DIFFERENCE, free.lower)
        number = np.arange(len(numbers))
        both = [np.where(number == i, side, numbers) for side in (up, down) for i in number]
        off = residuals([free.decode(numbers) for numbers in both], loops)
        count = len(numbers)
        derivative: Array = ((off[:count] - off[count:]) / (up - down)[:, None]).T
        return derivative

    margin = 1e-6
    inside = np.clip(start, free.lower + margin, free.upper - margin)
    result = least_squares(
        of_one, inside, jac=jacobian, bounds=(free.lower, free.upper), max_nfev=12, xtol=1e-4, ftol=1e-5
    )
    return Fit(
        preset=free.decode(result.x),
        cost=float(2 * result.cost),
        jacobian=result.jac,
        residual=result.fun,
        evaluations=used + int(result.nfev) + 2 * len(start) * int(result.njev),
    )


def _key(free: FreeParameters, loops: Sequence[MeasuredLoop], seed: int, evaluations: int) -> tuple[Any, ...]:
    """Return the inputs of a calibration: a saved state is resumed only if they are the same."""
    logs = [
        (
            loop.name,
            loop.sample_time,
            loop.sheath_bend,
            *(values.tobytes() for values in (loop.pull, loop.bend, loop.tension, loop.fitted)),
        )
        for loop in loops
    ]
    return __version__, free, seed, evaluations, logs


def _new_strategy(free: FreeParameters, seed: int, evaluations: int) -> Any:
    return cma.CMAEvolutionStrategy(
        free.start,
        STEP,
        {"seed": seed + 1, "bounds": [free.lower, free.upper], "verbose": -9, "maxfevals": evaluations},
    )  # CMA takes a seed of 0 for the time of day


def _resume(state_file: Path | None, key: tuple[Any, ...]) -> tuple[list[tuple[float, Array]], Any]:
    """Return the saved state of this calibration: finished starts, and the strategy of an unfinished one."""
    if state_file is None or not state_file.is_file():
        return [], None
    try:
        saved, finished, strategy = pickle.loads(state_file.read_bytes())
    except (
        pickle.UnpicklingError,
        EOFError,
        AttributeError,
        ImportError,
        ValueError,
        LookupError,
        TypeError,
    ):
        return [], None
    return (finished, strategy) if saved == key else ([], None)
