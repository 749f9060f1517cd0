"""Confirmation of a fit: from the reduced twin, on which it was found, to the twin in MuJoCo."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.fit import Fit
from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import penalised, predict, residuals
from twin.calibration.parameters import FreeParameters
from twin.calibration.valley import Valley
from twin.errors import DivergedError
from twin.preset.preset import Preset

Array = NDArray[np.float64]

CORRECTIONS = 20
"""Most corrections towards what MuJoCo says."""
DAMPINGS = (1e-4, 1e-2, 1.0)
"""Dampings of a correction that are tried, in one batch."""
HELPS = 0.9999
"""Share of the cost that a correction may leave at most, or it was the last one.

Of the cost that noise leaves, a thousandth is a standard deviation of a parameter.
"""
HALVINGS = 4
"""Most halvings of the time step where the simulation diverges."""
TRUSTED = 0.2
"""Farthest that a correction moves a parameter, on the scale of the search."""


def confirmed(
    free: FreeParameters,
    loops: Sequence[MeasuredLoop],
    numbers: Array,
    weight: float,
    jacobian: Callable[[Array, Array | None], Array],
    counted: Sequence[MeasuredLoop],
) -> Fit:
    """Move a fit of the reduced twin to where the twin in MuJoCo agrees with the logs.

    A Gauss-Newton step takes the residuals from MuJoCo and their derivatives from the reduced twin, which
    are the same but for MuJoCo's own step. It is damped (Levenberg and Marquardt), and kept where it helps.

    Args:
        free: the fitted parameters.
        loops: the logs.
        numbers: the fit, in the search space, (P,).
        weight: of the first guess, of `prior_weight`.
        jacobian: derivative of the residuals of the reduced twin at a point (R, P); it is given the last one.
        counted: the logs with the scales by which costs are stated.

    Raises:
        FloatingPointError: MuJoCo diverges along a log even at a much smaller step.
    """
    reduced = residuals([free.decode(numbers)], counted, "reduced")[0]
    told = len(reduced)  # what follows is the departure from the first guess
    base = free.base.replace(time_step=steady(free.decode(numbers), loops).time_step)
    free = dataclasses.replace(free, base=base)
    valley = Valley(free)
    slope, off = jacobian(numbers, None), penalised(free, [numbers], loops, "mujoco", weight)[0]
    for _ in range(CORRECTIONS):
        along = valley.slope(slope, numbers)
        normal, downhill = along.T @ along, along.T @ off
        scale = np.diag(np.diag(normal) + 1e-12)
        ways = [np.linalg.solve(normal + damping * scale, downhill) for damping in DAMPINGS]
        ends = [valley.straight(numbers) - np.clip(way, -TRUSTED, TRUSTED) for way in ways]
        tried = [valley.within(end) for end in ends]
        then = penalised(free, tried, loops, "mujoco", weight)
        best = int(np.argmin((then**2).sum(axis=1)))
        if not float(then[best] @ then[best]) < HELPS * float(off @ off):
            break
        numbers, off = tried[best], then[best]
        slope = jacobian(numbers, slope)
    return Fit(
        free=free,
        preset=free.decode(numbers),
        cost=float((residuals([free.decode(numbers)], counted) ** 2).sum()),
        reduced_cost=float(reduced @ reduced),
        jacobian=slope[:told],
        residual=off[:told],
    )


def steady(preset: Preset, loops: Sequence[MeasuredLoop]) -> Preset:
    """Return a preset with a time step at which MuJoCo follows every log: its own, or a part of it.

    Raises:
        FloatingPointError: MuJoCo diverges along a log even at a much smaller step.
    """
    for halving in range(HALVINGS + 1):
        finer = preset.replace(time_step=preset.time_step / 2**halving)
        if None not in predict([finer], loops)[0]:
            return finer
    raise DivergedError(
        f"the calibrated twin diverges in MuJoCo, even at steps of {finer.time_step:g} s: "
        "fit fewer parameters with `free`, or begin with another `preset`"
    )
