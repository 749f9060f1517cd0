"""Fit of a preset to logs: CMA-ES for the global search, then nonlinear least squares."""

import dataclasses
from collections.abc import Callable, Sequence
from importlib.metadata import version
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
from twin.files.state_file import damaged_state, read_state, state_key, write_state
from twin.preset.preset import Preset, parameter_limits

Array = NDArray[np.float64]

STARTS = 2  # of the evolution strategy: valleys are many, and the best one by the fitted samples is taken
STEP = 0.4  # of the first generation, on the scale of the search: a factor of 1.5
DIFFERENCE = 0.02  # of finite differences, on the same scale
STATE = "calibration state"
"""Kind of the state that an interrupted calibration leaves."""
LEAST_EVALUATIONS, MOST_EVALUATIONS = 20, 1_000_000
MOST_SEED = 2**32 - 1 - STARTS


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
        state_file: where the costs of its generations are kept; an interrupted calibration goes on there.
        on_progress: called with the evaluations done, their total, and the best cost so far.

    Returns:
        The fit.

    Raises:
        ValueError: there is no log, `evaluations` or `seed` is out of range, or the state file is foreign or
            damaged.
    """
    if not loops:
        raise InputError("no log to calibrate on")
    check_effort(evaluations, seed)
    key = _key(free, loops, seed, evaluations) if state_file else ""
    saved = (read_state(state_file, STATE, key) if state_file else None) or {}
    costs: dict[str, Array] = {}
    finished: list[tuple[float, Array]] = []
    for start in range(STARTS):
        strategy = _new_strategy(free, seed + start, evaluations // STARTS)
        name = f"costs of start {start + 1}"
        known = saved.get(name, np.empty((0, strategy.popsize)))
        if state_file and known.shape[1:] != (strategy.popsize,):
            raise damaged_state(state_file)
        costs[name] = known
        generation = 0
        while not strategy.stop():
            # The strategy is never saved: from its seed and the costs it goes through the same states again.
            candidates = strategy.ask()
            generation += 1
            if generation <= len(known):
                strategy.tell(candidates, known[generation - 1].tolist())
                continue
            off = residuals([_coarse(free.decode(numbers)) for numbers in candidates], loops)
            cost = (off**2).sum(axis=1)
            strategy.tell(candidates, cost.tolist())
            costs[name] = np.vstack([costs[name], cost])
            if state_file is not None:
                write_state(state_file, STATE, key, costs)
            if on_progress:
                done = start * (evaluations // STARTS) + int(strategy.countevals)
                best = min([float(strategy.best.f), *(reached for reached, _ in finished)])
                on_progress(min(done, evaluations - 1), evaluations, best)  # the last one is the polish
        finished.append((float(strategy.best.f), np.asarray(strategy.best.x)))
    _, nearest = min(finished, key=lambda reached: reached[0])
    fit = _polish(free, loops, nearest, evaluations)
    if on_progress:
        on_progress(evaluations, evaluations, fit.cost)
    return fit


def check_effort(evaluations: int, seed: int) -> None:
    """Refuse a number of evaluations or a seed that cannot be.

    Raises:
        ValueError: so it is.
    """
    if not LEAST_EVALUATIONS <= evaluations <= MOST_EVALUATIONS:
        raise InputError(
            f"evaluations = {evaluations}: must be at least {LEAST_EVALUATIONS}, at most {MOST_EVALUATIONS}"
        )
    if not 0 <= seed <= MOST_SEED:
        raise InputError(f"seed = {seed}: must be at least 0 and at most {MOST_SEED}")


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


def _key(free: FreeParameters, loops: Sequence[MeasuredLoop], seed: int, evaluations: int) -> str:
    """Return the SHA-256 of all that the costs depend on: a saved state is resumed only if it is the same."""
    versions = [version(name) for name in ("cma", "numpy", "scipy", "mujoco", "dm_control")]
    inputs: list[Any] = [__version__, versions, seed, evaluations, free.base.to_dict(), list(free.names)]
    for loop in loops:
        inputs += [loop.name, loop.sample_time, loop.sheath_bend]
        inputs += [loop.pull, loop.bend, loop.tension, loop.fitted]
    return state_key(*inputs)


def _new_strategy(free: FreeParameters, seed: int, evaluations: int) -> Any:
    options: dict[str, Any] = {
        "bounds": [free.lower, free.upper],
        "verbose": -9,
        "maxfevals": evaluations,
        # A stream of its own, so that nothing else that draws numbers changes it.
        "randn": np.random.RandomState(seed + 1).randn,
        "seed": np.nan,
    }
    if len(free.names) == 1:
        options["maxstd_boundrange"] = np.inf  # with one parameter, cma 4.5 fails where it limits the step
    return cma.CMAEvolutionStrategy(free.start, STEP, options)
