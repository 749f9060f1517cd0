"""Training records of RAM (twins): commands, the members along them, and other twins that are the truth."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import DivergedError
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced import simulate_batch
from twin.reduced.members import MemberSet
from twin.signals.excitation import SIGNALS, command
from twin.signals.streams import SeedUse, random_stream

Array32 = NDArray[np.float32]

SAMPLE_TIME = 0.02
"""Between two samples of a training record [s]; coarser sampling thins it."""
STROKE_MM = (-4.0, 4.0)
"""Of the commands, where none is asked for [mm]."""
_NARROWEST = 1 / 8  # width of a stroke, as a share of the widest
_WIDER = 1.3  # times the ranges: what a fourth of the twins is drawn from
_SPARE = 1  # twins beyond those that are asked for
_LONGEST = 3600.0  # time that these have moved for when a record begins [s]
_MOVING = 0.35  # share of twins whose sheath is bent on during the record


class TwinRecords(NamedTuple):
    """C commands, M members and K twins along each, sampled at `SAMPLE_TIME`.

    Attributes:
        pull_mm: (C, N) command [mm].
        members_deg: (C, M, N) angle of the members [deg].
        truth_deg: (C, K, N) angle of the twins that are estimated [deg].
    """

    pull_mm: Array32
    members_deg: Array32
    truth_deg: Array32


def simulate_records(
    preset: Preset,
    ranges: Ranges,
    members: MemberSet,
    *,
    commands: int,
    twins: int,
    seconds: float,
    stroke_mm: tuple[float, float] = STROKE_MM,
    seed: int,
    on_progress: Callable[[int, int], None] | None = None,
) -> TwinRecords:
    """Simulate training records by the reduced twin.

    Args:
        preset: what does not vary.
        ranges: what does; a fourth of the twins is drawn from wider ones.
        members: twins that a prediction is made of.
        commands: C, one kind of signal after the other.
        twins: K along each command, a third of them with a sheath that is bent on meanwhile.
        seconds: length of a record.
        stroke_mm: that commands lie within, on strokes of any width and place.
        seed: of commands and twins.
        on_progress: told how many of how many commands are done.

    Raises:
        FloatingPointError: a simulation did not converge.
    """
    kinds, wide = list(SIGNALS), ranges.wider(_WIDER)
    pulls, bends, count = [], [], len(members.presets)
    for number in range(commands):
        rng = random_stream(seed, SeedUse.TWINS_COMMANDS, number)
        pull = command(kinds[number % len(kinds)], _stroke(stroke_mm, rng), seconds, SAMPLE_TIME, rng)
        presets, sheath_bends = _members_along(
            members, len(pull), random_stream(seed, SeedUse.TWINS_BEGINS, number)
        )
        # Drawn from wider ranges, a twin may find no equilibrium: the first that do are taken.
        for place in range(twins + _SPARE):
            rng = random_stream(seed, SeedUse.TWINS_TRUTHS, number, place)
            drawn, other = ((wide if place % 4 == 0 else ranges).draw(preset, rng) for _ in range(2))
            moves = rng.uniform() < _MOVING
            presets.append(drawn)
            sheath_bends.append(
                np.linspace(drawn.sheath_bend, other.sheath_bend, len(pull)) if moves else None
            )
        # One command at a time: a whole record holds a hundred times what is kept of it.
        episodes = simulate_batch(presets, [pull] * len(presets), SAMPLE_TIME, sheath_bends=sheath_bends)
        angles = [episode.truth_deg.astype(np.float32) for episode in episodes if episode is not None]
        if any(episode is None for episode in episodes[:count]) or len(angles) < count + twins:
            raise DivergedError(f"twins along training command {number} found no equilibrium")
        pulls.append(pull)
        bends.append(angles[: count + twins])
        if on_progress:
            on_progress(number + 1, commands)
    bend = np.array(bends)
    return TwinRecords(np.array(pulls, np.float32) * 1e3, bend[:, :count], bend[:, count:])


def _members_along(
    members: MemberSet, samples: int, rng: np.random.Generator
) -> tuple[list[Preset], list[NDArray[np.float64] | None]]:
    """Return presets and sheaths of the members along a record that begins at any time of their courses."""
    if not members.moves:
        return list(members.presets), [None] * len(members.presets)
    begun = members.later(rng.uniform(0.0, _LONGEST))
    course = begun.sheath_bend(np.arange(samples, dtype=np.float64)[:, None] * SAMPLE_TIME)
    moves = np.ptp(course, axis=0) > 0
    return begun.at_start(), [course[:, place] if moves[place] else None for place in range(len(moves))]


def _stroke(limits_mm: tuple[float, float], rng: np.random.Generator) -> tuple[float, float]:
    """Return a stroke [m] of any width and place within limits."""
    low, high = limits_mm
    width = (high - low) * float(np.exp(rng.uniform(np.log(_NARROWEST), 0)))
    middle = (low + high) / 2 + rng.uniform(-1, 1) * (high - low - width) / 2
    return (middle - width / 2) * 1e-3, (middle + width / 2) * 1e-3
