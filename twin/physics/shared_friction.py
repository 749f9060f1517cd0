"""Dry friction that opposes the motion in both bending planes as one, by constraints that MuJoCo has.

`twin/reduced/two_planes.py` states the law: neighbours slide in the direction tau / F, with tau the
forces that friction holds over the friction F of each. Here every pair has a constraint along tau and one
across it. With a friction of 1 each, in units of F, the pair slides along tau, and across it hardly at all.
The direction follows the force from one control period to the next. What slides gives way as the direction
turns, so that the force across it, which determines the turn, falls: the step is implicit.

Stick and slip: elements of the sheath at rest are held by more than they slide against (`stiction`). One that
has broken away slides until it has caught up with what pulls it; then it is held again, and the tip moves in
steps. Friction falls within some control periods: MuJoCo takes two time steps to brake what slides, so that
an element let go at once would slide several times too far.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import CAUGHT_UP, LEAST_FRICTION, hinge_groups
from twin.mechanics.kernels import entry
from twin.physics.layout import Index, Layout
from twin.preset.preset import Preset

Array = NDArray[np.float64]

LEAST_FORCE = 1e-3  # force over friction above which it determines a direction [-]
BREAKS_AWAY = 0.99  # force beyond sliding friction that breaks away, as a share of what stiction adds [-]
FALL = 0.8  # factor within a control period on what stiction adds to the friction of what slides [-]


class SharedFriction:
    """Friction of the pairs of neighbours of B endoscopes of one layout with two planes.

    Its `direction` (B, pairs) is that of the force that friction holds, over the friction of each [rad]: 0 in
    the plane of wires a and b.
    """

    def __init__(self, presets: Sequence[Preset], layout: Layout, time_step: Array, part: Array) -> None:
        """Begin with all directions in the first plane; `time_step` and `part` are those of `LoadLaw`."""
        self.direction = np.zeros((len(presets), layout.shared.shape[1]))
        self._time_step, self._part = time_step, part
        groups = hinge_groups(presets[0].vertebrae)
        self._arm = np.array([p.wire_offset for p in presets])[:, None, None]
        self._hinge = np.array([p.section_stiffness * p.vertebrae for p in presets])[:, None, None]
        self._size = np.array([len(group) for group in groups])
        a, b, c, d = layout.element
        neighbours = [np.stack([a, c]), np.stack([b, d])]
        self._dof = np.concatenate([*neighbours, layout.hinge[:, [group[0] for group in groups]]], axis=1)
        self._members = np.array([1] * (a.size + b.size) + [len(group) for group in groups])
        self._first_wrap = np.concatenate([[0], np.cumsum(2 * self._members)])

    def write(self, sheath: Array, joints: Array, loss: Array, coefficient: Array) -> None:
        """Write the friction of elements (B, 4, elements) [N] and of hinges (B, 2, groups) [N m]."""
        friction = self._of_pairs(sheath, joints)
        write_pairs(friction, self.direction, self._members, self._first_wrap, loss, coefficient)

    def observe_constraints(
        self, constraint: Array, qvel: Array, sheath: Array, joints: Array, damping: Array, moving: Index
    ) -> None:
        """Turn the directions towards those of the forces (B, nv) that friction holds, the only constraints.

        Neighbours slide by x_p = lambda e_p / F_p in a period, with e along the direction, against springs
        k_p. Turned by alpha, they lose alpha c = alpha lambda sum k_p a_p^2 / F_p^2 of the force across, with
        a across it. So the turn by the force across is divided by 1 + c. `damping` (B, 4, elements + 1) of
        the wire segments holds their stiffness [N s / m]; the endoscopes `moving` were stepped.
        """
        friction = self._of_pairs(sheath[moving], joints[moving])
        tau = constraint[moving][:, self._dof] / friction
        before = self.direction[moving]
        along = np.stack([np.cos(before), np.sin(before)], axis=1)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        slid = self._part[moving, None] * np.abs((qvel[moving][:, self._dof] * friction * along).sum(axis=1))
        lost = slid * (self._stiffness(damping, moving) * (across / friction) ** 2).sum(axis=1)
        held, ahead = (tau * across).sum(axis=1), (tau * along).sum(axis=1)
        # Back along the same line is no turn.
        turn = np.arctan2(np.copysign(held, held * ahead), np.abs(ahead)) / (1 + lost)
        loaded = np.hypot(tau[:, 0], tau[:, 1]) > LEAST_FORCE
        self.direction[moving] = np.where(loaded, before + turn, before)

    def _stiffness(self, damping: Array, moving: Index) -> Array:
        """Return the stiffness that holds each member of a pair, (b, 2, pairs) [N / m] and [N m / rad]."""
        segment = damping[moving] / self._time_step[moving, None, None]
        of_tips = segment[:, :, -1].reshape(len(moving), 2, 2).sum(axis=2)[:, :, None]
        of_hinges = self._hinge[moving] + self._arm[moving] ** 2 * self._size * of_tips
        return self._of_pairs(segment[:, :, :-1] + segment[:, :, 1:], of_hinges)

    def _of_pairs(self, sheath: Array, joints: Array) -> Array:
        """Return friction or stiffness of both members of each pair, (B, 2, pairs)."""
        a, b, c, d = (sheath[:, wire] for wire in range(4))
        first = np.concatenate([a, b, joints[:, 0]], axis=1)
        second = np.concatenate([c, d, joints[:, 1]], axis=1)
        friction: Array = np.maximum(np.stack([first, second], axis=1), LEAST_FRICTION)
        return friction


@entry
def write_pairs(
    friction: Array, direction: Array, members: Index, first_wrap: Index, loss: Array, coefficient: Array
) -> None:
    """Write friction and coefficients of the tendons along and across directions (B, pairs) [rad].

    Friction is (B, 2, pairs) of both neighbours, `members` (pairs,) the joints of each neighbour,
    `first_wrap` (pairs + 1,) the place of the first coefficient of each pair. Written are `loss` (B, 2,
    pairs) and `coefficient` (B, 2, wraps): of the members of the first neighbour, then of the second.
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


