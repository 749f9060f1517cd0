"""Training records of RAM (twins): commands, the members along them, and other twins that are the truth."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from rl.supervised import tensor32
from rl.twins.noises import NoiseBatch, draw_noises
from twin.errors import DivergedError
from twin.estimation.learned.step import affine_step
from twin.hysteresis import ColemanHodgdon
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced import simulate_batch
from twin.reduced.members import MemberSet, draw_turns
from twin.signals.excitation import SIGNALS, command, paths_to
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
Array32 = NDArray[np.float32]

SAMPLE_TIME = 0.02  # between two samples of a training record [s]; coarser sampling thins it
STROKE_MM = (-4.0, 4.0)  # of the commands, where none is asked for [mm]
_NARROWEST = 1 / 8  # width of a stroke, as a share of the widest
_WIDER = 1.3  # factor on the ranges that a quarter of the twins is drawn from
_SPARE = 1  # twins beyond those that are asked for
_LONGEST = 3600.0  # time that these have moved for when a record begins [s]
_MOVING = 0.35  # share of twins whose sheath is bent on during the record
_UNKNOWN = 0.4  # share of commands before which twins and members have moved, each along a path of its own
_ONE_IN, _DISTURBED = 8, 1  # one twin in so many is knocked, or its drive sticks: its place


TwinArrays = tuple[Array32, Array32, Array32]
"""Commands (C, N) [mm], angles (C, M, N) of M members and (C, K, N) of K twins along each [deg]."""


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
) -> TwinArrays:
    """Simulate training records by the reduced twin, sampled at `SAMPLE_TIME`."""
    kinds, wide = list(SIGNALS), ranges.wider(_WIDER)
    pulls, bends, count = [], [], len(members.presets)
    for number in range(commands):
        rng = random_stream(seed, SeedUse.TWINS_COMMANDS, number)
        pull = command(kinds[number % len(kinds)], _stroke(stroke_mm, rng), seconds, SAMPLE_TIME, rng)
        unknown = rng.uniform() < _UNKNOWN
        presets, sheath_bends = _members_along(
            members, len(pull), random_stream(seed, SeedUse.TWINS_BEGINS, number)
        )
        turns, drives = [*members.turns_mm * 1e-3], [pull] * count
        # Drawn from wider ranges, a twin may find no equilibrium: the first that do are taken.
        for place in range(twins + _SPARE):
            rng = random_stream(seed, SeedUse.TWINS_TRUTHS, number, place)
            drawn, other = ((wide if place % 4 == 0 else ranges).draw(preset, rng) for _ in range(2))
            moves = rng.uniform() < _MOVING
            presets.append(drawn)
            sheath_bends.append(
                np.linspace(drawn.sheath_bend, other.sheath_bend, len(pull)) if moves else None
            )
            turns.append(draw_turns(stroke_mm, 1, rng)[0] * 1e-3)
            drives.append(sticking(pull, rng) if place % _ONE_IN == _DISTURBED and number % 2 else pull)
        begun = 0
        if unknown:
            before = paths_to(np.array(turns), np.array([of[0] for of in drives]), SAMPLE_TIME)
            begun = before.shape[1]
            drives = [np.concatenate(both) for both in zip(before, drives, strict=True)]
            sheath_bends = [of if of is None else np.pad(of, (begun, 0), "edge") for of in sheath_bends]
        # One command at a time: a complete record is a hundred times larger than the part that is kept.
        episodes = simulate_batch(presets, drives, SAMPLE_TIME, sheath_bends=sheath_bends)
        angles = [episode.truth_deg[begun:].astype(np.float32) for episode in episodes if episode is not None]
        if any(episode is None for episode in episodes[:count]) or len(angles) < count + twins:
            raise DivergedError(f"twins along training command {number} found no equilibrium")
        rng = random_stream(seed, SeedUse.TWINS_KNOCKS, number)
        if number % 2 == 0:
            for of in angles[count:][_DISTURBED::_ONE_IN]:
                of += knock(pull, rng)
        pulls.append(pull)
        bends.append(angles[: count + twins])
        if on_progress:
            on_progress(number + 1, commands)
    bend = np.array(bends)
    return np.array(pulls, np.float32) * 1e3, bend[:, :count], bend[:, count:]


def sticking(pull: Array, rng: np.random.Generator) -> Array:
    """Return the motion (N,) [m] of a sticking drive under a command: it slips once it lags too far."""
    most, held, moved = rng.uniform(0.05e-3, 0.3e-3), pull[0], pull.copy()
    for place, wanted in enumerate(pull):
        if abs(wanted - held) > most:
            held = wanted
        moved[place] = held
    return moved


def knock(pull: Array, rng: np.random.Generator) -> Array32:
    """Return the angle (N,) [deg] that a knock adds; it decays with the wire's travel along a command [m]."""
    at, size = rng.integers(len(pull) // 6, len(pull)), rng.choice([-1, 1]) * rng.uniform(0.5, 4.0)
    way = np.concatenate([[0.0], np.abs(np.diff(pull)).cumsum()])
    added = size * np.exp(-(way - way[at]) / rng.uniform(1e-3, 10e-3))
    return np.where(np.arange(len(pull)) >= at, added, 0.0).astype(np.float32)


def _members_along(
    members: MemberSet, samples: int, rng: np.random.Generator
) -> tuple[list[Preset], list[NDArray[np.float64] | None]]:
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


Places = NDArray[np.intp]

STRIDES = (5, 2, 1)  # T of 0.1, 0.04 and 0.02 s
SHARE_OF_FIRST = 0.7
"""Share of the sequences that have the first of several sample times; the others have the rest alike."""
FROM_THE_START = 0.5  # share of sequences that begin where the record begins
CALIBRATED = 0.35  # share of sensors whose zero is known
ZERO_DEVIATIONS_DEG = (0.1, 4.0)  # of the others
SITUATIONS = ("wrong variance", "changed noise", "disturbed")
"""Situations that no filter of the bank assumes: each counts as much as a family of noise."""
WRONG, CHANGED = 0.10, 0.08  # share of sequences of the first two
LARGEST_FACTOR = 3.0  # by which a given R is wrong, or the deviation of a noise changes


class Sequences(NamedTuple):
    """B sequences of N samples of one sample time, time first."""

    inputs: tuple[torch.Tensor, ...]  # what a step predicts by, (N, B, ...): `by_members` or `by_model`
    measurement_deg: torch.Tensor  # (N, B) [deg]
    truth_deg: torch.Tensor  # (N, B) [deg]
    variance: torch.Tensor  # (B,) R, as given [deg^2]
    zero_deviation_deg: torch.Tensor  # (B,) of what is known of the sensor's zero, as given [deg]
    bias_deg: torch.Tensor  # (B,) the sensor's zero [deg]
    family: torch.Tensor  # (B,) place of its family, or of its situation, among those of the training
    linear: torch.Tensor  # (B,) 1 where the linear update is the best there is or near it, else 0
    sample_time: torch.Tensor  # (B,) T [s]
    stride: int  # T in units of that of the records

    def between(self, begin: int, end: int) -> "Sequences":
        """Return the samples from one to another."""
        return self._replace(
            inputs=tuple(values[begin:end] for values in self.inputs),
            measurement_deg=self.measurement_deg[begin:end],
            truth_deg=self.truth_deg[begin:end],
        )


Prediction = Callable[[TwinArrays, Places, Places], tuple[torch.Tensor, ...]]
"""Inputs (N, B, ...) of a step for (B,) commands at (N + 1, B) samples, the first of which is the start."""


def by_members(records: TwinArrays, command: Places, index: Places) -> tuple[torch.Tensor, ...]:
    """Return the angle of the members (N, B, M) [deg] and the travel of the tendon (N, B) [mm]."""
    pull_mm, members_deg, _ = records
    way_mm = np.abs(np.diff(pull_mm[command, index], axis=0))
    return tensor32(members_deg[command, :, index[1:]]), tensor32(way_mm)


def by_model(model: ColemanHodgdon) -> Prediction:
    """Return the function that gives keep, drive [deg] and the increment of the pull [mm], each (N, B)."""

    def predict(records: TwinArrays, command: Places, index: Places) -> tuple[torch.Tensor, ...]:
        pull = records[0][command, index].astype(float)
        keep, drive, _ = affine_step(model, model.start(pull[1:]), pull[1:], pull[:-1])
        return tensor32(keep), tensor32(drive), tensor32(np.diff(pull, axis=0))

    return predict


@dataclasses.dataclass(frozen=True)
class SequenceSource:
    """Source of sequences."""

    records: TwinArrays  # that stretches are taken from
    noises: tuple[str, ...]  # families of the noise
    predict: Prediction = by_members  # gives the inputs of the step
    strides: tuple[int, ...] = STRIDES  # sample times over that of the records, the most frequent first

    def draw(
        self, count: int, samples: int, rng: np.random.Generator, stride: int | None = None
    ) -> Sequences:
        """Return sequences; their sample time is drawn, or `stride` times that of the records."""
        if stride is None:
            others = len(self.strides) - 1
            shares = [SHARE_OF_FIRST, *[(1 - SHARE_OF_FIRST) / others] * others] if others else [1.0]
            stride = int(rng.choice(self.strides, p=shares))
        pull_mm, _, truth_deg = self.records
        last = pull_mm.shape[1] - 1 - samples * stride
        command = rng.integers(len(pull_mm), size=count)
        twin = rng.integers(truth_deg.shape[1], size=count)
        start = np.where(rng.uniform(size=count) < FROM_THE_START, 0, rng.integers(last + 1, size=count))
        index = start + np.arange(samples + 1)[:, None] * stride  # (N + 1, B)
        angle = truth_deg[command, twin, index[1:]]
        noise = draw_situations(self.noises, count, samples, rng)
        least, most = np.log(ZERO_DEVIATIONS_DEG).tolist()
        deviation = np.exp(rng.uniform(least, most, count))
        deviation *= rng.uniform(size=count) >= CALIBRATED
        zero = deviation * rng.standard_normal(count)
        disturbed = twin % _ONE_IN == _DISTURBED
        family = np.where(disturbed, len(self.noises) + SITUATIONS.index("disturbed"), noise.family)
        return Sequences(
            self.predict(self.records, command, index),
            tensor32(angle + noise.noise_deg.T + zero),
            tensor32(angle),
            tensor32(noise.variance),
            tensor32(deviation),
            tensor32(zero),
            torch.as_tensor(family),
            tensor32(noise.linear & ~disturbed),
            torch.full((count,), stride * SAMPLE_TIME),
            stride,
        )


def draw_situations(
    families: tuple[str, ...], count: int, samples: int, rng: np.random.Generator
) -> NoiseBatch:
    """Draw the noise of sequences; in some it changes to another one, of others a wrong R is given."""
    noise, other = (draw_noises(families, count, samples, rng) for _ in range(2))
    kind = rng.uniform(size=count)
    changed, wrong = kind < CHANGED, (kind >= CHANGED) & (kind < CHANGED + WRONG)
    factor = np.exp(rng.uniform(-1, 1, count) * np.log(LARGEST_FACTOR))
    when = rng.uniform(0.15, 0.8, count) * samples
    later = (np.arange(samples) >= when[:, None]) & changed[:, None]
    scale = np.sqrt(noise.variance / other.variance * factor)
    return NoiseBatch(
        np.where(later, scale[:, None] * other.noise_deg, noise.noise_deg),
        np.where(wrong, noise.variance * factor, noise.variance),
        np.select([wrong, changed], [len(families), len(families) + 1], noise.family),
        np.where(changed, -1, noise.noise_model),
        noise.linear & ~changed & ~wrong,
    )


def principal_directions(members_deg: NDArray[np.float32], rank: int) -> torch.Tensor:
    """Return the (M, r) directions along which angles (C, M, N) of the members differ most."""
    thinned = members_deg[:, :, ::25].astype(float)
    anomaly = (thinned - thinned.mean(axis=1, keepdims=True)).transpose(1, 0, 2)
    rows = anomaly.reshape(len(anomaly), -1)
    left, _, _ = np.linalg.svd(rows @ rows.T)
    return tensor32(left[:, :rank])
