"""Stepping of one endoscope in MuJoCo along many control periods, in one compiled kernel.

The kernel calls MuJoCo's functions by their names in its library: what Python needs to call them, and to
write friction in between, takes as long as they do.
"""

import ctypes
import dataclasses
import itertools
import math
from typing import Any, NamedTuple, Self, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError, InputError
from twin.mechanics.drive import Drive
from twin.mechanics.kernels import COMPILED, copy_row, copy_rows, entry
from twin.physics.division import STEPPED, Division, write_time_step
from twin.physics.layout import Layout
from twin.physics.load import REWRITTEN, Forces, LoadLaw, Wires, follow_load, sheath_friction
from twin.physics.model import compiled_model, model_xml
from twin.physics.shared_friction import Pairs, Sticking, hold, turn, write_pairs
from twin.preset.preset import Preset

Array = NDArray[np.float64]
TRAVEL, TIME = range(2)  # columns of `Motion.clock`
_WHOLE_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_RELEASE_TIME, _SETTLING_TIME = 1.0, 0.2  # to bring in the curve of a section, and to hold it after that [s]


def _of_mujoco(name: str) -> Any:
    """Return a function of MuJoCo that takes the addresses of model and data, for kernels and for Python."""
    function = getattr(ctypes.CDLL(mujoco._functions.__file__), name)
    function.argtypes, function.restype = (ctypes.c_void_p, ctypes.c_void_p), None
    if not COMPILED:
        return function
    from numba import types
    from numba.core import codegen

    linker = cast(Any, codegen).ll  # llvmlite's
    linker.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    return types.ExternalFunction(name, types.void(types.intp, types.intp))


_mj_step, _mj_kinematics = _of_mujoco("mj_step"), _of_mujoco("mj_kinematics")


class Motion(NamedTuple):
    """One endoscope in MuJoCo: views of its model and data, and what has a memory besides."""

    model: int  # address
    data: int  # address
    qpos: Array  # (nq,)
    qvel: Array  # (nv,)
    act: Array  # (planes,) position of each pulley [m]
    ctrl: Array  # (2 planes,)
    constraint: Array  # (nv,) forces of the constraints
    spring: Array  # (nq,) positions at which the springs of the joints are at rest
    warnings: NDArray[np.int32]  # counts of MuJoCo's warnings
    tip_frame: Array  # (9,) rotation of the last vertebra
    on_tip: Array  # (6,) force and torque on it
    law: LoadLaw
    forces: Forces
    clock: Array  # (2,) travel of the pulleys [m]; time at the start of the last control period [s]

    @classmethod
    def of(cls, preset: Preset, layout: Layout, model: mujoco.MjModel, data: mujoco.MjData) -> Self:
        """Return the views of a model and its data, at rest."""
        tip = model.site("tip").bodyid.item()
        return cls(
            model=model._address,
            data=data._address,
            qpos=data.qpos,
            qvel=data.qvel,
            act=data.act,
            ctrl=data.ctrl,
            constraint=data.qfrc_constraint,
            spring=model.qpos_spring,
            warnings=data.warning.number,
            tip_frame=data.xmat[tip],
            on_tip=data.xfrc_applied[tip],
            law=LoadLaw.of(preset, layout),
            forces=Forces.of(layout, [getattr(model, name) for name in REWRITTEN]),
            clock=np.zeros(2),
        )


class Track(NamedTuple):
    """Inputs at the end of P control periods, and where to record every so many of them."""

    pulley: Array  # (P, planes) distance that each pulley has pulled [m]
    sheath_bend: Array  # (P,) [rad]
    periods: int  # control periods in a sample
    qpos: Array  # (P / periods, nq) positions at the samples; none are recorded where it is empty
    friction: Array  # (P / periods, wires, elements) breakaway friction of the sheath [N]
    spring: Array  # (P, nq) for `Motion.spring`; it stays where this is empty


@entry
def follow(
    motion: Motion,
    sticking: Sticking | None,
    pairs: Pairs | None,
    sheath_bend: float,
    time_step: float,
    part: float,
    time: float,
    scale: float,
) -> None:
    """Write the forces that follow the load at a bend of the sheath [rad], as in `follow_track`."""
    law, forces = motion.law, motion.forces
    half_share, floor = sheath_friction(law, sheath_bend, scale, time, motion.clock[TRAVEL])
    follow_load(law, forces, motion.qpos, motion.qvel, time_step, part, half_share, floor)
    if sticking is not None:
        hold(sticking, forces, part)
    if pairs is not None:
        write_pairs(pairs, forces)


