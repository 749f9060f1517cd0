"""A step of RAM (twins) and sequences of a size that a test can train."""

import dataclasses
import functools

import numpy as np
import torch
from numpy.typing import ArrayLike

from rl.twins.memory_step import MemoryStep
from rl.twins.noises import STANDARD, count_noise_models
from rl.twins.records import SequenceSource, TwinArrays, by_model, principal_directions, simulate_records
from rl.twins.settings import NetworkTraining, SimulatedTraining, TwinsTraining
from rl.twins.step import TwinsStep
from twin.hysteresis import ColemanHodgdon
from twin.preset import load_preset, load_ranges
from twin.reduced.members import MemberSet
from twin.signals.streams import SeedUse, random_stream

TINY = TwinsTraining(
    noises=tuple(name for name in STANDARD if name != "contaminated"),  # eight: few sequences meet them all
    members=6,
    moving=2,
    rank=4,
    commands=6,
    twins=2,
    seconds=20.0,
    sequences=16,
    episode=40,
    window=20,
    noise_model_sequences=64,
    noise_model_updates=10,
    updates=8,
    interval_sequences=64,
    interval_updates=10,
    seed=1,
)


LAWS = count_noise_models(TINY.noises)


@functools.cache
def twins():
    """Preset and ranges that the tests draw from."""
    return load_preset("ureteroscope"), load_ranges("ureteroscope")


@functools.cache
def still_members() -> MemberSet:
    """A few independent draws: unlike members that are spread evenly, they do not reach every endoscope."""
    preset, ranges = twins()
    streams = (random_stream(TINY.seed, SeedUse.TWINS_MEMBERS, number) for number in range(TINY.members))
    return MemberSet.still([ranges.draw(preset, rng) for rng in streams])


@functools.cache
def small_members() -> MemberSet:
    """The same, two of them in a sheath that moves."""
    presets, *course = still_members()
    other, period, phase = (of.copy() for of in course)
    other[-2:], period[-2:], phase[-2:] = (0.7, 4.6), (90.0, 200.0), (0.2, 0.6)
    return MemberSet(presets, other, period, phase)


@functools.cache
def small_records() -> TwinArrays:
    """Records of a few commands by the reduced twin."""
    preset, ranges = twins()
    return simulate_records(preset, ranges, small_members(), commands=6, twins=2, seconds=20.0, seed=1)


def small_source(noises=TINY.noises) -> SequenceSource:
    return SequenceSource(small_records(), tuple(noises))


def drawn(count=5, samples=30, seed=3, noises=("gaussian", "poisson")):
    return small_source(noises).draw(count, samples, generator(seed), stride=5)


def small_step(seed=0, rank=TINY.rank, loud=0.0) -> TwinsStep:
    """An untrained step; `loud` is the spread of the weights of its policy's last layer."""
    torch.manual_seed(seed)
    step = TwinsStep(principal_directions(small_records()[1], rank), LAWS, 64)
    with torch.no_grad():
        step.policy[-1].weight.normal_(0, loud)
    return step.eval()


def normal_laws(step: TwinsStep, means: ArrayLike = 0.0, deviations: ArrayLike = 1.0) -> TwinsStep:
    """Make every noise model of a step normal, the same at any R, as likely as any other, and certain."""
    noise_models = step.filter_bank.noise_models
    mean, deviation = (torch.as_tensor(of, dtype=torch.float32).expand(LAWS) for of in (means, deviations))
    with torch.no_grad():
        step.filter_bank.caution.fill_(-20.0)
        noise_models.places.zero_()
        noise_models.places[0] = mean[:, None]
        noise_models.widths.fill_(-20.0)
        noise_models.widths[0] = torch.log(deviation)[:, None]
        noise_models.weights.zero_()
        noise_models.effective.zero_()
        noise_models.effective[0] = 2 * torch.log(deviation)
        noise_models.prior[-1].weight.zero_()
        noise_models.prior[-1].bias.zero_()
    return step


def shorter(**changes) -> TwinsTraining:
    return dataclasses.replace(TINY, **changes)


def generator(seed=0) -> np.random.Generator:
    return np.random.default_rng(seed)


TINY_MEMORY = NetworkTraining(
    **{field.name: getattr(TINY, field.name) for field in dataclasses.fields(SimulatedTraining)}
)
MODEL = ColemanHodgdon(1.15, 22.3, 4.9)


def small_memory_source(noises=TINY.noises) -> SequenceSource:
    return SequenceSource(small_records(), tuple(noises), by_model(MODEL))


def small_memory_step(seed=0, loud=0.0) -> MemoryStep:
    """An untrained step; `loud` is the spread of the weights of its policy's last layer."""
    torch.manual_seed(seed)
    step = MemoryStep()
    with torch.no_grad():
        step.output[-1].weight.normal_(0, loud)
    return step.eval()