class Sticking:
    """Elements at rest, of B endoscopes of one layout. With two planes, neighbours stick and slip as one.

    Their `grip` (B, sides, elements) is the share of what stiction adds that holds each, 1 at rest [-]; sides
    are wires a and b, or with two planes a with c and b with d.
    """

    def __init__(self, presets: Sequence[Preset], layout: Layout, part: Array) -> None:
        """Begin with all at rest; `part` is that of `LoadLaw`."""
        self._wires: Index = np.arange(len(layout.element)).reshape(len(layout.hinge), -1)
        self._stiction = np.array([preset.stiction for preset in presets])[:, None, None]
        self.grip = np.ones((len(presets), self._wires.shape[1], layout.element.shape[1]))
        self._part, self._period = part, presets[0].control_period

    def hold(self, sheath: Array, tension: Array, moving: Index) -> None:
        """Let go what breaks away, hold what has caught up, and raise the friction of both, in place.

        From the friction of sliding (B, wires, elements) and the tension of the segments (B, wires, elements
        + 1), without damping [N].
        """
        stiction, grip = self._stiction[moving], self.grip[moving]
        pulled = (np.diff(tension, axis=2) / sheath)[moving][:, self._wires]
        beyond = np.sqrt((pulled**2).sum(axis=1)) - 1.0
        fall = FALL ** (self._part[moving] / self._period)
        slides = (beyond >= BREAKS_AWAY * stiction) | (grip < 1.0)
        grip = np.where(slides, grip * fall[:, None, None], grip)
        grip[beyond <= CAUGHT_UP * stiction] = 1.0
        self.grip[moving] = grip
        for wires in self._wires:
            sheath[np.ix_(moving, wires)] *= 1 + stiction * grip
