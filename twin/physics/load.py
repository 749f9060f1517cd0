"""Load-dependent forces in batches: tension from positions, friction and damping from tension.

MuJoCo knows one constant friction force per joint. Here it is rewritten, once per control period, from where
the wires are; so is the damping of the wires, which must vanish with their tension.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import (
    LEAST_FRICTION,
    element_friction,
    friction_drift,
    friction_per_tension,
    hinge_friction,
)
from twin.mechanics.hinges import hinge_groups, joint_friction
from twin.mechanics.wire import quadratic_stiffness, segment_stiffness, stretch_at, tension_at, wound_tension
from twin.physics.layout import Layout
from twin.preset.preset import Preset

Array = NDArray[np.float64]
NEARLY_TAUT = 1e-6
"""Slack up to which a wire counts as taut [m]."""


class Loads:
    """Load-dependent forces of B endoscopes of one layout, which may differ in their parameters."""

    def __init__(self, presets: Sequence[Preset], layout: Layout) -> None:
        """Gather the parameters of all endoscopes, along the leading axis of every array."""
        self.layout = layout
        self.elements = presets[0].sheath_elements
        self._stiffness = _column([segment_stiffness(p) for p in presets])
        self._quadratic = _column([quadratic_stiffness(p) for p in presets])
        self._stiffens = bool(self._quadratic.any())
        wound = np.array([wound_tension(p) for p in presets])[:, None, :]
        self._rest_stretch = stretch_at(wound, self._stiffness, self._quadratic)
        self._lengthening = np.array([_lengthening(p, layout) for p in presets])
        self._shape = (len(presets), layout.wires, self.elements + 1)
        self._friction = _column([p.sheath_friction for p in presets])
        self._wrapped, self._share = np.empty(0), np.empty(0)
        self._bend_offset = np.array([p.sheath_bend_offset for p in presets])
        self._floor = _column([max(p.sheath_friction_floor / self.elements, LEAST_FRICTION) for p in presets])
        self._warm_up = np.array([p.friction_warm_up for p in presets])
        self._warm_up_time = np.array([p.warm_up_time for p in presets])
        self._wear = np.array([p.friction_wear for p in presets])
        self._joint = np.array([joint_friction(p) for p in presets])[:, None, :]
        self._routing = _column([p.routing_friction * p.wire_offset for p in presets])[:, :, 0]
        self.routed = bool(self._routing.any())
        groups = hinge_groups(presets[0].vertebrae)
        self._first, self._sizes = [group[0] for group in groups], np.array([len(group) for group in groups])
        self._wire_damping = _column([p.wire_damping * (p.sheath_elements + 1) for p in presets])
        self._time_step = presets[0].time_step
        self._ahead = 2 * presets[0].control_period

    def stretch(self, qpos: Array) -> Array:
        """Return the stretch of each wire segment, (B, wires, elements + 1) [m]; below 0 where slack.

        Args:
            qpos: (B, nq) positions.
        """
        stretch: Array = self._rest_stretch + np.matmul(self._lengthening, qpos[:, :, None]).reshape(
            self._shape
        )
        return stretch

    def tension(self, stretch: Array) -> Array:
        """Return the tension of each wire segment, (B, wires, elements + 1) [N]; 0 where slack."""
        return tension_at(stretch, self._stiffness, self._quadratic)

    def slack(self, stretch: Array) -> Array:
        """Return the slack of each wire segment, (B, wires, elements + 1) [m]; 0 where taut."""
        return np.maximum(-stretch, 0.0)

    def tension_and_slack(self, qpos: Array) -> tuple[Array, Array]:
        """Return `tension` and `slack` at (B, nq) positions."""
        stretch = self.stretch(qpos)
        return self.tension(stretch), self.slack(stretch)

    def drift(self, time: Array, travel: Array) -> Array:
        """Return the factor of sheath friction due to warm-up and wear.

        Args:
            time: (B,) time since the start of the run [s].
            travel: (B,) distance that the pulleys have travelled [m].

        Returns:
            (B,) factor on the coefficient and on the floor.
        """
        return friction_drift(self._warm_up, self._warm_up_time, self._wear, time, travel)

    def friction(
        self, tension: Array, qpos: Array, sheath_bend: Array, drift: Array | float
    ) -> tuple[Array, Array]:
        """Return the breakaway friction of every sheath element and hinge.

        Args:
            tension: (B, wires, elements + 1), of `tension`.
            qpos: (B, nq) positions.
            sheath_bend: (B,) angle that the sheath is bent by [rad].
            drift: (B,) of `drift`, or 1.

        Returns:
            (B, wires, elements) forces of the sheath [N]; torques of each hinge of a group [N m], to be
            broadcast to (B, planes, groups).
        """
        factor = np.asarray(drift).reshape(-1, 1, 1)
        wrapped = self._friction * factor * (sheath_bend + self._bend_offset)[:, None, None]
        if not np.array_equal(wrapped, self._wrapped):  # it hardly ever changes
            self._wrapped, self._share = wrapped, friction_per_tension(wrapped, 1.0, self.elements)
        sheath = element_friction(tension, self._share, self._floor * factor)
        if not self.routed:
            return sheath, self._joint
        turn = np.sqrt((qpos[:, self.layout.hinge] ** 2).sum(axis=1, keepdims=True))
        at_tip = tension[:, :, -1].reshape(len(qpos), -1, 2).sum(axis=2)
        of_hinges = hinge_friction(np.zeros(1), self._routing, at_tip, turn)
        return sheath, self._joint + np.add.reduceat(of_hinges, self._first, axis=2) / self._sizes

    def damping(self, stretch: Array, tension: Array, qvel: Array) -> Array:
        """Return the damping of every wire segment, 0 where it is slack.

        Beside the wire's own it holds time step times stiffness: what makes MuJoCo's implicit step in the
        velocities an implicit (backward Euler) step of the springs, whose stiffness it would otherwise take
        explicitly. A length that will be taut before the next update has it already.

        Args:
            stretch: (B, wires, elements + 1), of `stretch`.
            tension: (B, wires, elements + 1), of `tension`.
            qvel: (B, nv) velocities.

        Returns:
            (B, wires, elements + 1) [N s / m].
        """
        stiffness = self._stiffness
        if self._stiffens:
            stiffness = np.sqrt(stiffness**2 + 4 * self._quadratic * tension)
        soon = stretch + self._ahead * np.matmul(self._lengthening, qvel[:, :, None]).reshape(self._shape)
        taut = np.maximum(stretch, soon) > -NEARLY_TAUT
        damping: Array = taut * (self._wire_damping + self._time_step * stiffness)
        return damping


def _column(values: Sequence[float]) -> Array:
    """Return one number per endoscope as (B, 1, 1), ready to broadcast."""
    return np.array(values, dtype=float)[:, None, None]


def _lengthening(preset: Preset, layout: Layout) -> Array:
    """Return the Jacobian of the wire segments' lengths, (wires * (elements + 1), nq)."""
    lengths = preset.sheath_elements + 1
    matrix = np.zeros((layout.wires, lengths, layout.element.size + layout.pulley.size + layout.hinge.size))
    for wire in range(layout.wires):
        side, plane = 1.0 - 2.0 * (wire % 2), wire // 2
        for element, joint in enumerate(layout.element[wire]):
            matrix[wire, element, joint] = -1.0
            matrix[wire, element + 1, joint] = 1.0
        matrix[wire, 0, layout.pulley[plane]] = side
        matrix[wire, -1, layout.hinge[plane]] = -side * preset.wire_offset
    return matrix.reshape(layout.wires * lengths, -1)
