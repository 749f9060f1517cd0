"""Load-dependent forces in batches: friction and damping of MuJoCo's models, from the tension of the wires.

MuJoCo knows one constant friction force per joint. Here it is rewritten, once per control period, from where
the wires are; so is the damping of the wires, which must vanish with their tension, and their inertia.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.mechanics.friction import (
    LEAST_FRICTION,
    friction_drift,
    friction_floor,
    friction_per_tension,
    hinge_friction,
    hinge_groups,
    joint_friction,
)
from twin.mechanics.kernels import entry
from twin.mechanics.wire import ABSENT, quadratic_stiffness, rest_stretch, segment_stiffness, tension_at
from twin.physics.layout import Index, Layout, consecutive
from twin.physics.shared_friction import SharedFriction, Sticking
from twin.preset.preset import Preset

Array = NDArray[np.float64]
REWRITTEN = ("dof_frictionloss", "tendon_frictionloss", "tendon_damping", "tendon_armature", "wrap_prm")
"""Fields of MuJoCo's models that follow the load."""
NEARLY_TAUT = 1e-6  # slack up to which a wire counts as taut [m]
# Share of their inertia that slack segments keep. A chain of them that turns taut is stable, until the next
# update, up to a stiffness of 0.4 + 4 * share times that without tension. A larger share delays what slides.
SLACK_SHARE = 0.5


class Rewritten(NamedTuple):
    """Forces that follow the load, of B endoscopes: views of MuJoCo's fields, to write through.

    With two planes, friction is written by way of `SharedFriction`: `sheath` and `joints` are no views then.
    """

    sheath: Array  # breakaway friction of the sheath elements, (B, wires, elements) [N]
    joints: Array  # breakaway friction of each hinge of a group, (B, planes, groups) [N m]
    damping: Array  # of the wire segments, (B, wires, elements + 1) [N s / m]
    inertia: Array  # of the wire segments, (B, wires, elements + 1) [kg]: see `model.py`
    loss: Array  # friction of pairs of neighbours, along and across, (B, 2, pairs); none with one plane
    coefficient: Array  # of their tendons, (B, 2, wraps); likewise


class LoadLaw(NamedTuple):
    """Parameters of B endoscopes by which forces follow the load; indices are those of `Layout`."""

    hinge: Index  # (planes, vertebrae)
    pulley: Index  # (planes,)
    element: Index  # (wires, elements)
    wire: Array  # (B, 4) moment arm [m], k [N / m] and k2 [N / m^2] of a segment, own damping [N s / m]
    rest_stretch: Array  # (B, wires, elements + 1) stretch of each segment at positions of zero [m]
    joint: Array  # (B, groups) own friction of a hinge of each group [N m]
    routing: Array  # (B,) friction of wires on vertebrae times moment arm [m]
    wrapped: Array  # (vertebrae, groups) share of the turn of each hinge that one of each group feels [-]
    time_step: Array  # (B,) [s]
    part: Array  # (B,) time from one update to the next [s]


