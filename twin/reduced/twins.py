"""Reduced twins that are advanced sample by sample: for ensembles, controllers and estimators online."""

import copy
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import DivergedError, InputError
from twin.mechanics.hinges import hinge_groups
from twin.preset.preset import Preset
from twin.preset.sample_time import check_sample_time
from twin.reduced.advance import ReducedState, advance, friction_drift, new_state
from twin.reduced.parameters import parameters_of
from twin.reduced.readings import sheath_friction, tension_and_slack

Array = NDArray[np.float64]

MISSING_LIMIT_N = 1e-6
"""Force that may be missing from equilibrium [N]; with more an endoscope has failed."""


class ReducedTwins:
    """M endoscopes in quasi-static equilibrium, advanced together; the whole state is plain arrays.

    Attributes:
        presets: their parameters.
        parameters: the same as arrays, for the kernels.
        state: where they are.
    """

    def __init__(self, presets: Sequence[Preset], sample_time: float | None = None) -> None:
        """Build endoscopes that are straight and at rest.

        Args:
            presets: M endoscopes with equal numbers of planes, vertebrae and elements and equal control
                periods.
            sample_time: between two samples [s], a whole multiple of the control period; without it, one.

        Raises:
            ValueError: they differ in layout, gravity pulls at one, or the sample time does not fit.
        """
        self.presets = list(presets)
        self.parameters = parameters_of(presets)
        self._periods = 1 if sample_time is None else check_sample_time(self.presets[0], sample_time)
        self.state = new_state(self.parameters, np.array([preset.sheath_bend for preset in presets]))
        self._inputs = self.state.command.copy()

    def step(
        self, pull: ArrayLike, lateral_pull: ArrayLike = 0.0, sheath_bend: ArrayLike | None = None
    ) -> Array:
        """Advance all endoscopes by one sample, along straight lines from the inputs before.

        Args:
            pull: commanded pulling distance of wire a at the end of the sample [m], one or (M,).
            lateral_pull: the same of wire c; it needs two bending planes.
            sheath_bend: angle that the sheath is bent by then [rad]; as before where not given.

        Returns:
            (M,) bending angle [rad].

        Raises:
            ValueError: an input is not finite, the sheath's bend is negative, or there is no second plane.
        """
        self._inputs[:, 0], self._inputs[:, 1] = pull, lateral_pull
        if sheath_bend is not None:
            self._inputs[:, 2] = sheath_bend
        if not np.isfinite(self._inputs[:, :2]).all():
            wrong = self._inputs[:, :2][~np.isfinite(self._inputs[:, :2])][0]
            raise InputError(f"commanded pulling distance {wrong}: must be a finite number")
        if self._inputs[:, 1].any() and self.presets[0].bending_planes == 1:
            name, wrong = self.presets[0].name, self._inputs[:, 1].max()
            raise InputError(f"lateral pull of {wrong:g} m: {name!r} has one bending plane")
        bend = self._inputs[:, 2]
        if not (np.isfinite(bend) & (bend >= 0)).all():
            raise InputError(f"sheath bend of {bend.min()} rad: must be finite and not negative")
        advance(self.parameters, self.state, self._inputs, self._periods, 0, len(self.presets))
        return self.bend()

    @property
    def converged(self) -> NDArray[np.bool_]:
        """(M,) whether each endoscope has been in equilibrium at every sample so far."""
        within: NDArray[np.bool_] = self.state.missing <= MISSING_LIMIT_N
        return within

    def bend(self) -> Array:
        """Return the bending angle in the plane of wires a and b, (M,) [rad]."""
        return self._bends()[:, 0]

    def lateral_bend(self) -> Array:
        """Return the bending angle in the plane of wires c and d, (M,) [rad]; 0 with one plane."""
        bends = self._bends()
        return bends[:, 1] if bends.shape[1] == 2 else np.zeros(len(bends))

    def wire_tension_and_slack(self) -> tuple[Array, Array]:
        """Return tension [N] and slack [m] of each wire segment, both (M, wires, elements + 1)."""
        state = self.state
        return tension_and_slack(self.parameters, state.element, state.hinge, state.pulley)

    def sheath_friction(self) -> Array:
        """Return the breakaway friction force of each sheath element [N], (M, wires, elements)."""
        drift = np.array([friction_drift(self.parameters, self.state, m) for m in range(len(self.presets))])
        tension, _ = self.wire_tension_and_slack()
        return sheath_friction(self.parameters, tension, self.state.command[:, 2], drift)

    def save_state(self) -> ReducedState:
        """Return the complete state, friction memory included."""
        return copy.deepcopy(self.state)

    def restore_state(self, state: ReducedState) -> None:
        """Restore a saved state of endoscopes of the same layout; the run continues bit for bit.

        Raises:
            ValueError: the state is of another number or layout of endoscopes.
        """
        arrays: dict[str, Array] = self.state._asdict()
        for name, own in arrays.items():
            shape = getattr(state, name).shape
            if shape != own.shape:
                raise InputError(f"a state with {name} of shape {shape} does not fit: must be {own.shape}")
        for name, own in arrays.items():
            own[...] = getattr(state, name)
        self._inputs[:] = self.state.command

    def _bends(self) -> Array:
        bends: Array = (self.state.hinge * self.parameters.size).sum(axis=2)
        return bends


