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

        # Damping where taut: the wire's own, and time step times the stiffness k + 2 k2 x of a stretch x.
        wires, time_step = self.wires, presets[0].time_step
        own = of_each([p.wire_damping * (elements + 1) for p in presets], layout.wire.shape)
        self._damping_unstretched = own + time_step * wires.stiffness
        self._damping_per_stretch = 2 * time_step * wires.quadratic

        # Stretch now, and two control periods on at the present rate, are linear in (qpos, qvel, 1).
        count, lengths, positions = wires.lengthening.shape
        rest = wires.rest_stretch.reshape(count, lengths, 1)
        ahead = 2 * presets[0].control_period * wires.lengthening
        now = np.concatenate([wires.lengthening, np.zeros_like(ahead), rest], axis=2)
        soon = np.concatenate([wires.lengthening, ahead, rest], axis=2)
        self._both_stretches = np.concatenate([now, soon], axis=1)

        # Places for what `follow` computes: to allocate them, or to take views, takes as long as to compute.
        self._motion, self._ends = np.ones((count, 2 * positions + 1, 1)), np.empty((count, 2 * lengths, 1))
        self._qpos, self._qvel = self._motion[:, :positions, 0], self._motion[:, positions:-1, 0]
        self._stretch = self._ends[:, :lengths].reshape(count, *layout.wire.shape)
        self._soon = self._ends[:, lengths:].reshape(count, *layout.wire.shape)
        self._taut, self._tension = np.empty((2, count, *layout.wire.shape))
        self._is_taut = np.empty(self._taut.shape, dtype=bool)
        self._before, self._behind = self._tension[..., :-1], self._tension[..., 1:]

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
        self._follow_sheath(sheath_bend, drift)
        np.copyto(self._qpos, qpos)
        np.copyto(self._qvel, qvel)
        np.matmul(self._both_stretches, self._motion, out=self._ends)

        # `tension_at` and `element_friction`, in place.
        taut, tension, (sheath, joints, damping) = self._taut, self._tension, rewritten
        np.maximum(self._stretch, _ZERO, out=taut)
        np.multiply(taut, self.wires.quadratic, out=tension)
        np.add(tension, self.wires.stiffness, out=tension)
        np.multiply(tension, taut, out=tension)
        np.add(self._behind, self._before, out=sheath)
        np.multiply(sheath, self._half_share, out=sheath)
        np.add(sheath, self._floor_now, out=sheath)
        if self._routed:
            joints[:] = self._rubbing(qpos)

        # Time step times stiffness makes MuJoCo's implicit step in the velocities a backward Euler step of
        # the springs, which it would otherwise take explicitly. A segment that will be taut before the next
        # update has it already.
        np.maximum(self._stretch, self._soon, out=self._soon)
        np.greater(self._soon, _NEARLY_SLACK, out=self._is_taut)
        np.multiply(taut, self._damping_per_stretch, out=damping)
        np.add(damping, self._damping_unstretched, out=damping)
        np.multiply(damping, self._is_taut, out=damping)

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
