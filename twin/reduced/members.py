"""Members: the twins that an estimator predicts by, some of them in a sheath whose bend changes.

A sheath moves while an endoscope is pushed on, and no sensor measures it. Members with sheaths that move,
each at a pace of its own, are directions in which the weights of an ensemble can follow.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.shown import shown
from twin.preset.preset import Preset, parameter_limits
from twin.preset.randomization import NEVER_DRAWN
from twin.reduced.parameters import ReducedState, refuse_gravity
from twin.reduced.twins import ReducedTwins
from twin.signals.excitation import approach, paths_to

Array = NDArray[np.float64]
TURNS = 2  # that a history has: those before them matter little
SMALLEST_HISTORY = 0.2  # width of a history, as a share of the stroke
LEAST_PERIOD_S = 1e-3  # control period of members: a shorter one would hold every sample up


class MemberSet(NamedTuple):
    """M twins, and how far the sheath of each is bent as time goes by: there and back again, at one pace."""

    presets: tuple[Preset, ...]  # their parameters; the bend of the sheath is that at one end of its course
    other: Array  # (M,) bend of the sheath at the other end [rad]
    period: Array  # (M,) time there and back [s]
    phase: Array  # (M,) share of the period that has gone at the start
    turns_mm: Array  # (M, K) pulls at which each turned before a start of unknown history [mm]

    @classmethod
    def still(cls, presets: Sequence[Preset]) -> Self:
        """Return twins in sheaths that stay as they are."""
        count = len(presets)
        own = np.array([preset.sheath_bend for preset in presets])
        return cls(tuple(presets), own, np.ones(count), np.zeros(count), np.zeros((count, TURNS)))

    @property
    def moves(self) -> bool:
        """True if the sheath of any of them moves."""
        return bool((self.other != self._own).any())

    @property
    def _own(self) -> Array:
        return np.array([preset.sheath_bend for preset in self.presets])

    def sheath_bend(self, time: float | Array) -> Array:
        """Return the bend (M,) of the sheaths at a time [s] after the start [rad]; (N, M) at times (N, 1)."""
        share = np.mod(time / self.period + self.phase, 1.0)
        own = self._own
        bend: Array = own + (self.other - own) * (1 - np.abs(1 - 2 * share))
        return bend

    def later(self, seconds: float) -> Self:
        """Return the same twins, with sheaths that stand at the start where they stood after some time."""
        return self._replace(phase=np.mod(seconds / self.period + self.phase, 1.0))

    def at_start(self) -> list[Preset]:
        """Return the twins with the sheaths that they have at the start."""
        bends = self.sheath_bend(0.0)
        pairs = zip(self.presets, bends.tolist(), strict=True)
        return [preset.replace(sheath_bend=bend) for preset, bend in pairs]


def draw_turns(stroke_mm: tuple[float, float], count: int, rng: np.random.Generator) -> Array:
    """Draw turning points (count, TURNS) of histories within a stroke, of large and small ones [mm]."""
    low, high = stroke_mm
    size = np.exp(rng.uniform(np.log(SMALLEST_HISTORY), 0.0, (count, 1)))
    turns: Array = (low + high) / 2 + size * rng.uniform(-0.5, 0.5, (count, TURNS)) * (high - low)
    return turns


NO_MEMBERS = MemberSet.still(())


def members_to_dict(members: MemberSet) -> dict[str, Any]:
    """Return members as a trained file holds them: one preset, what differs, and how sheaths move."""
    values = [preset.to_dict() for preset in members.presets]
    varied = [name for name in values[0] if any(of[name] != values[0][name] for of in values)]
    held = {
        "preset": {name: value for name, value in values[0].items() if name not in varied},
        "drawn": {name: [of[name] for of in values] for name in varied},
    }
    if members.turns_mm.any():
        held["turns_mm"] = members.turns_mm.tolist()
    if members.moves:
        held["sheath"] = {name: getattr(members, name).tolist() for name in ("other", "period", "phase")}
    return held


def members_from_dict(values: Any) -> MemberSet:
    """Return the members of what `members_to_dict` returned."""
    # Here, so that a table of methods needs none of it.
    from twin.files.json_text import validated
    from twin.files.trained_schema import MOST_MEMBERS, MembersFile
    from twin.preset.file import preset_of

    if not isinstance(values, Mapping):
        raise InputError(f"members = {shown(values)}: must be their preset and what differs")
    file = validated(MembersFile, values)
    course = [] if file.sheath is None else [file.sheath.other, file.sheath.period, file.sheath.phase]
    histories = [] if file.turns_mm is None else [file.turns_mm]
    counts = {*map(len, file.drawn.values()), *map(len, course), *map(len, histories)}
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
    found = MemberSet.still(presets)
    if file.turns_mm is not None:
        found = found._replace(turns_mm=np.array(file.turns_mm, float))
    if file.sheath is None:
        return found
    least, most = parameter_limits("sheath_bend")
    if not all(least <= bend <= most for bend in file.sheath.other):
        raise InputError(f"members: bends of their sheaths must be within [{least:g}, {most:g}] rad")
    other, period, phase = (np.array(of, float) for of in course)
    return found._replace(other=other, period=period, phase=phase)


def check_members(presets: Sequence[Preset]) -> None:
    """Refuse members that reduced twins cannot represent, or that would take hours for a sample."""
    for preset in presets:
        if preset.bending_planes != 1:
            rule = "RAM (twins) estimates the angle of one"
            raise InputError(f"{preset.name!r} has two bending planes: {rule}")
        refuse_gravity(preset)
        if (period := preset.control_period) < LEAST_PERIOD_S:
            raise InputError(f"control_period = {period:g} s: must be at least {LEAST_PERIOD_S:g} s")


class Following(NamedTuple):
    """Members along the commands of B filters."""

    twins: tuple[ReducedState, ...]  # state of the M members along each of G commands
    command: NDArray[np.int64]  # (B,) number of the command that each filter follows
    bend_deg: Array  # (G, M) angle of the members there [deg]
    time: float  # since the first sample [s]
    ahead: float = 0.0  # of the twins' own time, at most half a control period; negative where behind [s]

    def of_filters(self) -> Array:
        """Return the (B, M) angle of the members that each filter has [deg]."""
        return self.bend_deg[self.command]


class Members:
    """M reduced twins that are stepped along any number of commands, with one command's memory at a time."""

    def __init__(self, members: MemberSet, sample_time: float) -> None:
        self.sample_time = sample_time
        self._members, self._moves = members, members.moves
        self._twins = ReducedTwins(members.at_start(), sample_time)
        self._zero_mm = members.presets[0].command_zeros[0] * 1e3
        self._at_rest = self._twins.save_state()

    def start(self, pull_mm: Array, *, from_rest: bool = True) -> Following:
        """Return the members of B filters at their first pull (B,) [mm].

        They go there from rest, or each by way of its own turning points.
        """
        pulls, command = np.unique(pull_mm, return_inverse=True)
        turns = self._members.turns_mm * 1e-3
        states, bends = [], []
        for pull in pulls:
            self._twins.restore_state(self._at_rest)
            there = (pull - self._zero_mm) * 1e-3
            path = approach(there, self.sample_time)[:, None]
            if not from_rest:
                path = paths_to(turns, np.full(len(turns), there), self.sample_time).T
            for on_the_way in path:
                self._twins.step(on_the_way + self._zero_mm * 1e-3)
            states.append(self._twins.save_state())
            bends.append(np.degrees(self._twins.bend()))
        return Following(tuple(states), command.reshape(-1).astype(np.int64), np.array(bends), 0.0)

    def step(self, following: Following, pull_mm: Array, elapsed_s: float | None = None) -> Following:
        """Return the members one sample later, at the pulls (B,) [mm] of their filters.

        Filters that part from each other have members of their own from there on. The time since the last
        sample [s] is the sample time, if not given; another one is stepped in the nearest whole number of
        control periods, and what remains counts at the next sample. Where that number is zero, the angles are
        those of one period, after which the twins stand where they stood.
        """
        states: list[ReducedState] = []
        bends: list[Array] = []
        command = np.empty_like(following.command)
        elapsed = self.sample_time if elapsed_s is None else elapsed_s
        time, period = following.time + elapsed, self._twins.parameters.control_period
        periods = round((elapsed - following.ahead) / period)
        sheath = self._sheath_bend(time)
        for number, state in enumerate(following.twins):
            mine = np.flatnonzero(following.command == number)
            for pull in np.unique(pull_mm[mine]):
                self._twins.restore_state(state)
                bend = np.degrees(self._twins.step(pull * 1e-3, sheath_bend=sheath, periods=max(periods, 1)))
                # A member without equilibrium has no angle: the step is refused.
                bends.append(np.where(self._twins.converged, bend, np.nan))
                command[mine[pull_mm[mine] == pull]] = len(states)
                states.append(self._twins.save_state() if periods else state)
        ahead = following.ahead + periods * period - elapsed
        return Following(tuple(states), command, np.array(bends), time, ahead)

    def bends_along(self, following: Following, pull_mm: Array, samples: NDArray[np.int64]) -> Array:
        """Return the angles (N, M) [deg] along straight lines of the command; nothing moves.

        N pulls [mm] follow one another, each after a number of samples.
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

        It is the nearer end of `within_mm` where none brings it, and NaN where the wanted sum [deg] is not
        finite.
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
