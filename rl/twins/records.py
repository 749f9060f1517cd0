"""Training records of RAM (twins): commands, the members along them, and other twins that are the truth."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from rl.supervised import tensor32
from rl.twins.noises import draw_noises
from twin.errors import DivergedError
from twin.estimation.learned.step import affine_step
from twin.hysteresis import ColemanHodgdon
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced import simulate_batch
from twin.reduced.members import MemberSet
from twin.signals.excitation import SIGNALS, command
from twin.signals.streams import SeedUse, random_stream

Array32 = NDArray[np.float32]

SAMPLE_TIME = 0.02  # between two samples of a training record [s]; coarser sampling thins it
STROKE_MM = (-4.0, 4.0)  # of the commands, where none is asked for [mm]
_NARROWEST = 1 / 8  # width of a stroke, as a share of the widest
_WIDER = 1.3  # times the ranges: what a fourth of the twins is drawn from
_SPARE = 1  # twins beyond those that are asked for
_LONGEST = 3600.0  # time that these have moved for when a record begins [s]
_MOVING = 0.35  # share of twins whose sheath is bent on during the record


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
    return np.array(pulls, np.float32) * 1e3, bend[:, :count], bend[:, count:]


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


class Sequences(NamedTuple):
    """B sequences of N samples of one sample time, time first."""

    inputs: tuple[torch.Tensor, ...]  # what a step predicts by, (N, B, ...): `by_members` or `by_model`
    measurement_deg: torch.Tensor  # (N, B) [deg]
    truth_deg: torch.Tensor  # (N, B) [deg]
    variance: torch.Tensor  # (B,) R [deg^2]
    bias_deg: torch.Tensor  # (B,) mean of the noise [deg]
    family: torch.Tensor  # (B,) place of its family among those that are met
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
    """Return the angle of the members (N, B, M) [deg] and the way of the tendon (N, B) [mm]."""
    pull_mm, members_deg, _ = records
    way_mm = np.abs(np.diff(pull_mm[command, index], axis=0))
    return tensor32(members_deg[command, :, index[1:]]), tensor32(way_mm)


def by_model(model: ColemanHodgdon) -> Prediction:
    """Return what gives keep, drive [deg] and the increment of the pull [mm], each (N, B)."""

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
    zero_deviation_deg: float = 0.0  # of what is left of a sensor's zero after its correction [deg]

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
        noise = draw_noises(self.noises, count, samples, rng)
        if self.zero_deviation_deg:
            offset = self.zero_deviation_deg * rng.standard_normal(count)
            noise = noise._replace(
                noise_deg=noise.noise_deg + offset[:, None], mean_deg=noise.mean_deg + offset
            )
        return Sequences(
            self.predict(self.records, command, index),
            tensor32(angle + noise.noise_deg.T),
            tensor32(angle),
            tensor32(noise.variance),
            tensor32(noise.mean_deg),
            torch.as_tensor(noise.family),
            tensor32(noise.linear),
            torch.full((count,), stride * SAMPLE_TIME),
            stride,
        )


def principal_directions(members_deg: NDArray[np.float32], rank: int) -> torch.Tensor:
    """Return the (M, r) directions along which angles (C, M, N) of the members differ most."""
    thinned = members_deg[:, :, ::25].astype(float)
    anomaly = (thinned - thinned.mean(axis=1, keepdims=True)).transpose(1, 0, 2)
    rows = anomaly.reshape(len(anomaly), -1)
    left, _, _ = np.linalg.svd(rows @ rows.T)
    return tensor32(left[:, :rank])