@entry
def follow_load(
    law: LoadLaw,
    rewritten: Rewritten,
    qpos: Array,
    qvel: Array,
    half_share: Array,
    floor: Array,
    moving: Index,
) -> None:
    """Write friction and damping of those `moving` of B endoscopes: of sheath and hinges, and of the wires.

    These are `tension_at`, `element_friction` and `hinge_friction`, from the pulley to the tip. Damping
    holds, besides the wire's own, time step times stiffness: with it, and with as much inertia times the time
    step, a step is one of backward Euler (`model.py`). A segment that will be taut before the next update has
    it already.

    Inertia has the stiffness expected at the next update, and segments that are slack keep a share of it: an
    element that slides may pull its neighbours taut within the period, and a chain of taut segments diverges
    at any time step where this inertia is missing. Unlike damping, it does not drag.

    `half_share` (B,) is half the friction of an element per unit of the tension on both its sides [-],
    `floor` (B,) its friction that does not depend on the tension [N].
    """
    wires, elements = law.element.shape
    planes, (vertebrae, groups) = len(law.pulley), law.wrapped.shape
    for b in moving:
        time_step, ahead = law.time_step[b], 2 * law.part[b]
        arm, stiffness, quadratic, own = law.wire[b, 0], law.wire[b, 1], law.wire[b, 2], law.wire[b, 3]
        for plane in range(planes):
            bend, bend_rate = 0.0, 0.0
            for joint in law.hinge[plane]:
                bend += qpos[b, joint]
                bend_rate += qvel[b, joint]
            at_tip = 0.0
            for w in range(plane * wires // planes, (plane + 1) * wires // planes):
                side = 1.0 - 2.0 * (w % 2)
                pulley = law.pulley[plane]
                start, start_rate = side * qpos[b, pulley], side * qvel[b, pulley]
                before = 0.0
                for i in range(elements + 1):
                    if i < elements:
                        end, end_rate = qpos[b, law.element[w, i]], qvel[b, law.element[w, i]]
                    else:
                        end, end_rate = side * arm * bend, side * arm * bend_rate
                    stretch = law.rest_stretch[b, w, i] + start - end
                    soon = stretch + ahead * (start_rate - end_rate)
                    taut = max(stretch, 0.0)
                    tension = taut * (stiffness + quadratic * taut)
                    if i > 0:
                        rewritten.sheath[b, w, i - 1] = half_share[b] * (tension + before) + floor[b]
                    damping, inertia = 0.0, 0.0
                    stiffest = own + time_step * (stiffness + 2 * quadratic * max(taut, soon))
                    if max(stretch, soon) > -NEARLY_TAUT:
                        damping = own + time_step * (stiffness + 2 * quadratic * taut)
                        inertia = time_step * stiffest
                    elif stretch > -ABSENT / 2:
                        inertia = SLACK_SHARE * time_step * stiffest
                    rewritten.damping[b, w, i] = damping
                    rewritten.inertia[b, w, i] = inertia
                    before, start, start_rate = tension, end, end_rate
                at_tip += before

            for g in range(groups):
                felt = 0.0
                for v in range(vertebrae):
                    turn = abs(qpos[b, law.hinge[0, v]])
                    if planes == 2:
                        turn = math.hypot(turn, qpos[b, law.hinge[1, v]])
                    felt += turn * law.wrapped[v, g]
                rewritten.joints[b, plane, g] = law.joint[b, g] + law.routing[b] * at_tip * felt


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


class Wires:
    """Wires of B endoscopes of one layout, which may differ in their parameters."""

    def __init__(self, presets: Sequence[Preset], layout: Layout) -> None:
        self._of_one = layout.wire.shape
        self.stiffness = np.array([segment_stiffness(p) for p in presets])[:, None, None]  # [N / m]
        self.quadratic = np.array([quadratic_stiffness(p) for p in presets])[:, None, None]  # [N / m^2]
        sides = [bool(wire % 2) for wire in range(len(layout.element))]
        self.rest_stretch = np.array([[rest_stretch(p, side) for side in sides] for p in presets])
        self.lengthening = np.array([_lengthening(p, layout) for p in presets])

    def tension_and_slack(self, qpos: Array) -> tuple[Array, Array]:
        """Return tension [N] and slack [m] of each segment, both (B, wires, elements + 1).

        `qpos` (B, nq) are positions; of one endoscope, at any number of times.
        """
        lengthened = np.matmul(self.lengthening, qpos[:, :, None]).reshape(-1, *self._of_one)
        stretch = self.rest_stretch + lengthened
        return tension_at(stretch, self.stiffness, self.quadratic), np.maximum(-stretch, 0.0)


def _lengthening(preset: Preset, layout: Layout) -> Array:
    """Return the Jacobian of the wire segments' lengths, (wires * (elements + 1), nq)."""
    wires, positions = layout.wire.shape, layout.element.size + layout.pulley.size + layout.hinge.size
    matrix = np.zeros((*wires, positions))
    for wire in range(wires[0]):
        side, plane = 1.0 - 2.0 * (wire % 2), wire // 2
        for element, joint in enumerate(layout.element[wire]):
            matrix[wire, element, joint] = -1.0
            matrix[wire, element + 1, joint] = 1.0
        matrix[wire, 0, layout.pulley[plane]] = side
        matrix[wire, -1, layout.hinge[plane]] = -side * preset.wire_offset
    return matrix.reshape(-1, positions)


class Loads:
    """Load-dependent forces of B endoscopes of one layout, which may differ in their parameters."""

    def __init__(
        self, presets: Sequence[Preset], layout: Layout, rewritten: Rewritten, qpos: Array, qvel: Array
    ) -> None:
        """Gather the parameters of all endoscopes, along the leading axis of every array.

        `rewritten` is where the forces go; `qpos` (B, nq) and `qvel` (B, nv) are MuJoCo's own arrays.
        """
        self.rewritten, self._qpos, self._qvel = rewritten, qpos, qvel
        self.layout, self.wires = layout, Wires(presets, layout)
        elements = presets[0].sheath_elements

        def each(name: str) -> Array:
            return np.array([getattr(p, name) for p in presets])

        self._friction, self._bend_offset = each("sheath_friction"), each("sheath_bend_offset")
        self._floor = np.maximum(each("sheath_friction_floor") / elements, LEAST_FRICTION)
        self._growth = each("sheath_friction_growth") / elements
        self._exponent = each("sheath_friction_exponent")
        self._warm_up, self._warm_up_time = each("friction_warm_up"), each("warm_up_time")
        self._wear = each("friction_wear")
        self.drifts = bool(self._warm_up.any() or self._wear.any())
        self._of_bend = np.empty(0)
        wire = [
            (p.wire_offset, segment_stiffness(p), quadratic_stiffness(p), p.wire_damping * (elements + 1))
            for p in presets
        ]
        # Per routing friction and tension it is linear in the turns: the mean over each group, as a matrix.
        vertebrae = presets[0].vertebrae
        of_hinges = hinge_friction(np.zeros(1), 1.0, np.ones(vertebrae), np.eye(vertebrae))
        self._law = LoadLaw(
            hinge=layout.hinge,
            pulley=layout.pulley,
            element=layout.element,
            wire=np.array(wire),
            rest_stretch=self.wires.rest_stretch,
            joint=np.array([joint_friction(p) for p in presets]),
            routing=each("routing_friction") * each("wire_offset"),
            wrapped=np.stack([of_hinges[:, group].mean(axis=1) for group in hinge_groups(vertebrae)], axis=1),
            time_step=each("time_step"),
            part=each("control_period"),
        )
        self._half_share, self._floor_now = np.empty(len(presets)), np.empty(len(presets))
        two, sticks = len(layout.hinge) == 2, any(preset.stiction for preset in presets)
        clock = self._law.time_step, self._law.part  # which `divide` changes
        self.shared = SharedFriction(presets, layout, *clock) if two else None
        self.sticking = Sticking(presets, layout, self._law.part) if sticks else None

    def drift(self, time: Array, travel: Array) -> Array:
        """Return the factor (B,) of sheath friction after times [s] and travels of the pulleys [m], (B,)."""
        return friction_drift(self._warm_up, self._warm_up_time, self._wear, time, travel)

    def divide(self, index: int, part: float, time_step: float) -> None:
        """Let one endoscope be updated after each part of its control period from now on, in steps [s]."""
        self._law.time_step[index], self._law.part[index] = time_step, part

    def follow(self, sheath_bend: Array, drift: Array | None, moving: Index) -> None:
        """Rewrite friction and damping of the endoscopes `moving` to the load of the present state.

        `sheath_bend` (B,) [rad] must not be changed in place; `drift` (B,) is None where nothing drifts.
        """
        rewritten = self.rewritten
        same_bend = sheath_bend is self._of_bend or np.array_equal(sheath_bend, self._of_bend)
        if drift is not None or not same_bend:
            factor = np.ones(len(sheath_bend)) if drift is None else drift
            wrapped = self._friction * factor * (sheath_bend + self._bend_offset)
            self._half_share[:] = friction_per_tension(wrapped, 1.0, self.layout.element.shape[1]) / 2
            floor = friction_floor(self._floor, self._growth, self._exponent, sheath_bend)
            self._floor_now[:] = floor * factor
            self._of_bend = sheath_bend if drift is None else np.empty(0)
        follow_load(self._law, rewritten, self._qpos, self._qvel, self._half_share, self._floor_now, moving)
        if self.sticking is not None:
            self.sticking.hold(rewritten.sheath, self.wires.tension_and_slack(self._qpos)[0], moving)
        if self.shared is not None:
            self.shared.write(rewritten.sheath, rewritten.joints, rewritten.loss, rewritten.coefficient)

    @property
    def needs_constraint_feedback(self) -> bool:
        """True if friction depends on the forces that `observe_constraints` is given."""
        return self.shared is not None

    def observe_constraints(self, constraint: Array, moving: Index) -> None:
        """Let friction follow the forces (B, nv) of MuJoCo's constraints at the end of a control period."""
        if self.shared is not None:
            sheath, joints, damping = self.rewritten.sheath, self.rewritten.joints, self.rewritten.damping
            self.shared.observe_constraints(constraint, self._qvel, sheath, joints, damping, moving)

    def memory(self) -> tuple[Array, Array]:
        """Return what friction has of the past, flat: shared directions [rad], and what stiction holds."""
        directions = np.empty(0) if self.shared is None else self.shared.direction.flatten()
        return directions, np.empty(0) if self.sticking is None else self.sticking.grip.flatten()

    def restore(self, directions: Array, grip: Array) -> None:
        """Restore what `memory` returned."""
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
        """Forget the past: all directions in the first plane, all elements at rest."""
        if self.shared is not None:
            self.shared.direction[:] = 0.0
        if self.sticking is not None:
            self.sticking.grip[:] = 1.0
