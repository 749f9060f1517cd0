"""Load-dependent forces in batches: friction and damping of MuJoCo's models, from the tension of the wires.

MuJoCo knows one constant friction force per joint. Here it is rewritten, once per control period, from where
the wires are; so is the damping of the wires, which must vanish with their tension.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.friction import LEAST_FRICTION, friction_drift, friction_per_tension, hinge_friction
from twin.mechanics.hinges import hinge_groups, joint_friction
from twin.physics.layout import Layout, consecutive
from twin.physics.wires import Wires, of_each
from twin.preset.preset import Preset

Array = NDArray[np.float64]
NEARLY_TAUT = 1e-6
"""Slack up to which a wire counts as taut [m]."""
_ZERO, _NEARLY_SLACK = np.array(0.0), np.array(-NEARLY_TAUT)  # arrays: a Python number costs as much again


class Rewritten(NamedTuple):
    """Fields of MuJoCo's models that follow the load, of B endoscopes: views, to write through.

    Attributes:
        sheath: breakaway friction of the sheath elements, (B, wires, elements) [N].
        joints: breakaway friction of each hinge of a group, (B, planes, groups) [N m].
        damping: damping of the wire segments, (B, wires, elements + 1) [N s / m].
    """

    sheath: Array
    joints: Array
    damping: Array

    @classmethod
    def of(cls, layout: Layout, joint_loss: Array, tendon_loss: Array, tendon_damping: Array) -> "Rewritten":
        """Return the views of `dof_frictionloss` (B, nv), `tendon_frictionloss` and `tendon_damping`."""
        fields = ((joint_loss, layout.element), (tendon_loss, layout.joints), (tendon_damping, layout.wire))
        return cls(*(field[:, consecutive(index)].reshape(-1, *index.shape) for field, index in fields))


class Loads:
    """Load-dependent forces of B endoscopes of one layout, which may differ in their parameters."""

    def __init__(self, presets: Sequence[Preset], layout: Layout) -> None:
        """Gather the parameters of all endoscopes, along the leading axis of every array."""
        self.layout, self.wires = layout, Wires(presets, layout)
        elements, shape = presets[0].sheath_elements, layout.element.shape
        self._friction = np.array([p.sheath_friction for p in presets])
        floors = [max(p.sheath_friction_floor / elements, LEAST_FRICTION) for p in presets]
        self._floor = of_each(floors, shape)
        self._bend_offset = np.array([p.sheath_bend_offset for p in presets])
        self._warm_up = np.array([p.friction_warm_up for p in presets])
        self._warm_up_time = np.array([p.warm_up_time for p in presets])
        self._wear = np.array([p.friction_wear for p in presets])
        self.drifts = bool(self._warm_up.any() or self._wear.any())
        self._of_bend, self._half_share, self._floor_now = np.empty(0), self._floor, self._floor

        self._joint = np.array([joint_friction(p) for p in presets])[:, None, :]
        self._routing = np.array([[[p.routing_friction * p.wire_offset]] for p in presets])
        self._routed = bool(self._routing.any())
        # Per routing friction and tension it is linear in the turns: the mean over each group, as a matrix.
        vertebrae = presets[0].vertebrae
        of_hinges = hinge_friction(np.zeros(1), 1.0, np.ones(vertebrae), np.eye(vertebrae))
        groups = hinge_groups(vertebrae)
        self._wrapped = np.stack([of_hinges[:, group].mean(axis=1) for group in groups], axis=1)

        self._time_step, self._ahead = np.array(presets[0].time_step), np.array(2 * presets[0].control_period)
        self._wire_damping = of_each([p.wire_damping * (elements + 1) for p in presets], layout.wire.shape)
        self._stiffens = bool(self.wires.quadratic.any())
        self._damping = self._wire_damping + self._time_step * self.wires.stiffness
        self._stiffness_squared, self._growth = self.wires.stiffness**2, 4 * self.wires.quadratic

        # Places for what `follow` computes: some twenty operations on few numbers, where to allocate takes as
        # long as to compute.
        count, lengths, positions = self.wires.lengthening.shape
        self._ends = np.empty((count, 2, positions))
        self._reach = np.empty((count, 2, lengths))
        self._stretch, self._soon, self._tension, self._taut = np.empty((4, count, *layout.wire.shape))
        self._is_taut = np.empty(self._taut.shape, dtype=bool)

    def drift(self, time: Array, travel: Array) -> Array:
        """Return the factor of sheath friction due to warm-up and wear.

        Args:
            time: (B,) time since the start of the run [s].
            travel: (B,) distance that the pulleys have travelled [m].

        Returns:
            (B,) factor on the coefficient and on the floor.
        """
        return friction_drift(self._warm_up, self._warm_up_time, self._wear, time, travel)

    def follow(
        self, rewritten: Rewritten, qpos: Array, qvel: Array, sheath_bend: Array, drift: Array | None
    ) -> None:
        """Rewrite friction and damping to the load of the present state.

        Args:
            rewritten: of the models; hinges on which no wire rubs are left as they are.
            qpos: (B, nq) positions.
            qvel: (B, nv) velocities.
            sheath_bend: (B,) angle that the sheath is bent by [rad]; not to be changed in place.
            drift: (B,) of `drift`; None where nothing drifts.
        """
        self._follow_wires(qpos, qvel)
        self._follow_sheath(sheath_bend, drift)
        # `element_friction`, in place.
        np.add(self._tension[..., 1:], self._tension[..., :-1], out=rewritten.sheath)
        np.multiply(rewritten.sheath, self._half_share, out=rewritten.sheath)
        np.add(rewritten.sheath, self._floor_now, out=rewritten.sheath)
        if self._routed:
            rewritten.joints[:] = self._rubbing(qpos)
        self._write_damping(rewritten.damping)

    def _follow_wires(self, qpos: Array, qvel: Array) -> None:
        """Compute stretch and tension of now, and the stretch to come by the update after the next."""
        wires, ends, taut, tension = self.wires, self._ends, self._taut, self._tension
        ends[:, 0] = qpos
        np.multiply(qvel, self._ahead, out=ends[:, 1])
        ends[:, 1] += qpos
        np.matmul(ends, wires.lengthening.transpose(0, 2, 1), out=self._reach)
        reach = self._reach.reshape(len(ends), 2, *self.layout.wire.shape)
        np.add(reach[:, 0], wires.rest_stretch, out=self._stretch)
        np.add(reach[:, 1], wires.rest_stretch, out=self._soon)

        # `tension_at`, in place.
        np.maximum(self._stretch, _ZERO, out=taut)
        np.multiply(wires.quadratic, taut, out=tension)
        tension += wires.stiffness
        tension *= taut

    def _follow_sheath(self, sheath_bend: Array, drift: Array | None) -> None:
        """Compute half the friction of an element per unit of tension, and the part that is of no tension."""
        if drift is None and (sheath_bend is self._of_bend or np.array_equal(sheath_bend, self._of_bend)):
            return
        factor = np.ones(len(sheath_bend)) if drift is None else drift
        wrapped = self._friction * factor * (sheath_bend + self._bend_offset)
        elements = self._floor.shape[1:]
        self._half_share = of_each(friction_per_tension(wrapped, 1.0, elements[-1]) / 2, elements)
        self._floor_now = self._floor * factor[:, None, None]
        self._of_bend = sheath_bend

    def _rubbing(self, qpos: Array) -> Array:
        """Return the friction of the hinges of a group with that of the wires, (B, planes, groups) [N m]."""
        hinge = qpos[:, self.layout.hinge]
        turn = np.abs(hinge) if hinge.shape[1] == 1 else np.sqrt((hinge**2).sum(axis=1, keepdims=True))
        at_tip = self._tension[:, :, -1].reshape(len(qpos), -1, 2).sum(axis=2, keepdims=True)
        rubbing: Array = self._joint + self._routing * at_tip * np.matmul(turn, self._wrapped)
        return rubbing

    def _write_damping(self, damping: Array) -> None:
        """Write the damping of every wire segment, 0 where it is slack, (B, wires, elements + 1) [N s / m].

        Beside the wire's own it holds time step times stiffness: what makes MuJoCo's implicit step in the
        velocities an implicit (backward Euler) step of the springs, whose stiffness it would otherwise take
        explicitly. A length that will be taut before the next update has it already.
        """
        np.maximum(self._stretch, self._soon, out=self._soon)
        np.greater(self._soon, _NEARLY_SLACK, out=self._is_taut)
        if self._stiffens:
            np.multiply(self._growth, self._tension, out=self._damping)
            self._damping += self._stiffness_squared
            np.sqrt(self._damping, out=self._damping)
            self._damping *= self._time_step
            self._damping += self._wire_damping
        np.multiply(self._damping, self._is_taut, out=damping)
