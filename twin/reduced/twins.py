"""Reduced twins that are advanced sample by sample: for ensembles, controllers and estimators online."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.mechanics.compiled import bound
from twin.mechanics.friction import friction_drift
from twin.preset.preset import Preset
from twin.preset.sample_time import check_sample_time
from twin.reduced.advance import advance
from twin.reduced.inverse import Inverse, find_common_pull, find_pulls, new_inverse
from twin.reduced.parameters import Parameters, parameters_of
from twin.reduced.readings import sheath_friction, tension_and_slack
from twin.reduced.rest import state_at_rest
from twin.reduced.state import MISSING_LIMIT_N, ReducedState
from twin.reduced.workspace import new_workspace

Array = NDArray[np.float64]

TOLERANCE = np.radians(0.01)
"""Distance from the wanted bend that an inverse may leave [rad]."""


class ReducedTwins:
    """M endoscopes in quasi-static equilibrium, advanced together; the whole state is plain arrays.

    Attributes:
        presets: their parameters.
    """

    def __init__(self, presets: Sequence[Preset], sample_time: float | None = None) -> None:
        """Build endoscopes that are at rest.

        Args:
            presets: M endoscopes with equal numbers of planes, vertebrae and elements and equal control
                periods.
            sample_time: between two samples [s], a whole multiple of the control period; without it, one.

        Raises:
            ValueError: they differ in layout, gravity pulls at one, or the sample time does not fit.
        """
        self.presets = list(presets)
        self._parameters = parameters_of(presets)
        self._periods = 1 if sample_time is None else check_sample_time(self.presets[0], sample_time)
        self._state = state_at_rest(self.presets, self.parameters)
        self._inputs = self.state.command.copy()
        work, inputs, periods = new_workspace(self.parameters), self._inputs, self._periods
        self._advance = bound(advance, self.parameters, self.state, work, inputs)
        trial = self.parameters, self.state, self.save_state(), work, inputs, periods
        self._find_pulls = bound(find_pulls, *trial, np.ones(1))
        self._find_common_pull = bound(find_common_pull, *trial)

    @property
    def parameters(self) -> Parameters:
        """Parameters of the endoscopes, as the kernels take them."""
        return self._parameters

    @property
    def state(self) -> ReducedState:
        """State of the endoscopes; its arrays may be written."""
        return self._state

    def reset(self) -> None:
        """Reset all endoscopes to rest, with new sheaths; drives and wear are reset too."""
        self.restore_state(state_at_rest(self.presets, self.parameters))

    def step(
        self,
        pull: ArrayLike,
        lateral_pull: ArrayLike = 0.0,
        sheath_bend: ArrayLike | None = None,
        *,
        samples: int = 1,
    ) -> Array:
        """Advance all endoscopes by one sample, or several, along straight lines from the inputs before.

        Args:
            pull: commanded pulling distance of wire a at the end of the sample [m], one or (M,).
            lateral_pull: the same of wire c; it needs two bending planes.
            sheath_bend: angle that the sheath is bent by then [rad]; as before where not given.
            samples: time that it takes.

        Returns:
            (M,) bending angle [rad].

        Raises:
            ValueError: an input is not finite, the sheath's bend is negative, or there is no second plane.
        """
        self._set_inputs(pull, lateral_pull, sheath_bend)
        self._advance(samples * self._periods)
        return self.bend()

    def _set_inputs(self, pull: ArrayLike, lateral_pull: ArrayLike, sheath_bend: ArrayLike | None) -> None:
        """Set and check the inputs at the end of the next sample; see `step`."""
        self._inputs[:, 0], self._inputs[:, 1] = pull, lateral_pull
        self._inputs[:, 2] = self.state.command[:, 2] if sheath_bend is None else sheath_bend
        if not np.isfinite(self._inputs[:, :2]).all():
            wrong = self._inputs[:, :2][~np.isfinite(self._inputs[:, :2])][0]
            raise InputError(f"commanded pulling distance {wrong}: must be a finite number")
        if self._inputs[:, 1].any() and self.presets[0].bending_planes == 1:
            name, wrong = self.presets[0].name, self._inputs[:, 1].max()
            raise InputError(f"lateral pull of {wrong:g} m: {name!r} has one bending plane")
        bend = self._inputs[:, 2]
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
    ) -> Inverse:
        """Return the pulls that bring given bends at the end of the next sample; nothing moves.

        Drives take part: a servo that cannot be there in time does not reach the bend.

        Args:
            bend: wanted in the plane of wires a and b [rad], one or (M,).
            lateral_bend: the same of wires c and d; without it, their pull stays as it is.
            stroke: lowest and highest pull of wire a [m].
            lateral_stroke: the same of wire c; without it, `stroke`.
            sheath_bend: angle that the sheath is bent by then [rad]; as before where not given.
            tolerance: of the bend [rad].

        Returns:
            Pulls, the bends that they bring, and whether those are the ones wanted.

        Raises:
            ValueError: a value is not finite, a stroke is empty, the tolerance is not positive, or there is
                no second plane.
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
            raise InputError(
                f"stroke {limits.tolist()} m: must be finite, the lowest pull before the highest"
            )
        if not tolerance > 0:
            raise InputError(f"tolerance = {tolerance:g} rad: must be positive")
        found = new_inverse(*target.shape)
        self._find_pulls(target, limits, float(tolerance), found)
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
        """Return the one pull of all endoscopes that brings a weighted sum of their bends; nothing moves.

        Args:
            weights: (M,) of the bend of each.
            bend: wanted sum at the end of the next sample [rad].
            stroke: lowest and highest pull of wire a [m].
            sheath_bend: of each endoscope at the end of the sample [rad]; as it is, if not given.
            tolerance: of the sum [rad].

        Returns:
            The pull [m], and the sum that it brings [rad]. Where the stroke does not lead there, its end that
            is nearer: endoscopes that stick move only after a longer way.

        Raises:
            ValueError: the wanted sum is not finite.
        """
        if not np.isfinite(bend):
            raise InputError(f"wanted bend of {bend} rad: must be a finite number")
        self._set_inputs(self.state.command[:, 0], self.state.command[:, 1], sheath_bend)
        found = np.empty(4)
        shares, limits = np.asarray(weights, dtype=float), np.array(stroke, dtype=float)
        self._find_common_pull(shares, float(bend), limits, float(tolerance), found)
        return float(found[0]), float(found[1])

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
        own, state = self.parameters, self.state
        drift = friction_drift(own.warm_up, own.warm_up_time, own.wear, state.time, state.travel)
        tension, _ = self.wire_tension_and_slack()
        return sheath_friction(own, tension, state.command[:, 2], drift)

    def save_state(self) -> ReducedState:
        """Return the complete state, friction memory included."""
        return ReducedState._make(values.copy() for values in self.state)

    def restore_state(self, state: ReducedState) -> None:
        """Restore a saved state of endoscopes of the same layout; the run continues bit for bit.

        Raises:
            ValueError: the state is of another number or layout of endoscopes, or of another twin.
        """
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