class ReducedEndoscope:
    """One reduced twin, driven by control periods, with the readings of the MuJoCo twin's `Endoscope`."""

    def __init__(self, preset: Preset) -> None:
        """Build the endoscope of a preset, straight and at rest."""
        self.preset = preset
        self._twins = ReducedTwins([preset])
        groups = [np.full(len(group), index) for index, group in enumerate(hinge_groups(preset.vertebrae))]
        self._group_of = np.concatenate(groups)

    @classmethod
    def from_preset(cls, preset: Preset) -> "ReducedEndoscope":
        """Build the endoscope of a preset, straight and at rest."""
        return cls(preset)

    def advance(self, pull: float, lateral_pull: float = 0.0, sheath_bend: float | None = None) -> None:
        """Advance the endoscope by one control period.

        Args:
            pull: commanded pulling distance of wire a at the end of the period [m].
            lateral_pull: the same of wire c; it needs two bending planes.
            sheath_bend: angle that the sheath is bent by from now on [rad]; as before where not given.

        Raises:
            ValueError: a command is not finite, the sheath's bend is negative, or there is no second plane.
            FloatingPointError: it did not converge to equilibrium.
        """
        self._twins.step(pull, lateral_pull, sheath_bend)
        if not self._twins.converged[0]:
            raise not_converged(self.preset, float(self._twins.state.missing[0]))

    def bend(self) -> float:
        """Return the bending angle of the tip in the plane of wires a and b [rad]: the sum of all hinges."""
        return float(self._twins.bend()[0])

    def lateral_bend(self) -> float:
        """Return the bending angle of the tip in the plane of wires c and d [rad]; 0 with one plane."""
        return float(self._twins.lateral_bend()[0])

    def joint_angle(self) -> Array:
        """Return the hinge angles in the plane of wires a and b, base to tip (vertebrae,) [rad]."""
        angle: Array = self._twins.state.hinge[0, 0][self._group_of]
        return angle

    def lateral_joint_angle(self) -> Array:
        """Return the hinge angles in the plane of wires c and d, (vertebrae,) [rad]; empty with one plane."""
        lateral: Array = self._twins.state.hinge[0, 1:, self._group_of].reshape(-1)
        return lateral

    def pull(self) -> float:
        """Return the distance by which the pulley has pulled wire a [m]."""
        return float(self._twins.state.pulley[0, 0])

    def wire_tension(self) -> Array:
        """Return the tension of each wire segment, pulley to tip (wires, elements + 1) [N]; 0 where slack."""
        tension: Array = self._twins.wire_tension_and_slack()[0][0]
        return tension

    def wire_slack(self) -> Array:
        """Return the slack of each wire segment, (wires, elements + 1) [m]; 0 where taut."""
        slack: Array = self._twins.wire_tension_and_slack()[1][0]
        return slack

    def sheath_friction(self) -> Array:
        """Return the breakaway friction force of each sheath element, (wires, elements) [N]."""
        friction: Array = self._twins.sheath_friction()[0]
        return friction

    def save_state(self) -> ReducedState:
        """Return the complete state, friction memory included."""
        return self._twins.save_state()

    def restore_state(self, state: ReducedState) -> None:
        """Restore a saved state of an endoscope of the same preset; the run continues bit for bit.

        Raises:
            ValueError: the state is of an endoscope of another size.
        """
        self._twins.restore_state(state)


def not_converged(preset: Preset, missing: float) -> DivergedError:
    """Return the error for an endoscope that found no equilibrium."""
    how_far = f"{missing:g} N are missing" if math.isfinite(missing) else "a force is no number"
    return DivergedError(f"the reduced twin of {preset.name!r} found no equilibrium: {how_far}")
