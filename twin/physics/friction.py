"""Capstan friction of a wire in a bent sheath, spread over a few elements (Euler 1769, Eytelwein 1808)."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def element_friction(tension: Array, friction: float, bend: float, floor: float) -> Array:
    """Return the largest friction force of each element of the sheath.

    A wire that slides over an angle dphi loses tension by T_out = T_in exp(-mu dphi). With the mean
    tension of both sides, that is a force

        F = T_in - T_out = 2 tanh(mu dphi / 2) (T_in + T_out) / 2

    which is exact for any number of elements and for both directions of sliding.

    Args:
        tension: (..., elements + 1) tension in each length of wire [N].
        friction: coefficient mu of the whole sheath.
        bend: angle phi that the whole sheath is bent by [rad].
        floor: friction of the whole sheath that does not depend on the tension [N].

    Returns:
        (..., elements) force at which each element begins to slide [N].
    """
    elements = tension.shape[-1] - 1
    per_tension = 2 * np.tanh(friction * bend / elements / 2)
    return per_tension * (tension[..., 1:] + tension[..., :-1]) / 2 + floor / elements
