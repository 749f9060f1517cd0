"""A step of RAM (twins) and sequences of a size that a test can train."""

import dataclasses
import functools

import numpy as np
import torch
from numpy.typing import ArrayLike

from rl.twins.memory_step import MemoryStep
from rl.twins.noises import noise_models
from rl.twins.records import SequenceSource, TwinArrays, by_model, principal_directions, simulate_records
from rl.twins.settings import NetworkTraining, SimulatedTraining, TwinsTraining
from rl.twins.step import TwinsStep
from twin.hysteresis import ColemanHodgdon
from twin.preset import load_preset, load_ranges
from twin.reduced.members import MemberSet, draw_turns
from twin.signals.streams import SeedUse, random_stream

TINY = TwinsTraining(
    noises=("gaussian", "laplace", "gamma", "poisson-dithered", "salt-and-pepper"),
    members=6,
    moving=2,
    rank=4,
    commands=6,
    twins=2,
    seconds=20.0,
    episode=40,
    noise_model_sequences=64,
    noise_model_updates=10,
    interval_sequences=64,
    interval_updates=10,
    seed=1,
)


MODELS = noise_models(TINY.noises)
LAWS = len(MODELS)


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
    presets, *course, turns = still_members()
    other, period, phase = (of.copy() for of in course)
    other[-2:], period[-2:], phase[-2:] = (0.7, 4.6), (90.0, 200.0), (0.2, 0.6)
    turns = draw_turns((-4.0, 4.0), len(presets), generator(5))
    return MemberSet(presets, other, period, phase, turns)


@functools.cache
def small_records() -> TwinArrays:
    """Records of a few commands by the reduced twin."""
    preset, ranges = twins()
    return simulate_records(preset, ranges, small_members(), commands=6, twins=2, seconds=20.0, seed=1)


def small_source(noises=TINY.noises) -> SequenceSource:
    return SequenceSource(small_records(), tuple(noises))


def drawn(count=5, samples=30, seed=3, noises=("gaussian", "poisson")):
    return small_source(noises).draw(count, samples, generator(seed), stride=5)


def small_step(seed=0, rank=TINY.rank) -> TwinsStep:
    """An untrained step."""
    torch.manual_seed(seed)
    return TwinsStep(principal_directions(small_records()[1], rank), MODELS).eval()


def normal_laws(step: TwinsStep, deviations: ArrayLike = 1.0) -> TwinsStep:
    """Make every noise model of a step normal, the same at any R, as likely as any other, and certain.

    Deviations are in units of sqrt(R), one for all or for each; those of one shape must be the same.
    """
    noise_models = step.filter_bank.noise_models
    of_models = torch.as_tensor(deviations, dtype=torch.float32).expand(LAWS)
    deviation = torch.stack([of_models[place] for place in noise_models.of_shape.argmax(dim=0)])
    with torch.no_grad():
        noise_models.places.zero_()
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
    **{field.name: getattr(TINY, field.name) for field in dataclasses.fields(SimulatedTraining)},
    sequences=16,
    window=20,
    updates=8,
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
