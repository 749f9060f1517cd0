"""Descent of a search: least squares in a trust region on the reduced twin, and its derivatives."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from twin.calibration.logs import MeasuredLoop
from twin.calibration.objective import departure, penalised
from twin.calibration.parameters import FreeParameters

Array = NDArray[np.float64]


class Valley:
    """Change between a point of the search space and one of the straight valley; both are (P,)."""

    def __init__(self, free: FreeParameters) -> None:
        """Find the parameters that make the valley; without both of them nothing changes."""
        self._free = free
        self._places = [
            free.names.index(name) if name in free.names else -1
            for name in ("wire_stiffness", "wire_stiffening", "pretension")
        ]

    def straight(self, numbers: Array) -> Array:
        """Return the straight coordinates of a point of the search space."""
        return self._shifted(numbers, 1.0)

    def point(self, straight: Array) -> Array:
        """Return the point of the search space that has these straight coordinates."""
        return self._shifted(straight, -1.0)

    def within(self, straight: Array) -> Array:
        """Return the point of the search space, clipped to its limits: a stiffness may be beyond."""
        point: Array = np.clip(self.point(straight), self._free.lower, self._free.upper)
        return point

    def bounds(self) -> tuple[Array, Array]:
        """Return the limits of the straight coordinates, (P,) each; that of the stiffness has none."""
        lower, upper = self._free.lower, self._free.upper
        stiffness, stiffening, _ = self._places
        if min(stiffness, stiffening) >= 0:
            lower[stiffness], upper[stiffness] = -np.inf, np.inf
        return lower, upper

    def slope(self, jacobian: Array, numbers: Array) -> Array:
        """Return derivatives (R, P) at a point with respect to the straight coordinates."""
        stiffness, stiffening, pretension = self._places
        slope = jacobian.copy()
        if min(stiffness, stiffening) >= 0:
            growth = self._growth(numbers)
            for place in {stiffening, pretension} - {-1}:
                slope[:, place] -= jacobian[:, stiffness] * growth / (2 * (1 + growth))
        return slope

    def _growth(self, numbers: Array) -> float:
        """Return 2 s T at the pretension [-]."""
        _, stiffening, pretension = self._places
        tension = np.exp(numbers[pretension]) if pretension >= 0 else self._free.base.pretension
        return float(2 * np.exp(numbers[stiffening]) * tension)

    def _shifted(self, numbers: Array, sign: float) -> Array:
        stiffness, stiffening, _ = self._places
        shifted = np.array(numbers, dtype=float)
        if min(stiffness, stiffening) >= 0:
            shifted[stiffness] += sign * np.log1p(self._growth(numbers)) / 2
        return shifted


ALONG = ("joint_friction_taper", "section_stiffness", "joint_friction")
"""Parameters to walk along; the first that is fitted is taken."""
STRIDES = (0.1, 0.03)  # length of a step on the scale of the search, of each walk
FARTHEST = 10  # most steps to a side
TOO_HIGH = 1.5  # cost at which a walk ends, times its lowest so far


def parameter_along(free: FreeParameters) -> str | None:
    """Return the parameter to walk along; None if none of these is fitted, or no other one."""
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
    """Return cost and point of each step of a walk from a point (P,) to one side, (FARTHEST, 1 + P).

    The other parameters descend after each stride of the named one. A walk ends early where the cost rises to
    `TOO_HIGH`, or at a limit; then the last step stands for the rest.
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


SHORTEST, LONGEST = 1e-3, 0.3
"""Least and largest reach of a secant to either side, in the parameter that moves most."""


def secants(
    residuals: Callable[[Sequence[Array]], Array],
    numbers: Array,
    around: Array,
    variance: float,
    bounds: tuple[Array, Array],
) -> Array:
    """Return the derivative of the residuals (points, R) at a point (P,), by secants over its uncertainty.

    `around` is an estimate of the derivative (R, P), which gives the axes, `variance` that of a residual.
    """
    _, gains, axes = np.linalg.svd(np.nan_to_num(around), full_matrices=False)
    longest = np.abs(axes).max(axis=1)  # of the unit vectors: between 1 / sqrt(P) and 1
    reach = np.clip(np.sqrt(variance) / np.maximum(gains, 1e-300), SHORTEST / longest, LONGEST / longest)
    ways = axes * reach[:, None]
    above, below = np.clip(numbers + ways, *bounds), np.clip(numbers - ways, *bounds)
    off = residuals([*above, *below])
    change: Array = (off[: len(ways)] - off[len(ways) :]).T
    derivative: Array = change @ np.linalg.pinv((above - below).T)
    return derivative


