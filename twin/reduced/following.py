"""Twins that follow the commands of a batch of filters: filters of one command share the twins of it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.reduced.member_set import MemberSet
from twin.reduced.state import ReducedState
from twin.reduced.twins import ReducedTwins
from twin.signals.excitation import approach

Array = NDArray[np.float64]


class Following(NamedTuple):
    """Members along the commands of B filters.

    Attributes:
        twins: state of the M members along each of G commands.
        command: (B,) number of the command that each filter follows.
        bend_deg: (G, M) angle of the members there [deg].
        time: since the first sample [s].
    """

    twins: tuple[ReducedState, ...]
    command: NDArray[np.int64]
    bend_deg: Array
    time: float

    def of_filters(self) -> Array:
        """Return the (B, M) angle of the members that each filter has [deg]."""
        return self.bend_deg[self.command]


class Members:
    """M reduced twins that are stepped along any number of commands, with one command's memory at a time."""

    def __init__(self, members: MemberSet, sample_time: float) -> None:
        """Build the twins.

        Raises:
            ValueError: they differ in layout, or the sample time does not fit their control period.
        """
        self.sample_time = sample_time
        self._members, self._moves = members, members.moves
        self._twins = ReducedTwins(members.at_start(), sample_time)
        self._zero_mm = members.presets[0].command_zeros[0] * 1e3
        self._at_rest = self._twins.save_state()

    def start(self, pull_mm: Array) -> Following:
        """Return the members of B filters at their first pull (B,) [mm], to which they go from rest."""
        pulls, command = np.unique(pull_mm, return_inverse=True)
        states, bends = [], []
        for pull in pulls:
            self._twins.restore_state(self._at_rest)
            for on_the_way in approach((pull - self._zero_mm) * 1e-3, self.sample_time):
                self._twins.step(on_the_way + self._zero_mm * 1e-3)
            states.append(self._twins.save_state())
            bends.append(np.degrees(self._twins.bend()))
        return Following(tuple(states), command.reshape(-1).astype(np.int64), np.array(bends), 0.0)

    def step(self, following: Following, pull_mm: Array) -> Following:
        """Return the members one sample later, at the pulls (B,) [mm] of their filters.

        Filters that part from each other have members of their own from there on.
        """
        states: list[ReducedState] = []
        bends: list[Array] = []
        command = np.empty_like(following.command)
        time = following.time + self.sample_time
        sheath = self._sheath_bend(time)
        for number, state in enumerate(following.twins):
            mine = np.flatnonzero(following.command == number)
            for pull in np.unique(pull_mm[mine]):
                self._twins.restore_state(state)
                bend = np.degrees(self._twins.step(pull * 1e-3, sheath_bend=sheath))
                # A member that found no equilibrium says nothing: the step is refused, not believed.
                bends.append(np.where(self._twins.converged, bend, np.nan))
                command[mine[pull_mm[mine] == pull]] = len(states)
                states.append(self._twins.save_state())
        return Following(tuple(states), command, np.array(bends), time)

    def bends_along(self, following: Following, pull_mm: Array, samples: NDArray[np.int64]) -> Array:
        """Return the angles (N, M) [deg] along a way of the command; nothing moves.

        Args:
            following: members along one command.
            pull_mm: (N,) pulls, one after the other, along straight lines [mm].
            samples: (N,) time that each takes.
        """
        self._twins.restore_state(following.twins[0])
        bends, time = [], following.time
        for pull, took in zip(pull_mm, samples, strict=True):
            time += int(took) * self.sample_time
            sheath = self._sheath_bend(time)
            bends.append(self._twins.step(pull * 1e-3, sheath_bend=sheath, samples=int(took)))
        return np.degrees(bends)

    def _sheath_bend(self, time: float) -> Array | None:
        """Return the bend of the members' sheaths at a time [rad]; None where none moves."""
        return self._members.sheath_bend(time) if self._moves else None

    def common_pull_mm(
        self, following: Following, weights: Array, bend_deg: float, within_mm: tuple[float, float]
    ) -> float:
        """Return the pull [mm] of the next sample that brings a weighted sum of the members' bends.

        Args:
            following: members along one command.
            weights: (M,) of the bend of each.
            bend_deg: wanted sum; no pull, NaN, is returned where it is not finite [deg].
            within_mm: lowest and highest pull; the end that is nearer, where none brings it [mm].
        """
        if not math.isfinite(bend_deg):
            return math.nan
        self._twins.restore_state(following.twins[0])
        low, high = within_mm
        sheath = self._sheath_bend(following.time + self.sample_time)
        pull, _ = self._twins.common_pull(
            weights, float(np.radians(bend_deg)), (low * 1e-3, high * 1e-3), sheath_bend=sheath
        )
        return pull * 1e3
