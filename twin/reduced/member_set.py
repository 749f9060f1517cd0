"""Members: the twins that an estimator predicts by, some of them in a sheath that is bent on by and by.

A sheath moves while an endoscope is pushed on, and nobody measures it. Members whose sheaths stay as they are
say nothing of that; those of some sheaths that move, each at a pace of its own, are directions in which the
weights of an ensemble can follow.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.shown import shown
from twin.preset.preset import Preset, parameter_limits
from twin.preset.randomization import NEVER_DRAWN
from twin.reduced.parameters import refuse_gravity

Array = NDArray[np.float64]
LEAST_PERIOD_S = 1e-3  # control period of members: a shorter one would hold every sample up


class MemberSet(NamedTuple):
    """M twins, and how far the sheath of each is bent as time goes by: there and back again, at one pace.

    Attributes:
        presets: their parameters; the bend of the sheath is that at one end of its course.
        other: (M,) bend of the sheath at the other end [rad].
        period: (M,) time there and back [s].
        phase: (M,) share of the period that has gone at the start.
    """

    presets: tuple[Preset, ...]
    other: Array
    period: Array
    phase: Array

    @classmethod
    def still(cls, presets: Sequence[Preset]) -> Self:
        """Return twins in sheaths that stay as they are."""
        count = len(presets)
        own = np.array([preset.sheath_bend for preset in presets])
        return cls(tuple(presets), own, np.ones(count), np.zeros(count))

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
        return [
            preset.replace(sheath_bend=float(bend)) for preset, bend in zip(self.presets, bends, strict=True)
        ]


NO_MEMBERS = MemberSet.still(())


def members_to_dict(members: MemberSet) -> dict[str, Any]:
    """Return members as a trained file holds them: one preset, what differs, and how sheaths move."""
    values = [preset.to_dict() for preset in members.presets]
    varied = [name for name in values[0] if any(of[name] != values[0][name] for of in values)]
    held = {
        "preset": {name: value for name, value in values[0].items() if name not in varied},
        "drawn": {name: [of[name] for of in values] for name in varied},
    }
    if members.moves:
        held["sheath"] = {
            "other": members.other.tolist(),
            "period": members.period.tolist(),
            "phase": members.phase.tolist(),
        }
    return held


def members_from_dict(values: Any) -> MemberSet:
    """Return the members of what `members_to_dict` returned.

    Raises:
        ValueError: it is something else, or a value cannot be.
    """
    # Here, so that a table of methods needs none of it.
    from twin.files.json_text import validated
    from twin.files.trained_schema import MOST_MEMBERS, MembersFile
    from twin.preset.file import preset_of

    if not isinstance(values, Mapping):
        raise InputError(f"members = {shown(values)}: must be their preset and what differs")
    file = validated(MembersFile, values)
    counts = {len(drawn) for drawn in file.drawn.values()}
    if file.sheath is not None:
        counts |= {len(of) for of in (file.sheath.other, file.sheath.period, file.sheath.phase)}
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
    if file.sheath is None:
        return MemberSet.still(presets)
    least, most = parameter_limits("sheath_bend")
    if not all(least <= bend <= most for bend in file.sheath.other):
        raise InputError(f"members: bends of their sheaths must be within [{least:g}, {most:g}] rad")
    course = (np.array(of, float) for of in (file.sheath.other, file.sheath.period, file.sheath.phase))
    return MemberSet(presets, *course)


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
