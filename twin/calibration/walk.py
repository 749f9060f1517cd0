"""Walk along a valley of a search: one parameter is moved step by step, and all others follow (a profile).

Which hinges slide first is decided by how joint friction is distributed. Section stiffness, friction and
initial bend follow it, so that logs are explained almost as well in a row of valleys, with ridges between
them that a descent does not cross. Steps over the ridge do (profile likelihood, Raue et al. 2009).
"""

import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.calibration.descent import descend
from twin.calibration.measured import MeasuredLoop
from twin.calibration.objective import departure
from twin.calibration.parameters import FreeParameters

Array = NDArray[np.float64]

ALONG = ("joint_friction_taper", "section_stiffness", "joint_friction")
"""Parameters to walk along; the first that is fitted is taken."""
STRIDES = (0.1, 0.03)
"""Length of a step on the scale of the search, of each walk."""
FARTHEST = 10
"""Most steps to a side."""
TOO_HIGH = 1.5
"""Cost at which a walk ends, times the lowest that it met."""


def parameter_along(free: FreeParameters) -> str | None:
    """Return the parameter to walk along; None if no such parameter is fitted, or no other one."""
    return next((name for name in ALONG if name in free.names and len(free.names) > 1), None)


def walk(
    free: FreeParameters,
    loops: Sequence[MeasuredLoop],
    cost: float,
    start: Array,
    name: str,
    stride: float,
    steps: int,
    weight: float,
    *,
    threads: int,
    stopped: threading.Event,
) -> Array:
    """Return what a walk to one side meets, (FARTHEST, 1 + P): the cost and the point of each step.

    It ends early where the cost rises to `TOO_HIGH`, or at a limit; then the last step stands for the rest.

    Args:
        free: the fitted parameters.
        loops: the logs.
        cost: where it begins.
        start: where it begins, (P,).
        name: the parameter to walk along.
        stride: of a step; negative for the other side.
        steps: most steps of each descent of the others.
        weight: of the first guess, of `prior_weight`.
        threads: number of threads of the derivatives; 0 for one per core.
        stopped: ends it early.

    Raises:
        CancelledError: it was stopped.
    """
    here, place = start.copy(), free.names.index(name)
    others = [number for number in range(len(here)) if number != place]
    names = tuple(free.names[other] for other in others)
    lower, upper = free.lower[place], free.upper[place]
    met = np.tile(np.append(cost, start), (FARTHEST, 1))
    lowest = cost
    for number in range(FARTHEST):
        here[place] += stride
        if not lower <= here[place] <= upper:
            break
        value = getattr(free.decode(here), name)
        rest = FreeParameters(free.base.replace(**{name: value}), names)
        cost, *found = descend(
            rest, loops, here[others], steps, weight, smooth=False, threads=threads, stopped=stopped
        )
        here[others] = found
        cost += float(departure(free, here, weight)[place]) ** 2
        met[number:] = cost, *here
        lowest = min(lowest, cost)
        if cost > TOO_HIGH * lowest:
            break
    return met
