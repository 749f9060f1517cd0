"""Dry friction that opposes the motion in both bending planes as one, by constraints that MuJoCo has.

`twin/reduced/shared_friction.py` states the law: neighbours slide in the direction tau / F, with tau the
forces that friction holds over the friction F of each. Here every pair has a constraint along tau and one
across it. With a friction of 1 each, in units of F, the pair slides along tau, and across it hardly at all.
The direction follows the force from one control period to the next: the law of the other twin by explicit
steps, which differs from it by the turn in one period.
"""

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.compiled import compiled
from twin.mechanics.friction import LEAST_FRICTION
from twin.mechanics.hinges import hinge_groups
from twin.physics.layout import Index, Layout

Array = NDArray[np.float64]

TOLD = 1e-3
"""Force over friction above which it tells a direction [-]."""


class SharedFriction:
    """Friction of the pairs of neighbours of B endoscopes of one layout with two planes.

    Attributes:
        direction: (B, pairs) of the force that friction holds, over the friction of each [rad]: 0 in the
            plane of wires a and b.
    """

    def __init__(self, count: int, vertebrae: int, layout: Layout) -> None:
        """Begin with all directions in the first plane."""
        self.direction = np.zeros((count, layout.shared.shape[1]))
        groups = hinge_groups(vertebrae)
        a, b, c, d = layout.element
        neighbours = [np.stack([a, c]), np.stack([b, d])]
        self._dof = np.concatenate([*neighbours, layout.hinge[:, [group[0] for group in groups]]], axis=1)
        self._members = np.array([1] * (a.size + b.size) + [len(group) for group in groups])
        self._first_wrap = np.concatenate([[0], np.cumsum(2 * self._members)])

    def reset(self) -> None:
        """Begin anew."""
        self.direction[:] = 0.0

    def write(self, sheath: Array, joints: Array, loss: Array, coefficient: Array) -> None:
        """Write the friction of all pairs into MuJoCo's models.

        Args:
            sheath: (B, 4, elements) friction of the elements [N].
            joints: (B, 2, groups) friction of the hinges [N m].
            loss: (B, 2, pairs), where the friction of the tendons goes, along and across.
            coefficient: (B, 2, wraps), where their coefficients go.
        """
        friction = self._of_pairs(sheath, joints)
        write_pairs(friction, self.direction, self._members, self._first_wrap, loss, coefficient)

    def note(self, constraint: Array, sheath: Array, joints: Array, moving: Index) -> None:
        """Turn the directions to those of the forces that friction holds.

        Args:
            constraint: (B, nv) forces of MuJoCo's constraints, of which there are no others.
            sheath: as of `write`.
            joints: as of `write`.
            moving: indices of the endoscopes that were stepped.
        """
        tau = constraint[moving][:, self._dof] / self._of_pairs(sheath[moving], joints[moving])
        told = np.hypot(tau[:, 0], tau[:, 1]) > TOLD
        turned = np.arctan2(tau[:, 1], tau[:, 0])
        self.direction[moving] = np.where(told, turned, self.direction[moving])

    def _of_pairs(self, sheath: Array, joints: Array) -> Array:
        """Return the friction of both members of each pair, (B, 2, pairs)."""
        a, b, c, d = (sheath[:, wire] for wire in range(4))
        first = np.concatenate([a, b, joints[:, 0]], axis=1)
        second = np.concatenate([c, d, joints[:, 1]], axis=1)
        friction: Array = np.maximum(np.stack([first, second], axis=1), LEAST_FRICTION)
        return friction


@compiled
def write_pairs(
    friction: Array, direction: Array, members: Index, first_wrap: Index, loss: Array, coefficient: Array
) -> None:
    """Write friction and coefficients of the tendons along and across a direction.

    Args:
        friction: (B, 2, pairs) of both neighbours.
        direction: (B, pairs) [rad].
        members: (pairs,) joints that each neighbour has.
        first_wrap: (pairs + 1,) place of the first coefficient of each pair.
        loss: (B, 2, pairs), written.
        coefficient: (B, 2, wraps), written: of the members of the first neighbour, then of the second.
    """
    for b in range(len(friction)):
        for k in range(friction.shape[2]):
            first, second = friction[b, 0, k], friction[b, 1, k]
            largest = max(first, second)
            cos, sin = np.cos(direction[b, k]), np.sin(direction[b, k])
            loss[b, 0, k] = loss[b, 1, k] = largest
            start, middle, end = first_wrap[k], first_wrap[k] + members[k], first_wrap[k + 1]
            coefficient[b, 0, start:middle] = cos * first / largest
            coefficient[b, 0, middle:end] = sin * second / largest
            coefficient[b, 1, start:middle] = -sin * first / largest
            coefficient[b, 1, middle:end] = cos * second / largest
