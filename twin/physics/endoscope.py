"""The endoscope as a dm_control `Physics`: named readings, load-dependent friction and the whole state."""

import dataclasses
from typing import cast

import mujoco
import numpy as np
from dm_control import mujoco as dm_mujoco
from numpy.typing import NDArray

from twin.physics.friction import element_friction
from twin.physics.model import WIRES, model_xml, segment_stiffness
from twin.preset import Preset

Array = NDArray[np.float64]
_WHOLE_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


@dataclasses.dataclass(frozen=True)
class State:
    """Everything that the future of a run depends on: restored, the run continues bit for bit."""

    physics: Array
    """MuJoCo's integration state: positions, velocities, actuator memory, warm start of the solver, ..."""
    friction: Array
    """(2, elements) friction of the sheath [N]; it lives in the model, which MuJoCo's state leaves out."""


class Endoscope(dm_mujoco.Physics):
    """A simulated endoscope. Make one with `Endoscope.from_preset`."""

    preset: Preset
    xml: str
    """The model as MJCF text."""

    @classmethod
    def from_preset(cls, preset: Preset) -> "Endoscope":
        """Build the model of a preset, at rest and straight."""
        xml = model_xml(preset)
        physics = cast("Endoscope", cls.from_xml_string(xml))
        physics.xml = xml
        physics._bind(preset)
        return physics

    def _bind(self, preset: Preset) -> None:
        """Look up by name, once, what is read and written at every control period."""
        self.preset = preset
        model = self.model.ptr
        elements = range(preset.sheath_elements)
        self._steps = round(preset.control_period / preset.time_step)
        self._hinges = np.array([model.joint(f"hinge_{i}").qposadr[0] for i in range(preset.vertebrae)])
        self._sheath = np.array([[model.joint(f"sheath_{w}{i}").dofadr[0] for i in elements] for w in WIRES])
        lengths = range(preset.sheath_elements + 1)
        self._wires = np.array([[model.tendon(f"wire_{w}{i}").id for i in lengths] for w in WIRES])
        self._slack_length = model.tendon_lengthspring[self._wires, 1].copy()
        self._wire_stiffness = segment_stiffness(preset)

    def bend(self) -> float:
        """Bending angle of the tip against the shaft [rad]: the sum of all hinges."""
        return float(self.joint_angle().sum())

    def joint_angle(self) -> Array:
        """(vertebrae,) angle of each hinge, base to tip [rad]."""
        return self.data.ptr.qpos[self._hinges]

    def set_pose(self, joint_angle: Array) -> None:
        """Put the hinges at (vertebrae,) angles [rad], to be drawn; wires and friction stay behind."""
        self.data.ptr.qpos[self._hinges] = joint_angle
        self.forward()

    def pull(self) -> float:
        """Distance that the pulley has pulled wire a [m]."""
        return float(self.named.data.qpos["pulley"][0])

    def wire_tension(self) -> Array:
        """(2, elements + 1) tension in each length of wires a and b, pulley to tip [N]; zero where slack."""
        stretch = self.data.ptr.ten_length[self._wires] - self._slack_length
        return self._wire_stiffness * np.maximum(stretch, 0)

    def sheath_friction(self) -> Array:
        """(2, elements) friction force at which each element of the sheath begins to slide [N]."""
        return self.model.ptr.dof_frictionloss[self._sheath]

    def tip_position(self) -> Array:
        """(3,) position of the tip [m]."""
        return self.named.data.site_xpos["tip"].copy()

    def advance(self, pull: float) -> None:
        """Run one control period, at whose end the commanded distance is `pull` [m].

        The friction of the sheath follows the tension that the wires have at the start of the period.

        Raises:
            ValueError: `pull` is not finite.
            FloatingPointError: the simulation diverged.
        """
        if not np.isfinite(pull):
            raise ValueError(f"commanded pulling distance {pull}: must be a finite number")
        data, preset = self.data.ptr, self.preset
        self.model.ptr.dof_frictionloss[self._sheath] = element_friction(
            self.wire_tension(), preset.sheath_friction, preset.sheath_bend, preset.sheath_friction_floor
        )
        data.ctrl[:] = (pull - data.act[0]) / preset.control_period
        self.step(self._steps)
        if data.warning.number.any():
            raise FloatingPointError(
                f"the simulation of {preset.name!r} diverged at {self.time():.3f} s: "
                f"lower time_step ({preset.time_step:g} s) or the stiffness of the wires"
            )

    def save_state(self) -> State:
        """Return the whole state, friction memory included."""
        model, data = self.model.ptr, self.data.ptr
        physics = np.empty(mujoco.mj_stateSize(model, _WHOLE_STATE))
        mujoco.mj_getState(model, data, physics, _WHOLE_STATE)
        return State(physics, self.sheath_friction().copy())

    def restore_state(self, state: State) -> None:
        """Go back to a saved state of an endoscope of the same preset.

        Raises:
            ValueError: the state is of a model of another size.
        """
        model, data = self.model.ptr, self.data.ptr
        size = mujoco.mj_stateSize(model, _WHOLE_STATE)
        if state.physics.shape != (size,) or state.friction.shape != self._sheath.shape:
            raise ValueError(
                f"a state of {state.physics.size} numbers does not fit this endoscope, which has {size}"
            )
        model.dof_frictionloss[self._sheath] = state.friction
        mujoco.mj_setState(model, data, state.physics, _WHOLE_STATE)
        # dm_control begins a step with the second half of MuJoCo's; this is the first, from the same inputs.
        mujoco.mj_step1(model, data)
