"""Endoscope as a dm_control `Physics`: named readings, load-dependent friction, complete state."""

import dataclasses
import math
from typing import cast

import mujoco
import numpy as np
from dm_control import mujoco as dm_mujoco
from numpy.typing import NDArray

from twin.errors import DivergedError, InputError
from twin.mechanics.drive import Drive
from twin.physics.division import STEPPED, Division, write_time_step
from twin.physics.layout import Layout
from twin.physics.load import REWRITTEN, Loads, views
from twin.physics.model import compiled_model, model_xml
from twin.preset.preset import Preset

Array = NDArray[np.float64]
_ALONE = np.zeros(1, dtype=np.intp)
_WHOLE_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_RELEASE_TIME, _SETTLING_TIME = 4.0, 0.2  # to bring in the curve of a section, and to hold it after that [s]


@dataclasses.dataclass(frozen=True)
class State:
    """Complete state of a simulated endoscope: restored, the run continues bit for bit."""

    physics: Array  # MuJoCo's integration state (`mjSTATE_INTEGRATION`), warm start of the solver included
    drive: tuple[tuple[float, ...], ...]  # state of the drive of each bending plane, of `Drive.state` [m]
    travel: float  # total distance that the pulleys have travelled, which wears the sheath [m]
    sheath_bend: float  # bend angle of the sheath [rad]
    sheath_friction: Array  # breakaway friction in the last control period, (wires, elements) [N]
    friction_direction: Array  # direction of the friction that two planes share, (pairs,) [rad]; else empty
    grip: Array  # share of its `stiction` that holds each element of the sheath, flat [-]; empty without it
    tip_force: float  # that pushes the tip sideways [N]
    division: tuple[float, ...]  # of the last control period, of `Division.state`
    friction_factor: float = 1.0  # of the sheath


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
        """Look up, once, the indices of what every control period reads and writes."""
        self.preset = preset
        self.layout = Layout.of(self.model.ptr, preset)
        self._drives = [Drive(preset, zero) for zero in preset.command_zeros]
        self._travel, self._friction_factor = 0.0, 1.0
        self._division = Division(preset)
        self._sheath_bend = np.array([preset.sheath_bend])
        model, data = self.model.ptr, self.data.ptr
        self._pair = model, data
        self._qpos = data.qpos[None]
        self._tip = model.site("tip").bodyid.item()
        self._on_tip, self._tip_force = data.xfrc_applied[self._tip], 0.0
        self._act, self._ctrl, self._warnings = data.act, data.ctrl, data.warning.number
        rewritten = views(self.layout, [getattr(model, name)[None] for name in REWRITTEN])
        self._loads = Loads([preset], self.layout, rewritten, data.qpos[None], data.qvel[None])
        self._stepped = [getattr(model, name) for name in STEPPED]
        self._divide()
        self._follow_load()
        self._let_go()

    def reset(self, keyframe_id: int | None = None) -> None:
        """Reset to rest, with a new sheath; drive and wear are reset too."""
        super().reset(keyframe_id)
        if hasattr(self, "_drives"):  # dm_control resets while it builds, before there is anything to read
            for drive in self._drives:
                drive.reset()
            self._travel = self._tip_force = 0.0
            self._friction_factor = 1.0
            self._sheath_bend = np.array([self.preset.sheath_bend])
            self._loads.reset()
            self._division.reset()
            self._divide()
            self._follow_load()
            self._let_go()

    def _let_go(self) -> None:
        """Let a curved section go from straight to where friction holds it, slowly."""
        model, data = self._pair
        if not any(self.preset.initial_bends):
            return
        curve = model.qpos_spring[self.layout.hinge]
        for share in release_shares(self.preset):
            model.qpos_spring[self.layout.hinge] = share * curve
            self.advance(*self.preset.command_zeros)
        data.time = 0.0
        self._loads.reset()

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
        tension, slack = self._loads.wires.tension_and_slack(self._qpos)
        return tension[0], slack[0]

    def sheath_friction(self) -> Array:
        """Return the breakaway friction force of each sheath element, (wires, elements) [N]."""
        friction: Array = self._loads.rewritten.sheath[0].copy()
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
        if lateral_pull and len(self._drives) == 1:
            name = self.preset.name
            raise InputError(f"lateral pull of {lateral_pull:g} m: {name!r} has one bending plane")
        if sheath_bend is not None and sheath_bend != self._sheath_bend[0]:
            if not 0 <= sheath_bend < math.inf:
                raise InputError(f"sheath bend of {sheath_bend} rad: must be finite and not negative")
            self._sheath_bend = np.array([sheath_bend])
        period, strides = self.preset.control_period, []
        for plane, (drive, command) in enumerate(zip(self._drives, (pull, lateral_pull), strict=False)):
            stride = drive.advance(command) - self._act.item(plane)
            self._ctrl[2 * plane : 2 * plane + 2] = stride / period
            strides.append(stride)
        before = self._division.parts
        if self._division.advance(strides) != before:
            self._divide()
        model, data = self._pair
        start, each = data.time, sum(map(abs, strides)) / self._division.parts
        for _ in range(self._division.parts):
            self._follow_load()
            self._travel += each
            if self._tip_force:  # it turns with the tip
                mujoco.mj_kinematics(model, data)
                self._on_tip[:3] = self._tip_force * data.xmat[self._tip].reshape(3, 3)[:, 2]
            mujoco.mj_step(model, data, self._steps)
            if any(self._warnings.tolist()):  # MuJoCo sets a diverged simulation back to time 0
                raise DivergedError(
                    f"the simulation of {self.preset.name!r} diverged after {start:.3f} s: "
                    f"lower time_step ({self.preset.time_step:g} s) or the stiffness of the wires"
                )
            if self._loads.needs_constraint_feedback:
                self._loads.observe_constraints(data.qfrc_constraint[None], _ALONE)

    def _divide(self) -> None:
        """Set the time step to the parts of the control period."""
        self._steps, time_step = self._division.steps()
        self._pair[0].opt.timestep = time_step
        write_time_step(self.preset, self.layout, self._stepped, time_step)
        self._loads.divide(0, self._steps * time_step, time_step)

    def push_tip(self, force: float) -> None:
        """Push the last vertebra sideways by a force [N] from now on, towards more bend; 0 ends it.

        The direction follows the tip. The force belongs to the state.
        """
        if not math.isfinite(force):
            raise InputError(f"force of {force} N at the tip: must be a finite number")
        self._tip_force = force
        self._on_tip[:] = 0.0

    def scale_friction(self, factor: float) -> None:
        """Multiply the friction of the sheath by a factor from now on; 1 ends it. It belongs to the state."""
        if not 0 <= factor < math.inf:
            raise InputError(f"friction factor of {factor}: must be finite and not negative")
        self._friction_factor = factor

    def _follow_load(self) -> None:
        drift = None
        if self._loads.drifts:
            drift = self._loads.drift(np.array([self.data.ptr.time]), np.array([self._travel]))
        if self._friction_factor != 1.0:
            drift = np.array([self._friction_factor]) * (1.0 if drift is None else drift)
        self._loads.follow(self._sheath_bend, drift, _ALONE)

    def save_state(self) -> State:
        """Return the complete state, friction memory included."""
        model, data = self.model.ptr, self.data.ptr
        physics = np.empty(mujoco.mj_stateSize(model, _WHOLE_STATE))
        mujoco.mj_getState(model, data, physics, _WHOLE_STATE)
        drive = tuple(drive.state() for drive in self._drives)
        bend, friction = float(self._sheath_bend[0]), self.sheath_friction()
        memory, division = self._loads.memory(), self._division.state()
        factor = self._friction_factor
        return State(physics, drive, self._travel, bend, friction, *memory, self._tip_force, division, factor)

    def restore_state(self, state: State) -> None:
        """Restore a saved state of an endoscope of the same preset."""
        if not isinstance(state, State):
            raise InputError(f"a state of MuJoCo is needed, this is a {type(state).__name__:.40}")
        model, data = self.model.ptr, self.data.ptr
        size = mujoco.mj_stateSize(model, _WHOLE_STATE)
        if state.physics.shape != (size,) or state.sheath_friction.shape != self.layout.element.shape:
            raise InputError(
                f"a state of {state.physics.size} numbers does not fit this endoscope, which has {size}"
            )
        self._loads.restore(state.friction_direction, state.grip)
        mujoco.mj_setState(model, data, state.physics, _WHOLE_STATE)
        self._warnings[:] = 0  # that it diverged is no part of a state
        self._loads.rewritten.sheath[0] = state.sheath_friction
        for drive, saved in zip(self._drives, state.drive, strict=True):
            drive.restore(saved)
        self._travel, self._tip_force = state.travel, state.tip_force
        self._friction_factor = state.friction_factor
        self._sheath_bend = np.array([state.sheath_bend])
        self._division.restore(state.division)
        self._divide()
        mujoco.mj_fwdPosition(model, data)


def release_shares(preset: Preset) -> list[float]:
    """Return the share of its curve that a section has in each control period of its release.

    It is built straight. The motion of a section that is released at once depends on its inertia, which is
    chosen for the time step in MuJoCo: so the curve of its springs is brought in slowly, before the run
    begins.
    """
    rising = math.ceil(_RELEASE_TIME / preset.control_period)
    held = math.ceil(_SETTLING_TIME / preset.control_period)
    return [step / rising for step in range(1, rising + 1)] + [1.0] * held
