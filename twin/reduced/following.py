"""Twins that follow the commands of a batch of filters: filters of one command share the twins of it."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.shown import shown
from twin.preset.file import preset_of
from twin.preset.preset import Preset
from twin.preset.randomization import NEVER_DRAWN
from twin.reduced.parameters import refuse_gravity
from twin.reduced.state import ReducedState
from twin.reduced.twins import ReducedTwins
from twin.signals.excitation import approach

Array = NDArray[np.float64]
LEAST_PERIOD_S = 1e-3  # control period of members: a shorter one would hold every sample up


class Following(NamedTuple):
    """Members along the commands of B filters.

    Attributes:
        twins: state of the M members along each of G commands.
        command: (B,) number of the command that each filter follows.
        bend_deg: (G, M) angle of the members there [deg].
    """

    twins: tuple[ReducedState, ...]
    command: NDArray[np.int64]
    bend_deg: Array

    def of_filters(self) -> Array:
        """Return the (B, M) angle of the members that each filter has [deg]."""
        return self.bend_deg[self.command]


class Members:
    """M reduced twins that are stepped along any number of commands, with one command's memory at a time."""

    def __init__(self, presets: Sequence[Preset], sample_time: float) -> None:
        """Build the twins.

        Raises:
            ValueError: they differ in layout, or the sample time does not fit their control period.
        """
        self.sample_time = sample_time
        self._twins = ReducedTwins(presets, sample_time)
        self._zero_mm = presets[0].command_zeros[0] * 1e3
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
        return Following(tuple(states), command.reshape(-1).astype(np.int64), np.array(bends))

    def step(self, following: Following, pull_mm: Array) -> Following:
        """Return the members one sample later, at the pulls (B,) [mm] of their filters.

        Filters that part from each other have members of their own from there on.
        """
        states: list[ReducedState] = []
        bends: list[Array] = []
        command = np.empty_like(following.command)
        for number, state in enumerate(following.twins):
            mine = np.flatnonzero(following.command == number)
            for pull in np.unique(pull_mm[mine]):
                self._twins.restore_state(state)
                bend = np.degrees(self._twins.step(pull * 1e-3))
                # A member that found no equilibrium says nothing: the step is refused, not believed.
                bends.append(np.where(self._twins.converged, bend, np.nan))
                command[mine[pull_mm[mine] == pull]] = len(states)
                states.append(self._twins.save_state())
        return Following(tuple(states), command, np.array(bends))

    def bends_along(self, following: Following, pull_mm: Array, samples: NDArray[np.int64]) -> Array:
        """Return the angles (N, M) [deg] along a way of the command; nothing moves.

        Args:
            following: members along one command.
            pull_mm: (N,) pulls, one after the other, along straight lines [mm].
            samples: (N,) time that each takes.
        """
        self._twins.restore_state(following.twins[0])
        ways = zip(pull_mm, samples, strict=True)
        bends: Array = np.degrees([self._twins.step(pull * 1e-3, samples=int(took)) for pull, took in ways])
        return bends

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
        pull, _ = self._twins.common_pull(weights, float(np.radians(bend_deg)), (low * 1e-3, high * 1e-3))
        return pull * 1e3


def members_to_dict(presets: Sequence[Preset]) -> dict[str, Any]:
    """Return members as a trained file holds them: one preset, and what differs from member to member."""
    values = [preset.to_dict() for preset in presets]
    varied = [name for name in values[0] if any(of[name] != values[0][name] for of in values)]
    return {
        "preset": {name: value for name, value in values[0].items() if name not in varied},
        "drawn": {name: [of[name] for of in values] for name in varied},
    }


def members_from_dict(values: Any) -> tuple[Preset, ...]:
    """Return the members of what `members_to_dict` returned.

    Raises:
        ValueError: it is something else, or a value cannot be.
    """
    # Here, so that a table of methods needs none of it.
    from twin.files.schema import validated
    from twin.files.trained_schema import MOST_MEMBERS, MembersFile

    if not isinstance(values, Mapping):
        raise InputError(f"members = {shown(values)}: must be their preset and what differs")
    file = validated(MembersFile, values)
    counts = {len(drawn) for drawn in file.drawn.values()}
    if len(counts) != 1:
        raise InputError(f"members: must be from 2 to {MOST_MEMBERS}, each with a value of all that differs")
    if fixed := [name for name in file.drawn if name in NEVER_DRAWN]:
        raise InputError(f"members: {', '.join(fixed)} must be the same for all")
    shared = preset_of("members", file.preset)
    presets = tuple(
        shared.replace(**{name: drawn[number] for name, drawn in file.drawn.items()})
        for number in range(counts.pop())
    )
    check_members(presets)
    return presets


def check_members(presets: Sequence[Preset]) -> None:
    """Refuse members that reduced twins cannot be, or that would take hours for a sample.

    Raises:
        ValueError: they have two bending planes or gravity, or a control period below 1 ms.
    """
    for preset in presets:
        if preset.bending_planes != 1:
            raise InputError(
                f"{preset.name!r} has two bending planes: RAM (twins) estimates the angle of one"
            )
        refuse_gravity(preset)
        if preset.control_period < LEAST_PERIOD_S:
            raise InputError(
                f"control_period = {preset.control_period:g} s: must be at least {LEAST_PERIOD_S:g} s"
            )
