"""Hops from one valley of a search into the next, where the logs hardly tell the two apart.

Friction that begins group by group makes many valleys beside each other along what the logs tell least, with
low ridges between them. Points are drawn about a fit by its own uncertainty, a few to a hundred times as
wide; the best of each width is where another descent begins (basin hopping, Wales and Doye 1997).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WIDTHS = (3.0, 10.0, 30.0, 100.0)
"""Widths of the draws [standard deviations of the fit]."""
EACH = 24
"""Points of each width."""
FARTHEST = 0.8
"""Farthest that a point lies away in any parameter, on the scale of the search."""


def points_about(
    numbers: Array, slope: Array, variance: float, bounds: tuple[Array, Array], rng: np.random.Generator
) -> Array:
    """Return points about a fit, `EACH` of every width, (widths, EACH, P).

    Args:
        numbers: the fit, in the search space, (P,).
        slope: derivative of its residuals (R, P).
        variance: of a residual.
        bounds: lowest and highest point, (P,) each.
        rng: what they are drawn from.
    """
    _, told, axes = np.linalg.svd(np.nan_to_num(slope), full_matrices=False)
    deviation = np.sqrt(variance) / np.maximum(told, 1e-300)
    drawn = rng.standard_normal((len(WIDTHS), EACH, len(told)))
    reach = np.minimum(np.array(WIDTHS)[:, None, None] * deviation, FARTHEST)
    ways = (drawn * reach) @ axes
    longest = np.abs(ways).max(axis=2, keepdims=True)
    ways *= np.minimum(1.0, FARTHEST / np.maximum(longest, 1e-300))
    points: Array = np.clip(numbers + ways, *bounds)
    return points
