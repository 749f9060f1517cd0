"""Load-dependent forces in batches: friction and damping of MuJoCo's models, from the tension of the wires.

MuJoCo knows one constant friction force per joint. Here it is rewritten, once per control period, from where
the wires are; so are damping and inertia of the wires, which must vanish with their tension.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.mechanics.compiled import bound
from twin.mechanics.friction import (
    LEAST_FRICTION,
    friction_drift,
    friction_floor,
    friction_per_tension,
    hinge_friction,
)
from twin.mechanics.hinges import hinge_groups, joint_friction
from twin.mechanics.wire import quadratic_stiffness, segment_stiffness
from twin.physics.follow import LoadLaw, Rewritten, follow_load
from twin.physics.layout import Index, Layout, consecutive
from twin.physics.shared import SharedFriction
from twin.physics.sticking import Sticking
from twin.physics.wires import Wires
from twin.preset.preset import Preset

Array = NDArray[np.float64]
REWRITTEN = ("dof_frictionloss", "tendon_frictionloss", "tendon_damping", "tendon_armature", "wrap_prm")
"""Fields of MuJoCo's models that follow the load."""


def views(layout: Layout, fields: Sequence[Array]) -> Rewritten:
    """Return the views of the fields `REWRITTEN`, each with the endoscopes along its first axis."""
    joint_loss, tendon_loss, tendon_damping, tendon_inertia, wraps = fields

    def view(field: Array, index: Index) -> Array:
        return field[:, consecutive(index)].reshape(len(field), *index.shape)

    count, planes = len(joint_loss), len(layout.hinge)
    if planes == 1:
        sheath, joints = view(joint_loss, layout.element), view(tendon_loss, layout.joints)
    else:
        sheath = np.zeros((count, *layout.element.shape))
        joints = np.zeros((count, planes, layout.shared.shape[1] - 2 * layout.element.shape[1]))
    damping, inertia = view(tendon_damping, layout.wire), view(tendon_inertia, layout.wire)
    loss, coefficient = view(tendon_loss, layout.shared), view(wraps, layout.wrap)
    return Rewritten(sheath, joints, damping, inertia, loss, coefficient)


