"""Members of RAM (twins): the twins that its prediction is made of.

They are chosen so that their ensemble makes other endoscopes of the ranges likely. An ensemble of M twins
predicts any angle as a normal distribution whose mean and covariance are those of the members along the
commands (Evensen 2003); the M members are chosen such that other endoscopes are likeliest under this
distribution. Members that are drawn, or spread evenly over the ranges of the parameters, leave out a few
endoscopes that move far less than any of them.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rl.twins.records import STROKE_MM
from twin.errors import DivergedError
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges, quantile
from twin.reduced import simulate_batch
from twin.reduced.members import MemberSet, draw_turns
from twin.signals.excitation import SIGNALS, command
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]

CANDIDATES = 8  # endoscopes that a member is chosen from
WIDER = 1.15
"""Factor on the ranges that candidates are spread over. Members at the far ends enclose more endoscopes."""
UNEXPLAINED_DEG = 2.0
"""Error of an angle that the ensemble need not explain; if it is smaller, members crowd where many endoscopes
are."""
COMMANDS = 10  # along which candidates are compared
_SECONDS, _SAMPLE_TIME = 40.0, 0.1  # of each command
_EVERY = 4  # samples; neighbours add little
_DIRECTIONS = 60  # in which candidates are compared, at most
_SWAPS = 100  # that are tried for each member
_PERIODS = (80.0, 240.0)  # of the sheaths of members, there and back [s]: about half a turn in a minute


def draw_members(preset: Preset, ranges: Ranges, count: int, seed: int, moving: int = 0) -> MemberSet:
    """Return twins that are spread evenly over the ranges."""
    shares = _spread(count, len(ranges.limits), random_stream(seed, SeedUse.TWINS_MEMBERS))
    return _in_sheaths([ranges.at(preset, of) for of in shares], preset, ranges, seed, moving)


def choose_members(
    preset: Preset,
    ranges: Ranges,
    count: int,
    seed: int,
    moving: int = 0,
    *,
    stroke_mm: tuple[float, float] = STROKE_MM,
    on_progress: Callable[[int, int], None] | None = None,
) -> MemberSet:
    """Return twins under whose ensemble others of the ranges are likely."""
    drawn = draw_members(preset, ranges.wider(WIDER), CANDIDATES * count, seed).presets
    able, angles = _along_commands(drawn, stroke_mm, seed, on_progress)
    if len(able) < count:
        raise DivergedError(
            f"{len(able)} of {len(drawn)} twins from the ranges found an equilibrium: members = {count}"
        )
    chosen = likeliest_ensemble(angles, count, random_stream(seed, SeedUse.TWINS_CHOICE))
    found = _in_sheaths([able[place] for place in chosen], preset, ranges, seed, moving)
    turns = draw_turns(stroke_mm, count, random_stream(seed, SeedUse.TWINS_HISTORIES))
    return found._replace(turns_mm=turns)


def likeliest_ensemble(angles: Array, count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return the (M,) places of the candidates, of C, under whose ensemble all of them are likely.

    A hundred times over, each member is exchanged for another candidate, drawn at random, if that is a gain
    (after Fedorov 1972, who tries all). Angles are (C, N) [deg].
    """
    apart = angles - angles.mean(axis=0)
    left, singular, _ = np.linalg.svd(apart, full_matrices=False)
    rank = min(_DIRECTIONS, len(singular))
    place = left[:, :rank] * singular[:rank]
    chosen = rng.permutation(len(angles))[:count]
    if count == len(angles):
        return chosen
    unlikely = ensemble_unlikelihood(place[chosen], place)
    for member in np.tile(np.arange(count), _SWAPS):
        trial = chosen.copy()
        trial[member] = rng.choice(np.setdiff1d(np.arange(len(angles)), chosen))
        tried = ensemble_unlikelihood(place[trial], place)
        if tried < unlikely:
            chosen, unlikely = trial, tried
    return chosen


def ensemble_unlikelihood(members: Array, others: Array) -> float:
    """Return minus twice the mean logarithm of the likelihood of others (C, N) [deg], less a constant.

    The distribution is normal, with mean and covariance of the members (M, N), plus `UNEXPLAINED_DEG`.
    """
    mean = members.mean(axis=0)
    off = members - mean
    covariance = off.T @ off / (len(members) - 1) + UNEXPLAINED_DEG**2 * np.eye(members.shape[1])
    root = np.linalg.cholesky(covariance)
    scaled = np.linalg.solve(root, (others - mean).T)
    return float((scaled**2).sum() / len(others) + 2 * np.log(np.diag(root)).sum())


def _along_commands(
    presets: Sequence[Preset],
    stroke_mm: tuple[float, float],
    seed: int,
    on_progress: Callable[[int, int], None] | None,
) -> tuple[list[Preset], Array]:
    """Return those that have an equilibrium, and their angles [deg], one command after another."""
    kinds, angles = list(SIGNALS), []
    stroke = stroke_mm[0] * 1e-3, stroke_mm[1] * 1e-3  # all: on a part, some hardly move
    for number in range(COMMANDS):
        rng = random_stream(seed, SeedUse.TWINS_CHOICE_COMMANDS, number)
        pull = command(kinds[number % len(kinds)], stroke, _SECONDS, _SAMPLE_TIME, rng)
        episodes = simulate_batch(presets, [pull] * len(presets), _SAMPLE_TIME)
        nothing = np.full(len(pull), np.nan)
        angles.append([(nothing if e is None else e.truth_deg)[::_EVERY] for e in episodes])
        if on_progress:
            on_progress(number + 1, COMMANDS)
    whole = np.concatenate(angles, axis=1)
    able = np.array([np.isfinite(one).all() for one in whole])
    return [preset for preset, one in zip(presets, able, strict=True) if one], whole[able]


def _in_sheaths(
    presets: Sequence[Preset], preset: Preset, ranges: Ranges, seed: int, moving: int
) -> MemberSet:
    still = MemberSet.still(presets)
    if not moving:
        return still
    other, period, phase = (of.copy() for of in still[1:4])
    courses = _spread(moving, 3, random_stream(seed, SeedUse.TWINS_SHEATHS))
    for number, (bent, of_period, of_phase) in enumerate(courses, len(presets) - moving):
        other[number] = ranges.at(preset, np.full(len(ranges.limits), bent)).sheath_bend
        period[number] = quantile(*_PERIODS, of_period)
        phase[number] = of_phase
    return still._replace(other=other, period=period, phase=phase)


def _spread(count: int, dimensions: int, rng: np.random.Generator) -> Array:
    """Return (count, dimensions) shares from 0 to 1 that fill their space more evenly than draws do.

    A Latin hypercube (McKay et al. 1979) of small discrepancy.
    """
    from scipy.stats.qmc import LatinHypercube  # here: reading records does not need it

    shares: Array = LatinHypercube(dimensions, optimization="random-cd", rng=rng).random(count)
    return shares
