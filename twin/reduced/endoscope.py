"""One reduced twin with the readings of the MuJoCo twin's `Endoscope`, advanced step by step."""

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.hinges import group_of_hinge
from twin.preset.preset import Preset
from twin.reduced.state import ReducedState, not_converged
from twin.reduced.twins import ReducedTwins

Array = NDArray[np.float64]


class ReducedEndoscope:
    """One reduced twin, driven step by step, with the readings of the MuJoCo twin's `Endoscope`."""

    def __init__(self, preset: Preset, step_time: float | None = None) -> None:
        """Build the endoscope of a preset, at rest; a step is a control period where no time is given [s]."""
        self.preset = preset
        self.twins = ReducedTwins([preset], step_time)
        self._group_of = group_of_hinge(preset.vertebrae)

    @classmethod
    def from_preset(cls, preset: Preset) -> "ReducedEndoscope":
        """Build the endoscope of a preset, at rest."""
        return cls(preset)

    def reset(self) -> None:
        """Reset to rest, with a new sheath; drive and wear are reset too."""
        self.twins.reset()

    def advance(self, pull: float, lateral_pull: float = 0.0, sheath_bend: float | None = None) -> None:
        """Advance the endoscope by one step.

        Args:
            pull: commanded pulling distance of wire a at the end of the step [m].
            lateral_pull: the same of wire c; it needs two bending planes.
            sheath_bend: angle that the sheath is bent by then [rad]; as before where not given.

        Raises:
            ValueError: a command is not finite, the sheath's bend is negative, or there is no second plane.
            FloatingPointError: it did not converge to equilibrium.
        """
        self.twins.step(pull, lateral_pull, sheath_bend)
        if not self.twins.converged[0]:
            raise not_converged(self.preset, float(self.twins.state.missing[0]))

    def bend(self) -> float:
        """Return the bending angle of the tip in the plane of wires a and b [rad]: the sum of all hinges."""
        return float(self.twins.bend()[0])

    def lateral_bend(self) -> float:
        """Return the bending angle of the tip in the plane of wires c and d [rad]; 0 with one plane."""
        return float(self.twins.lateral_bend()[0])

    def joint_angle(self) -> Array:
        """Return the hinge angles in the plane of wires a and b, base to tip (vertebrae,) [rad]."""
        angle: Array = self.twins.state.hinge[0, 0][self._group_of]
        return angle

    def lateral_joint_angle(self) -> Array:
        """Return the hinge angles in the plane of wires c and d, (vertebrae,) [rad]; empty with one plane."""
        lateral: Array = self.twins.state.hinge[0, 1:, self._group_of].reshape(-1)
        return lateral

    def pull(self) -> float:
        """Return the distance by which the pulley has pulled wire a [m]."""
        return float(self.twins.state.pulley[0, 0])

    def wire_tension(self) -> Array:
        """Return the tension of each wire segment, pulley to tip (wires, elements + 1) [N]; 0 where slack."""
        tension: Array = self.twins.wire_tension_and_slack()[0][0]
        return tension

    def wire_slack(self) -> Array:
        """Return the slack of each wire segment, (wires, elements + 1) [m]; 0 where taut."""
        slack: Array = self.twins.wire_tension_and_slack()[1][0]
        return slack

    def sheath_friction(self) -> Array:
        """Return the breakaway friction force of each sheath element, (wires, elements) [N]."""
        friction: Array = self.twins.sheath_friction()[0]
        return friction

    def save_state(self) -> ReducedState:
        """Return the complete state, friction memory included."""
        return self.twins.save_state()

    def restore_state(self, state: ReducedState) -> None:
        """Restore a saved state of an endoscope of the same preset; the run continues bit for bit.

        Raises:
            ValueError: the state is of an endoscope of another size.
        """
        self.twins.restore_state(state)