@entry
def follow_track(
    motion: Motion,
    sticking: Sticking | None,
    pairs: Pairs | None,
    track: Track,
    first: int,
    last: int,
    parts: int,
    steps: int,
    time_step: float,
    time: float,
    scale: float,
    tip_force: float,
) -> None:
    """Advance along the control periods from the first to before the last of a track, all in so many parts.

    Each part is of so many time steps [s] from the time [s] on. Friction of the sheath is multiplied by
    `scale`, and `tip_force` pushes the tip sideways [N]. After a warning of MuJoCo, nothing is done any more.
    """
    part = steps * time_step
    for k in range(first, last):
        travel = 0.0
        for p in range(len(motion.act)):
            stride = track.pulley[k, p] - motion.act[p]
            motion.ctrl[2 * p] = motion.ctrl[2 * p + 1] = stride / (parts * part)
            travel += abs(stride)
        motion.clock[TIME] = time
        if len(track.spring) > 0:
            copy_row(motion.spring, track.spring[k])
        for _ in range(parts):
            follow(motion, sticking, pairs, track.sheath_bend[k], time_step, part, time, scale)
            motion.clock[TRAVEL] += travel / parts
            if tip_force != 0.0:  # it turns with the tip
                _mj_kinematics(motion.model, motion.data)
                for axis in range(3):
                    motion.on_tip[axis] = tip_force * motion.tip_frame[3 * axis + 2]
            for _ in range(steps):
                _mj_step(motion.model, motion.data)
                time += time_step
            for count in motion.warnings:
                if count != 0:  # MuJoCo has set a diverged simulation back to time 0
                    return
            if pairs is not None:
                turn(pairs, motion.forces, motion.constraint, motion.qvel, time_step, part)
        if len(track.qpos) > 0 and (k + 1) % track.periods == 0:
            sample = k // track.periods
            copy_row(track.qpos[sample], motion.qpos)
            copy_rows(track.friction[sample], motion.forces.sheath)


@dataclasses.dataclass(frozen=True)
class State:
    """Complete state of a simulated endoscope: restored, the run continues bit for bit."""

    physics: Array  # MuJoCo's integration state (`mjSTATE_INTEGRATION`), warm start of the solver included
    drive: tuple[tuple[float, ...], ...]  # state of the drive of each bending plane, of `Drive.state` [m]
    travel: float  # total distance that the pulleys have travelled, which wears the sheath [m]
    sheath_bend: float  # bend angle of the sheath [rad]
    sheath_friction: Array  # breakaway friction in the last control period, (wires, elements) [N]
    friction_direction: Array  # direction of the friction that two planes share, (pairs,) [rad]; else empty
    grip: Array  # share of its `stiction` that holds each element, (sides, elements) [-]; empty without it
    tip_force: float  # that pushes the tip sideways [N]
    division: Array  # of the last control period, of `Division.past`
    friction_factor: float = 1.0  # of the sheath


