"""Dry friction of two neighbours in different bending planes, which opposes their motion as one.

Coulomb friction is one force against the direction of a motion, not one against each of its components: with
each plane by itself, the tip would follow a circle of commands along a rounded square. With t the forces that
friction holds and F the friction of each neighbour, p = 1, 2,

    D = |F dx|,  F dx = (F_1 dx_1, F_2 dx_2)      so that      |tau| <= 1,  dx = 0  or  tau = F dx / |F dx|,

tau = (t_1 / F_1, t_2 / F_2): dissipation D is least together with the elastic energy (`plane.py`). It is a
projection, which is what Newton's method needs (Alart and Curnier 1991): for any rho, tau = v / max(1, |v|)
with v = tau + rho F dx.
"""

import math
from typing import NamedTuple

import numpy as np

from twin.mechanics.compiled import compiled
from twin.reduced.chain import Array


class Neighbours(NamedTuple):
    """Two neighbours that rub as one, one of each plane; arrays are rewritten.

    Attributes:
        force: (2,) net force on each, that friction holds [N or N m].
        friction: (2,) of each [N or N m].
        slipped: (2,) way of each in the increment [m or rad].
        stiffness: (2,) that each feels [N / m or N m / rad].
        missing: (2,) force that is missing; of those that are held, the way that they have to go back.
        of_force: (2, 2) derivative of `missing` with respect to the forces.
        of_friction: (2, 2) the same with respect to the friction.
        of_slip: (2, 2) the same with respect to the slip.
    """

    force: Array
    friction: Array
    slipped: Array
    stiffness: Array
    missing: Array
    of_force: Array
    of_friction: Array
    of_slip: Array


def new_neighbours() -> Neighbours:
    """Return the arrays of two neighbours."""
    return Neighbours(
        np.zeros(2),
        np.zeros(2),
        np.zeros(2),
        np.zeros(2),
        np.zeros(2),
        np.zeros((2, 2)),
        np.zeros((2, 2)),
        np.zeros((2, 2)),
    )


@compiled
def rub(pair: Neighbours, limit: float) -> bool:
    """Fill in what is missing and how that changes, from forces, friction, slip and stiffness.

    Args:
        pair: of neighbours.
        limit: factor on the friction that is overcome before they slide [-].

    Returns:
        Whether they slide.
    """
    t, F, dx = pair.force, pair.friction, pair.slipped
    rho = (pair.stiffness[0] + pair.stiffness[1]) / (F[0] ** 2 + F[1] ** 2)
    v = (t[0] / F[0] + rho * F[0] * dx[0], t[1] / F[1] + rho * F[1] * dx[1])
    size = math.hypot(v[0], v[1])
    slide = size > limit
    for p in range(2):
        pair.missing[p] = t[p] - F[p] * v[p] / size if slide else -dx[p]
        for q in range(2):
            same = 1.0 if p == q else 0.0
            if not slide:
                pair.of_force[p, q], pair.of_friction[p, q], pair.of_slip[p, q] = 0.0, 0.0, -same
                continue
            # of F_p v_p / |v| with respect to v_q
            turned = F[p] * (same - v[p] * v[q] / size**2) / size
            pair.of_force[p, q] = same - turned / F[q]
            pair.of_friction[p, q] = -same * v[p] / size - turned * (rho * dx[q] - t[q] / F[q] ** 2)
            pair.of_slip[p, q] = -turned * rho * F[q]
    return slide
