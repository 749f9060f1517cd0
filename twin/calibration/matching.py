"""Calibration to a Coleman-Hodgdon model, for an instrument of which only a, b and c are published."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from twin.calibration.parameters import FreeParameters
from twin.hysteresis import ColemanHodgdon
from twin.physics import simulate_batch
from twin.preset.preset import Preset
from twin.signals.excitation import SIGNALS, command

Array = NDArray[np.float64]

MATCHED = (
    "section_stiffness",
    "wire_stiffness",
    "joint_friction",
    "sheath_friction_floor",
    "pretension",
)
"""Parameters of a preset that are fitted to a published Coleman-Hodgdon model."""
SAMPLE_TIME = 0.02  # of the records [s]
THINNED = 5  # the model is fitted to every fifth sample
MISFIT_WEIGHT = 0.3  # residual per RMSE of the Coleman-Hodgdon fit [1 / deg]; 1 is 1 % in a, b or c
MOVE_WEIGHT = 0.5  # residual of a parameter that moves by a factor of e from its start


def best_coleman_hodgdon(records: Sequence[tuple[Array, Array]]) -> tuple[Array, float]:
    """Fit a Coleman-Hodgdon model to records; returns its parameters and RMSE.

    For a given a the response is linear in b and c (variable projection, Golub and Pereyra 1973), so that the
    search is along one line.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of each.

    Returns:
        (3,) a [1/mm], b [deg/mm], c [deg/mm]; RMSE [deg].
    """
    unit_b, unit_c, silent = ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0))

    def project(logarithm: float) -> tuple[Array, float]:
        a = float(np.exp(logarithm))
        columns, targets = [], []
        for pull, bend in records:
            free = ColemanHodgdon(a, *silent).response(pull, bend[0])
            of_b, of_c = (
                ColemanHodgdon(a, *unit).response(pull, bend[0]) - free for unit in (unit_b, unit_c)
            )
            columns.append(np.stack([of_b, of_c], axis=1))
            targets.append(bend - free)
        matrix, target = np.concatenate(columns), np.concatenate(targets)
        solution = np.linalg.lstsq(matrix, target, rcond=None)[0]
        return np.array([a, *solution]), float(np.sqrt(np.mean((target - matrix @ solution) ** 2)))

    bounds = (np.log(0.05), np.log(6.0))
    found = minimize_scalar(lambda x: project(x)[1], bounds=bounds, method="bounded", options={"xatol": 1e-4})
    return project(found.x)


def training_commands(stroke: tuple[float, float], episodes: int, seconds: float, seed: int) -> list[Array]:
    """Return the commands [m] of a generated dataset with that seed."""
    kinds = list(SIGNALS)
    streams = (np.random.SeedSequence([seed, number]).spawn(1)[0] for number in range(episodes))
    return [
        command(kinds[number % len(kinds)], stroke, seconds, SAMPLE_TIME, np.random.default_rng(stream))
        for number, stream in enumerate(streams)
    ]


def match(
    free: FreeParameters,
    target: Sequence[float],
    commands: Sequence[Array],
    *,
    iterations: int = 6,
    on_iteration: Callable[[int, Array, float], None] | None = None,
) -> Preset:
    """Fit a preset such that the Coleman-Hodgdon model of its loops has given parameters.

    Damped Gauss-Newton steps on 100 log(parameter / target), with a little weight on the model's misfit and
    on how far a parameter moves, as there are more parameters than targets.

    Args:
        free: the fitted parameters and their starting values.
        target: a [1/mm], b [deg/mm], c [deg/mm].
        commands: (N,) pulling distances [m] that the loops are made with.
        iterations: largest number of iterations.
        on_iteration: called with the iteration, the model's a, b, c and its RMSE [deg].

    Returns:
        The fitted preset.
    """

    def residual(numbers: Array, found: tuple[Array, float]) -> Array:
        off = 100 * np.log(np.maximum(found[0], 1e-6) / np.asarray(target))
        return np.concatenate([off, [MISFIT_WEIGHT * found[1]], MOVE_WEIGHT * (numbers - free.start)])

    def evaluate(candidates: Sequence[Array]) -> list[tuple[Array, float]]:
        presets = [free.decode(numbers) for numbers in candidates]
        episodes = simulate_batch(
            [preset for preset in presets for _ in commands], list(commands) * len(presets), SAMPLE_TIME
        )
        records = [(e.pull_mm[::THINNED], e.bend_deg[::THINNED]) if e is not None else None for e in episodes]
        count = len(commands)
        groups = [records[start : start + count] for start in range(0, len(records), count)]
        return [
            best_coleman_hodgdon(whole)
            if len(whole := [record for record in group if record is not None]) == count
            else (np.full(3, 1e-6), 1e3)
            for group in groups
        ]

    numbers = free.start
    found = evaluate([numbers])[0]
    step = 0.03
    for iteration in range(iterations):
        if on_iteration:
            on_iteration(iteration, *found)
        shifts = step * np.eye(len(numbers))
        both = evaluate([*(numbers + shifts), *(numbers - shifts)])
        sides = [residual(numbers + s, f) for s, f in zip([*shifts, *-shifts], both, strict=True)]
        off = residual(numbers, found)
        jacobian = (np.array(sides[: len(numbers)]) - np.array(sides[len(numbers) :])).T / (2 * step)
        normal, slope = jacobian.T @ jacobian, jacobian.T @ off
        candidates = [
            numbers - np.clip(np.linalg.solve(normal + damping * np.eye(len(numbers)), slope), -0.3, 0.3)
            for damping in (0.1, 10.0, 100.0)
        ]
        reached = evaluate(candidates)
        costs = [float((residual(c, f) ** 2).sum()) for c, f in zip(candidates, reached, strict=True)]
        best = int(np.argmin(costs))
        if costs[best] > 0.99 * float(off @ off):
            break
        numbers, found = candidates[best], reached[best]
    return free.decode(numbers)
