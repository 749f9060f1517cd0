"""Ellipsoids of two coordinates that hold a set for certain, each the smallest of its family (Schweppe 1968).

An ellipsoid is {x: (x - c)^T P^-1 (x - c) <= 1}, with centres c (2, B) and shapes P (2, 2, B): the state
before the batch, as in `gaussian.py`. Areas are minimised, so that units of the coordinates do not matter.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
ROUNDING = 1e-9  # every shape is widened by this share: rounding can then neither lose a point nor flatten it


class Ellipsoid(NamedTuple):
    """B ellipsoids.

    Attributes:
        centre: (2, B).
        shape: (2, 2, B).
    """

    centre: Array
    shape: Array

    def half_width(self, axis: int) -> Array:
        """Return how far (B,) they reach from their centres along a coordinate."""
        reach: Array = np.sqrt(self.shape[axis, axis])
        return reach


def around_box(low: Array, high: Array) -> Ellipsoid:
    """Return the smallest ellipsoid around boxes from low to high, both (2, B), none of them flat."""
    half = (high - low) / 2
    shape = np.zeros((2, 2, half.shape[1]))
    shape[0, 0], shape[1, 1] = 2 * half**2
    return _widened((low + high) / 2, shape)


def add_segment(ellipsoid: Ellipsoid, axis: int, half_length: ArrayLike) -> Ellipsoid:
    """Return the smallest ellipsoid around all sums with a point of a segment along one coordinate.

    The family is (1 + 1/p) P + (1 + p) b^2 e e^T, p > 0 (Schweppe 1968). With h = b^2 e^T P^-1 e its area is
    least where h p^2 - h p - 2 = 0.

    Args:
        ellipsoid: what is grown.
        axis: along which coordinate.
        half_length: b, scalar or (B,), not negative.
    """
    P = ellipsoid.shape
    square = np.square(np.asarray(half_length, dtype=float))
    determinant = P[0, 0] * P[1, 1] - P[0, 1] * P[1, 0]
    determinant = np.maximum(determinant, 1e-12 * P[0, 0] * P[1, 1])  # flat to rounding; any p is safe
    h = np.maximum(square * P[1 - axis, 1 - axis] / determinant, 1e-200)
    p = (1 + np.sqrt(1 + 8 / h)) / 2
    shape = P * (1 + 1 / p)
    shape[axis, axis] += (1 + p) * square
    return _widened(ellipsoid.centre, shape)


def cut(ellipsoid: Ellipsoid, axis: int, low: Array, high: Array) -> tuple[Ellipsoid, NDArray[np.bool_]]:
    """Return the smallest ellipsoid around what lies between two bounds on one coordinate.

    Fogel and Huang (1982). Seen as the unit disc, with t along the normal of a strip of middle m and half
    width d, the family is |z|^2 + q (t - m)^2 <= 1 + q d^2. The strip is first cut down to where it meets the
    disc (Belforte and Bona 1985). With s = 1 + q the area is least where
    d^2 s^2 - (1 - d^2 - m^2) s - 3 m^2 = 0. Where that is below s = 1, as for a strip around the ellipsoid,
    nothing is gained and it stays.

    Args:
        ellipsoid: what is cut.
        axis: the coordinate.
        low: (B,) its lower bound.
        high: (B,) its upper bound.

    Returns:
        The ellipsoid, and (B,) whether nothing is left; there it is as it was.
    """
    centre, P = ellipsoid
    half = ellipsoid.half_width(axis)
    t_low = np.maximum((low - centre[axis]) / half, -1)
    t_high = np.minimum((high - centre[axis]) / half, 1)
    empty = t_low > t_high
    m = (t_low + t_high) / 2
    d = np.maximum((t_high - t_low) / 2, 1e-7)  # a wider strip is safe, a flat one has no ellipsoid
    k = 1 - d**2 - m**2
    s = (k + np.sqrt(k**2 + 12 * d**2 * m**2)) / (2 * d**2)
    s = np.where(empty, 1, np.maximum(s, 1))
    shift = np.where(empty, 0, m * (1 - 1 / s))
    scale = np.where(empty, 1, 1 + (s - 1) * d**2 - m * shift)
    normal = P[axis] / half
    shape = scale * (P - (1 - 1 / s) * normal[:, None] * normal[None])
    return _widened(centre + shift * normal, shape), empty


def _widened(centre: Array, shape: Array) -> Ellipsoid:
    for axis in (0, 1):
        shape[axis, axis] *= 1 + ROUNDING
    return Ellipsoid(centre, shape)
