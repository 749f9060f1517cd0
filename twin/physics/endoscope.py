"""Endoscope as a dm_control `Physics`: named readings, load-dependent friction, complete state."""

import math
from typing import cast

import mujoco
import numpy as np
from dm_control import mujoco as dm_mujoco
from numpy.typing import NDArray

from twin.errors import InputError
from twin.physics.model import compiled_model, model_xml
from twin.physics.stepping import State, Stepper
from twin.preset.preset import Preset

Array = NDArray[np.float64]


class Endoscope(dm_mujoco.Physics):  # type: ignore[misc]  # dm_control has no types
    """Simulated endoscope. Make one with `Endoscope.from_preset`."""

    preset: Preset
    xml: str  # the model as MJCF text, with what is drawn

    @classmethod
    def from_preset(cls, preset: Preset, *, drawn: bool = True) -> "Endoscope":
        """Build the endoscope of a preset, at rest; if not `drawn`, it is faster, through the same states."""
        xml = model_xml(preset)
        model = dm_mujoco.wrapper.MjModel(compiled_model(xml, drawn=drawn))
        physics = cast("Endoscope", cls.from_model(model))
        physics.xml = xml
        physics._bind(preset)
        return physics

    def _bind(self, preset: Preset) -> None:
        """Look up, once, what every control period reads and writes."""
        self.preset = preset
        self.stepper = Stepper(preset, self.model.ptr, self.data.ptr)
        self.layout = self.stepper.layout

    def reset(self, keyframe_id: int | None = None) -> None:
        """Reset to rest, with a new sheath; drive and wear are reset too."""
        super().reset(keyframe_id)
        if hasattr(self, "stepper"):  # dm_control resets while it builds, before there is anything to read
            self.stepper.begin()

    def bend(self) -> float:
        """Return the bending angle of the tip in the plane of wires a and b [rad]: the sum of all hinges."""
        return float(self.joint_angle().sum())

    def lateral_bend(self) -> float:
        """Return the bending angle of the tip in the plane of wires c and d [rad]; 0 with one plane."""
        return float(self.data.ptr.qpos[self.layout.hinge[1:]].sum())

    def joint_angle(self) -> Array:
        """Return the hinge angles in the plane of wires a and b, base to tip (vertebrae,) [rad]."""
        angle: Array = self.data.ptr.qpos[self.layout.hinge[0]]
        return angle

    def lateral_joint_angle(self) -> Array:
        """Return the hinge angles in the plane of wires c and d, (vertebrae,) [rad]; empty with one plane."""
        angle: Array = self.data.ptr.qpos[self.layout.hinge[1:]].reshape(-1)
        return angle

    def set_pose(self, joint_angle: Array, lateral_joint_angle: Array | None = None) -> None:
        """Set the hinge angles (vertebrae,) [rad] for drawing only: wires and friction do not follow."""
        self.data.ptr.qpos[self.layout.hinge[0]] = joint_angle
        if lateral_joint_angle is not None and len(lateral_joint_angle):
            self.data.ptr.qpos[self.layout.hinge[1]] = lateral_joint_angle
        self.forward()

    def pull(self) -> float:
        """Return the distance by which the pulley has pulled wire a [m]."""
        return float(self.data.ptr.qpos[self.layout.pulley[0]])

    def wire_tension(self) -> Array:
        """Return the tension of each wire segment, pulley to tip (wires, elements + 1) [N]; 0 where slack."""
        return self.wire_tension_and_slack()[0]

    def wire_slack(self) -> Array:
        """Return the slack of each wire segment, (wires, elements + 1) [m]; 0 where taut."""
        return self.wire_tension_and_slack()[1]

    def wire_tension_and_slack(self) -> tuple[Array, Array]:
        """Return `wire_tension` and `wire_slack`, at little more than the cost of one."""
        tension, slack = self.stepper.wires.tension_and_slack(self.data.ptr.qpos[None])
        return tension[0], slack[0]

    def sheath_friction(self) -> Array:
        """Return the breakaway friction force of each sheath element, (wires, elements) [N]."""
        friction: Array = self.stepper.motion.forces.sheath.copy()
        return friction

    def tip_position(self) -> Array:
        """Return the position of the tip, (3,) [m]."""
        mujoco.mj_kinematics(self.model.ptr, self.data.ptr)
        position: Array = self.named.data.site_xpos["tip"].copy()
        return position

    def advance(self, pull: float, lateral_pull: float = 0.0, sheath_bend: float | None = None) -> None:
        """Advance by one control period, at the end of which it is at a pull and a lateral pull [m].

        The friction of the sheath follows the tension that the wires have at the start of the period, or of
        its parts where the command is fast (`division.py`); its bend [rad] is that of the period before where
        not given. Raise `FloatingPointError` where the simulation diverged.
        """
        if not math.isfinite(pull + lateral_pull):
            wrong = lateral_pull if math.isfinite(pull) else pull
            raise InputError(f"commanded pulling distance {wrong}: must be a finite number")
        if lateral_pull and self.preset.bending_planes == 1:
            name = self.preset.name
            raise InputError(f"lateral pull of {lateral_pull:g} m: {name!r} has one bending plane")
        if sheath_bend is None:
            sheath_bend = self.stepper.sheath_bend
        elif not 0 <= sheath_bend < math.inf:
            raise InputError(f"sheath bend of {sheath_bend} rad: must be finite and not negative")
        self.stepper.advance(np.array([[pull, lateral_pull, sheath_bend]]))

    def push_tip(self, force: float) -> None:
        """Push the last vertebra sideways by a force [N] from now on, towards more bend; 0 ends it.

        The direction follows the tip. The force belongs to the state.
        """
        if not math.isfinite(force):
            raise InputError(f"force of {force} N at the tip: must be a finite number")
        self.stepper.tip_force = force
        self.stepper.motion.on_tip[:] = 0.0

    def scale_friction(self, factor: float) -> None:
        """Multiply the friction of the sheath by a factor from now on; 1 ends it. It belongs to the state."""
        if not 0 <= factor < math.inf:
            raise InputError(f"friction factor of {factor}: must be finite and not negative")
        self.stepper.friction_factor = factor

    def save_state(self) -> State:
        """Return the complete state, friction memory included."""
        return self.stepper.save_state()

    def restore_state(self, state: State) -> None:
        """Restore a saved state of an endoscope of the same preset."""
        self.stepper.restore_state(state)