def variance_of(residual: Array, parameters: int) -> float:
    """Return the variance of residuals (R,), as if they were independent of each other.

    Residuals of neighbouring samples are alike, so that there is less information than samples: it is
    inflated by (1 + r) / (1 - r), with r their correlation from one sample to the next (the effective number
    of samples of an AR(1) process, Bayley and Hammersley 1946).
    """
    freedom = max(len(residual) - parameters, 1)
    power = float(residual @ residual)
    r = float(np.clip(residual[1:] @ residual[:-1] / power, 0.0, 0.999)) if power > 0 else 0.0
    return power / freedom * (1 + r) / (1 - r)


STRIDE = 1e-3  # of differences, with which a descent begins
ROUGH, SMOOTH = (1e-5, 1e-4), (1e-5, 1e-5)
"""Relative change of the cost, and of the point, at which a descent ends: by differences, and by secants."""


def descend(
    free: FreeParameters,
    loops: Sequence[MeasuredLoop],
    start: Array,
    steps: int,
    weight: float,
    *,
    smooth: bool,
    threads: int,
    stopped: threading.Event,
) -> Array:
    """Return the cost that least squares (SciPy's `trf`) reaches from a point (P,), and where, (1 + P,).

    Derivatives are `secants` where it has to reach the minimum, else one-sided differences, at half the cost.
    """
    valley = Valley(free)
    margin = 1e-6
    last: Array | None = None

    def of_one(straight: Array) -> Array:
        if stopped.is_set():
            raise CancelledError
        residual: Array = penalised(free, [valley.within(straight)], loops, "reduced", weight, threads=1)[0]
        return residual

    def slope(straight: Array) -> Array:
        nonlocal last
        numbers = valley.within(straight)
        if smooth:
            last = smoothed_jacobian(free, loops, numbers, weight, last, threads=threads)
            return valley.slope(last, numbers)
        return valley.slope(differences(free, loops, numbers, weight, threads=threads), numbers)

    of_cost, of_point = SMOOTH if smooth else ROUGH
    result = least_squares(
        of_one,
        valley.straight(np.clip(start, free.lower + margin, free.upper - margin)),
        jac=slope,
        bounds=valley.bounds(),
        max_nfev=steps,
        x_scale="jac",
        ftol=of_cost,
        xtol=of_point,
    )
    return np.array([2 * result.cost, *valley.within(result.x)])


def smoothed_jacobian(
    free: FreeParameters,
    loops: Sequence[MeasuredLoop],
    numbers: Array,
    weight: float,
    around: Array | None = None,
    *,
    threads: int = 0,
) -> Array:
    """Return the derivative of the residuals (R, P) at a point (P,), smoothed over its uncertainty.

    Its scale is that of the derivative nearby, `around`; of `differences` if not given.
    """
    if around is None:
        around = differences(free, loops, numbers, weight, threads=threads)
    here = penalised(free, [numbers], loops, "reduced", weight, threads)[0]
    return secants(
        lambda points: penalised(free, points, loops, "reduced", weight, threads),
        numbers,
        around,
        variance_of(here, len(numbers)),
        (free.lower, free.upper),
    )


def differences(
    free: FreeParameters, loops: Sequence[MeasuredLoop], numbers: Array, weight: float, *, threads: int = 0
) -> Array:
    """Return the derivative of the residuals (R, P) at a point, by differences to one side."""
    steps = np.where(numbers + STRIDE <= free.upper, STRIDE, -STRIDE)
    off = penalised(free, [numbers, *(numbers + np.diag(steps))], loops, "reduced", weight, threads)
    derivative: Array = ((off[1:] - off[0]) / steps[:, None]).T
    return derivative
