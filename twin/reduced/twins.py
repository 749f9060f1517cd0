"""Reduced twins that are advanced sample by sample: for ensembles, controllers and estimators online.

Kernels are imported where twins are built: Numba takes half a second to load.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.mechanics.friction import friction_drift, group_of_hinge
from twin.preset.preset import Preset, at_sample_time, check_sample_time
from twin.reduced.parameters import (
    MISSING_LIMIT_N,
    WARM_UP,
    WARM_UP_TIME,
    WEAR,
    ReducedState,
    not_converged,
    parameters_of,
    sheath_friction,
    tension_and_slack,
)

if TYPE_CHECKING:
    from twin.reduced.inverse import Inverse, Trial

Array = NDArray[np.float64]

TOLERANCE = np.radians(0.01)  # distance from the wanted bend that an inverse may leave [rad]


class ReducedTwins:
    """M endoscopes in quasi-static equilibrium, advanced together; the complete state is plain arrays."""

    def __init__(self, presets: Sequence[Preset], sample_time: float | None = None) -> None:
        """Build M endoscopes of one layout that are at rest.

        A sample is one control period if its time [s] is not given; see `at_sample_time`.
        """
        from twin.reduced.advance import Trace, Workspace, state_at_rest

        if sample_time is not None:
            presets = [at_sample_time(preset, sample_time) for preset in presets]
        self.presets = list(presets)
        self.parameters = parameters_of(presets)  # as the kernels take them
        self._periods = 1 if sample_time is None else check_sample_time(self.presets[0], sample_time)
        self.state = state_at_rest(self.presets, self.parameters)  # its arrays may be written
        self._trial_state, self._work = self.save_state(), Workspace.of(self.parameters)
        self._no_trace = Trace.of(self.parameters, 0)
        self._inputs = self.state.command.copy()

    def reset(self) -> None:
        """Reset all endoscopes to rest, with new sheaths; drives and wear are reset too."""
        from twin.reduced.advance import state_at_rest

        self.restore_state(state_at_rest(self.presets, self.parameters))

    def step(
        self,
        pull: ArrayLike,
        lateral_pull: ArrayLike = 0.0,
        sheath_bend: ArrayLike | None = None,
        *,
        samples: int = 1,
        periods: int | None = None,
    ) -> Array:
        """Advance all along straight lines from the inputs before; return the bending angle (M,) [rad].

        The inputs, one or (M,), are those at the end of the sample, or of several: pulling distances [m], of
        wire c with two bending planes, and bend of the sheath [rad]; as before where not given. Where a
        number of control periods is given, they are those at its end.
        """
        from twin.reduced.advance import advance

        self._set_inputs(pull, lateral_pull, sheath_bend)
        taken = np.array([samples * self._periods if periods is None else periods])
        state, inputs = self.state, self._inputs[None]
        advance(self.parameters, state, self._work, 0, inputs, taken, self._no_trace)
        return self.bend()

    def _set_inputs(self, pull: ArrayLike, lateral_pull: ArrayLike, sheath_bend: ArrayLike | None) -> None:
        """Set and check the inputs at the end of the next sample; see `step`."""
        inputs = self._inputs
        inputs[:, 0], inputs[:, 1] = pull, lateral_pull
        inputs[:, 2] = self.state.command[:, 2] if sheath_bend is None else sheath_bend
        pulls, bend = inputs[:, :2], inputs[:, 2]
        if not np.isfinite(pulls).all():
            wrong = pulls[~np.isfinite(pulls)][0]
            raise InputError(f"commanded pulling distance {wrong}: must be a finite number")
        if inputs[:, 1].any() and self.presets[0].bending_planes == 1:
            name, wrong = self.presets[0].name, inputs[:, 1].max()
            raise InputError(f"lateral pull of {wrong:g} m: {name!r} has one bending plane")
        if not (np.isfinite(bend) & (bend >= 0)).all():
            raise InputError(f"sheath bend of {bend.min()} rad: must be finite and not negative")

    def inverse(
        self,
        bend: ArrayLike,
        lateral_bend: ArrayLike | None = None,
        *,
        stroke: tuple[float, float],
        lateral_stroke: tuple[float, float] | None = None,
        sheath_bend: ArrayLike | None = None,
        tolerance: float = TOLERANCE,
    ) -> "Inverse":
        """Return the pulls that bring given bends at the end of the next sample; nothing moves.

        Drives take part: a servo that cannot be there in time does not reach the bend. Wanted bends are one
        or (M,) [rad]; without a lateral one, the pull of wire c stays as it is. A stroke is the lowest and
        highest pull [m].
        """
        planes = self.presets[0].bending_planes
        self._set_inputs(self.state.command[:, 0], self.state.command[:, 1], sheath_bend)
        if lateral_bend is not None and planes == 1:
            raise InputError(f"a lateral bend: {self.presets[0].name!r} has one bending plane, it needs two")
        target = np.full((len(self.presets), planes), np.nan)
        for plane, wanted in enumerate((bend, lateral_bend)[:planes]):
            if wanted is not None:
                target[:, plane] = wanted
                if not np.isfinite(target[:, plane]).all():
                    raise InputError(f"wanted bend of {target[:, plane].max()} rad: must be a finite number")
        limits = np.array([stroke, lateral_stroke or stroke][:planes], dtype=float)
        if not (np.isfinite(limits).all() and (limits[:, 0] < limits[:, 1]).all()):
            rule = "must be finite, the lowest pull before the highest"
            raise InputError(f"stroke {limits.tolist()} m: {rule}")
        if not tolerance > 0:
            raise InputError(f"tolerance = {tolerance:g} rad: must be positive")
        from twin.reduced.inverse import Inverse, find_pulls

        shape = target.shape
        found = Inverse(np.empty(shape), np.empty(shape), np.empty((*shape, 2)), np.zeros(shape[0], bool))
        find_pulls(self._trial(np.ones(1)), target, limits, float(tolerance), found)
        return found

    def common_pull(
        self,
        weights: Array,
        bend: float,
        stroke: tuple[float, float],
        *,
        sheath_bend: ArrayLike | None = None,
        tolerance: float = TOLERANCE,
    ) -> tuple[float, float]:
        """Return the common pull [m] that brings a weighted sum of the bends, and that sum [rad].

        Nothing moves. Where the stroke does not lead there, it is the nearer end: endoscopes that stick move
        only after a longer travel. Weights are (M,), the sheaths' bends those at the end of the sample [rad].
        """
        if not np.isfinite(bend):
            raise InputError(f"wanted bend of {bend} rad: must be a finite number")
        self._set_inputs(self.state.command[:, 0], self.state.command[:, 1], sheath_bend)
        from twin.reduced.inverse import find_common_pull

        found = np.empty(4)
        trial, limits = self._trial(np.asarray(weights, dtype=float)), np.array(stroke, dtype=float)
        find_common_pull(trial, float(bend), limits, float(tolerance), found)
        return float(found[0]), float(found[1])

    def _trial(self, weights: Array) -> "Trial":
        from twin.reduced.inverse import Trial

        of_twins = self.parameters, self.state, self._trial_state, self._work
        return Trial(*of_twins, self._inputs, self._periods, 0, weights)

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
        of, state = self.parameters.constants.T, self.state
        drift = friction_drift(of[WARM_UP], of[WARM_UP_TIME], of[WEAR], state.time, state.travel)
        tension, _ = self.wire_tension_and_slack()
        return sheath_friction(self.parameters, tension, state.command[:, 2], drift)

    def save_state(self) -> ReducedState:
        """Return the complete state, friction memory included."""
        return ReducedState._make(values.copy() for values in self.state)

    def restore_state(self, state: ReducedState) -> None:
        """Restore a saved state of endoscopes of the same layout; the run continues bit for bit."""
        if not isinstance(state, ReducedState):
            raise InputError(f"a state of reduced twins is needed, this is a {type(state).__name__:.40}")
        fits = len(state.time) == len(self.presets) and state.past.shape == self.state.past.shape
        if not fits or not np.array_equal(state.layout, self.state.layout):
            planes, elements, vertebrae = state.layout
            raise InputError(
                f"a state of {len(state.time)} endoscopes with {planes} planes, {elements} elements, "
                f"{vertebrae} vertebrae and {state.past.shape[2]} late commands does not fit this endoscope"
            )
        for name in state._fields:
            getattr(self.state, name)[...] = getattr(state, name)

    def _bends(self) -> Array:
        bends: Array = (self.state.hinge * self.parameters.size).sum(axis=2)
        return bends


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
        """Advance by one step; the arguments are those of `ReducedTwins.step`.

        Raise `FloatingPointError` where it did not converge to equilibrium.
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
        """Restore a saved state of an endoscope of the same preset; the run continues bit for bit."""
        self.twins.restore_state(state)