class Stepper:
    """Steps an endoscope in MuJoCo along its commands; its state is that of the run."""

    def __init__(self, preset: Preset, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Begin at rest; the data is new."""
        self.preset, self.model, self.data = preset, model, data
        self.layout = Layout.of(model, preset)
        self.wires = Wires(preset, self.layout)
        self.motion = Motion.of(preset, self.layout, model, data)
        # What a None excludes is not compiled.
        self._sticking = Sticking.of(preset, self.layout) if preset.stiction else None
        self._pairs = Pairs.of(preset, self.layout) if preset.bending_planes == 2 else None
        self._drives = [Drive(preset, zero) for zero in preset.command_zeros]
        self._division, self._parts = Division(preset), 0
        self._stepped = [getattr(model, name) for name in STEPPED]
        self.begin()

    @classmethod
    def of(cls, preset: Preset) -> Self:
        """Return an endoscope that cannot be drawn, at rest."""
        model = compiled_model(model_xml(preset), drawn=False)
        return cls(preset, model, mujoco.MjData(model))

    def begin(self) -> None:
        """Begin at rest with a new sheath; the data is new, or was reset."""
        for drive in self._drives:
            drive.reset()
        self.motion.clock[:] = 0.0
        self.tip_force, self.friction_factor, self.sheath_bend = 0.0, 1.0, self.preset.sheath_bend
        self._division.reset()
        self._divide(1)
        self._forget()
        step, part = self._time_step, self._steps * self._time_step
        follow(self.motion, self._sticking, self._pairs, self.sheath_bend, step, part, 0.0, 1.0)
        if any(self.preset.initial_bends):
            self._let_go()

    def _forget(self) -> None:
        """Forget which elements stick, and where shared friction points."""
        if self._pairs is not None:
            self._pairs.direction[:] = 0.0
        if self._sticking is not None:
            self._sticking.grip[:] = 1.0

    def _let_go(self) -> None:
        """Let a curved section go from straight to where friction holds it, slowly.

        The motion of a section that is released at once depends on its inertia, which is chosen for the time
        step: so the curve of its springs is brought in before the run begins.
        """
        period, spring = self.preset.control_period, self.motion.spring
        rising, held = math.ceil(_RELEASE_TIME / period), math.ceil(_SETTLING_TIME / period)
        share = np.minimum(np.arange(1, rising + held + 1) / rising, 1.0)
        inputs = np.zeros((len(share), 3))
        inputs[:, : self.preset.bending_planes] = self.preset.command_zeros
        inputs[:, 2] = self.sheath_bend
        self.advance(inputs, spring=share[:, None] * spring)
        self.data.time = 0.0
        self._forget()

    def advance(
        self, inputs: Array, record: tuple[Array, Array] | None = None, spring: Array | None = None
    ) -> None:
        """Advance along control periods with inputs (P, 3) at their ends, all finite.

        They are pull [m], lateral pull [m] and bend of the sheath [rad]. Recorded are positions (S, nq) and
        friction (S, wires, elements) [N] at S samples of equal length. `spring` (P, nq) are positions at
        which the springs of the joints are at rest. Raise `FloatingPointError` if the simulation diverges.
        """
        pulley = np.empty((len(inputs), len(self._drives)))
        for plane, drive in enumerate(self._drives):
            pulley[:, plane] = drive.follow(inputs[:, plane])
        none = np.empty((0, 0))
        qpos, friction = record or (none, none[None])
        periods = len(inputs) // max(len(qpos), 1)
        track = Track(
            pulley, inputs[:, 2].copy(), periods, qpos, friction, none if spring is None else spring
        )
        parts, acts = self._division.parts(pulley), (self.friction_factor, self.tip_force)
        turns = (np.flatnonzero(np.diff(parts)) + 1).tolist()
        for first, last in itertools.pairwise([0, *turns, len(inputs)]):
            self._divide(int(parts[first]))
            now = self._parts, self._steps, self._time_step, self.data.time
            follow_track(self.motion, self._sticking, self._pairs, track, first, last, *now, *acts)
            if self.motion.warnings.any():
                raise DivergedError(
                    f"the simulation of {self.preset.name!r} diverged after {self.motion.clock[TIME]:.3f} s: "
                    f"lower time_step ({self.preset.time_step:g} s) or the stiffness of the wires"
                )
        self.sheath_bend = float(inputs[-1, 2])

    def _divide(self, parts: int) -> None:
        """Set the time step to the parts of the control period."""
        if parts == self._parts:
            return
        self._parts = parts
        self._steps, self._time_step = self._division.steps(parts)
        self.model.opt.timestep = self._time_step
        write_time_step(self.preset, self.layout, self._stepped, self._time_step)

    def save_state(self) -> State:
        """Return the complete state, friction memory included."""
        physics = np.empty(mujoco.mj_stateSize(self.model, _WHOLE_STATE))
        mujoco.mj_getState(self.model, self.data, physics, _WHOLE_STATE)
        return State(
            physics,
            drive=tuple(drive.state() for drive in self._drives),
            travel=float(self.motion.clock[TRAVEL]),
            sheath_bend=self.sheath_bend,
            sheath_friction=self.motion.forces.sheath.copy(),
            friction_direction=self._direction.copy(),
            grip=self._grip.copy(),
            tip_force=self.tip_force,
            division=self._division.past.copy(),
            friction_factor=self.friction_factor,
        )

    @property
    def _direction(self) -> Array:
        return np.empty(0) if self._pairs is None else self._pairs.direction

    @property
    def _grip(self) -> Array:
        return np.empty(0) if self._sticking is None else self._sticking.grip

    def restore_state(self, state: State) -> None:
        """Restore a saved state of an endoscope of the same preset."""
        if not isinstance(state, State):
            raise InputError(f"a state of MuJoCo is needed, this is a {type(state).__name__:.40}")
        model, data = self.model, self.data
        size = mujoco.mj_stateSize(model, _WHOLE_STATE)
        own = [(size,), self.layout.element.shape, self._direction.shape, self._grip.shape]
        saved = state.physics, state.sheath_friction, state.friction_direction, state.grip
        if [array.shape for array in saved] != own:
            raise InputError(
                f"a state of {state.physics.size} numbers does not fit this endoscope, which has {size}"
            )
        mujoco.mj_setState(model, data, state.physics, _WHOLE_STATE)
        self.motion.warnings[:] = 0  # that it diverged is no part of a state
        self.motion.forces.sheath[:] = state.sheath_friction
        self._direction[:], self._grip[:] = state.friction_direction, state.grip
        for drive, of_drive in zip(self._drives, state.drive, strict=True):
            drive.restore(of_drive)
        self.motion.clock[TRAVEL] = state.travel
        self.tip_force, self.sheath_bend = state.tip_force, state.sheath_bend
        self.friction_factor = state.friction_factor
        self._division.past[:] = state.division
        mujoco.mj_fwdPosition(model, data)