class Loads:
    """Load-dependent forces of B endoscopes of one layout, which may differ in their parameters."""

    def __init__(
        self, presets: Sequence[Preset], layout: Layout, rewritten: Rewritten, qpos: Array, qvel: Array
    ) -> None:
        """Gather the parameters of all endoscopes, along the leading axis of every array.

        Args:
            presets: B endoscopes.
            layout: of their models.
            rewritten: where the forces go.
            qpos: (B, nq) positions; MuJoCo's own arrays, as the next.
            qvel: (B, nv) velocities.
        """
        self.rewritten, self._qpos, self._qvel = rewritten, qpos, qvel
        self.layout, self.wires = layout, Wires(presets, layout)
        elements = presets[0].sheath_elements
        self._friction = np.array([p.sheath_friction for p in presets])
        self._floor = np.array([max(p.sheath_friction_floor / elements, LEAST_FRICTION) for p in presets])
        self._growth = np.array([p.sheath_friction_growth / elements for p in presets])
        self._exponent = np.array([p.sheath_friction_exponent for p in presets])
        self._bend_offset = np.array([p.sheath_bend_offset for p in presets])
        self._warm_up = np.array([p.friction_warm_up for p in presets])
        self._warm_up_time = np.array([p.warm_up_time for p in presets])
        self._wear = np.array([p.friction_wear for p in presets])
        self.drifts = bool(self._warm_up.any() or self._wear.any())
        self._of_bend = np.empty(0)
        wire = [
            (p.wire_offset, segment_stiffness(p), quadratic_stiffness(p), p.wire_damping * (elements + 1))
            for p in presets
        ]
        # Per routing friction and tension it is linear in the turns: the mean over each group, as a matrix.
        vertebrae = presets[0].vertebrae
        of_hinges = hinge_friction(np.zeros(1), 1.0, np.ones(vertebrae), np.eye(vertebrae))
        law = LoadLaw(
            hinge=layout.hinge,
            pulley=layout.pulley,
            element=layout.element,
            wire=np.array(wire),
            rest_stretch=self.wires.rest_stretch,
            joint=np.array([joint_friction(p) for p in presets]),
            routing=np.array([p.routing_friction * p.wire_offset for p in presets]),
            wrapped=np.stack([of_hinges[:, group].mean(axis=1) for group in hinge_groups(vertebrae)], axis=1),
            time_step=presets[0].time_step,
            ahead=2 * presets[0].control_period,
        )
        self._half_share, self._floor_now = np.empty(len(presets)), np.empty(len(presets))
        self._rewrite = bound(follow_load, law, rewritten, qpos, qvel, self._half_share, self._floor_now)
        two, sticks = len(layout.hinge) == 2, any(preset.stiction for preset in presets)
        self.shared = SharedFriction(presets, layout) if two else None
        self.sticking = Sticking(presets, layout) if sticks else None

    def drift(self, time: Array, travel: Array) -> Array:
        """Return the factor of sheath friction due to warm-up and wear.

        Args:
            time: (B,) time since the start of the run [s].
            travel: (B,) distance that the pulleys have travelled [m].

        Returns:
            (B,) factor on the coefficient and on the floor.
        """
        return friction_drift(self._warm_up, self._warm_up_time, self._wear, time, travel)

    def follow(self, sheath_bend: Array, drift: Array | None) -> None:
        """Rewrite friction and damping to the load of the present state.

        Args:
            sheath_bend: (B,) angle that the sheath is bent by [rad]; not to be changed in place.
            drift: (B,) of `drift`; None where nothing drifts.
        """
        self._follow_sheath(sheath_bend, drift)
        self._rewrite()
        rewritten = self.rewritten
        if self.sticking is not None:
            self.sticking.hold(rewritten.sheath, self.wires.tension_and_slack(self._qpos)[0])
        if self.shared is not None:
            self.shared.write(rewritten.sheath, rewritten.joints, rewritten.loss, rewritten.coefficient)

    @property
    def takes_notes(self) -> bool:
        """Friction depends on what `note` is told."""
        return self.shared is not None

    def note(self, constraint: Array, moving: Index) -> None:
        """Note what friction held in a control period.

        Args:
            constraint: (B, nv) forces of MuJoCo's constraints at its end.
            moving: indices of the endoscopes that were stepped.
        """
        if self.shared is not None:
            sheath, joints, damping = self.rewritten.sheath, self.rewritten.joints, self.rewritten.damping
            self.shared.note(constraint, self._qvel, sheath, joints, damping, moving)

    def memory(self) -> tuple[Array, Array]:
        """Return what friction has of the past, flat: shared directions [rad], and what stiction holds."""
        directions, grip = np.empty(0), np.empty(0)
        if self.shared is not None:
            directions = self.shared.direction.ravel()
        if self.sticking is not None:
            grip = self.sticking.grip.ravel()
        return directions.copy(), grip.copy()

    def restore(self, directions: Array, grip: Array) -> None:
        """Restore what `memory` returned.

        Raises:
            ValueError: it is of another layout.
        """
        own_directions, own_grip = self.memory()
        if directions.shape != own_directions.shape or grip.shape != own_grip.shape:
            raise InputError(
                f"a state with {directions.size} directions of friction and {grip.size} elements that stick "
                f"does not fit this endoscope, which has {own_directions.size} and {own_grip.size}"
            )
        if self.shared is not None:
            self.shared.direction[:] = directions.reshape(self.shared.direction.shape)
        if self.sticking is not None:
            self.sticking.grip[:] = grip.reshape(self.sticking.grip.shape)

    def reset(self) -> None:
        """Forget the past."""
        if self.shared is not None:
            self.shared.reset()
        if self.sticking is not None:
            self.sticking.reset()

    def _follow_sheath(self, sheath_bend: Array, drift: Array | None) -> None:
        """Compute half the friction of an element per unit of tension, and the part that is of no tension."""
        if drift is None and (sheath_bend is self._of_bend or np.array_equal(sheath_bend, self._of_bend)):
            return
        factor = np.ones(len(sheath_bend)) if drift is None else drift
        wrapped = self._friction * factor * (sheath_bend + self._bend_offset)
        self._half_share[:] = friction_per_tension(wrapped, 1.0, self.layout.element.shape[1]) / 2
        self._floor_now[:] = friction_floor(self._floor, self._growth, self._exponent, sheath_bend) * factor
        self._of_bend = sheath_bend
