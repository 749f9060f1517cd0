"""Coordinates of a search in which the valley of a stiffening wire is straight.

Logs tell the stiffness of a wire at the tension that it works at, k sqrt(1 + 2 s T), far better than its
parts k and s: along the curve on which that stays, the cost hardly changes, and least squares creep. Here
log k is replaced by the logarithm of the stiffness at the pretension, and the valley runs along s alone.
"""

import numpy as np
from numpy.typing import NDArray

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
        """Return the point of the search space; one beyond its limits, as a stiffness may be, is at them."""
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
