"""Linear system on which learned gains were published: place and nearly constant speed of a body.

x' = [1 1; 0 1] x + (0, w), y = x_0 + v, with w of variance 1e-4 and T = 1 s, for 150 samples from a speed of
1 +- 0.1 (Mortada et al. 2025; their code states the numbers). v has variance 1: normal, or of two
widths (1.25 in 0.6 of the samples, 0.40 else), which no filter knows. On the first the Kalman filter is
optimal, and KalmanNet is published to reach it (Revach et al. 2022). On the second a filter that
knows each sample's width is a bound, and one that knows the variance what a network has to beat.

Nothing is known of where the body begins, as for our filters, which begin at the first measurement. Its speed
is the f of the active model about the mean speed, which is the drive.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
import torch

from rl.supervised import tensor32
from rl.twins.filter_step import ALL, FilterStep
from rl.twins.learning import filter_sequences, learn_gain
from rl.twins.records import STRIDES, Sequences
from rl.twins.settings import NetworkTraining
from scripts.benchmarks.harness import Array
from twin.estimation.gaussian import condition, propagate

SAMPLES = 150
SPEED, SPEED_DEVIATION = 1.0, 0.1
WALK = 1e-4  # variance of what is added to the speed at each sample
UNKNOWN = 1e8  # variance of the place at which a body begins
WIDE, SHARE_WIDE = 1.25, 0.6
NARROW = float(np.sqrt((1 - SHARE_WIDE * WIDE**2) / (1 - SHARE_WIDE)))
"""Widths of the noise of two widths, such that its variance is 1."""


class Bodies(NamedTuple):
    """Runs of the system, (N, B) each: true place and speed, measured place, deviation of its noise."""

    place: Array
    speed: Array
    measured: Array
    deviation: Array


@dataclasses.dataclass(frozen=True)
class LinearSource:
    """Source of sequences of the system, under normal noise or one of two widths."""

    two_widths: bool = False

    def run(self, count: int, samples: int, rng: np.random.Generator) -> Bodies:
        """Return runs of the system."""
        speed = SPEED + SPEED_DEVIATION * rng.standard_normal(count)
        speeds = speed + np.cumsum(np.sqrt(WALK) * rng.standard_normal((samples, count)), axis=0)
        before = np.concatenate([speed[None], speeds[:-1]])  # the speed is added before it changes
        place = np.cumsum(before, axis=0)
        wide = rng.uniform(size=place.shape) < SHARE_WIDE
        deviation = np.where(wide, WIDE, NARROW) if self.two_widths else np.ones(place.shape)
        return Bodies(place, speeds, place + deviation * rng.standard_normal(place.shape), deviation)

    def draw(
        self, count: int, samples: int, rng: np.random.Generator, stride: int | None = None
    ) -> Sequences:
        """Return runs as sequences that a filter step learns from; their sample time is 1 s."""
        return sequences_of(self.run(count, samples, rng))


def sequences_of(bodies: Bodies) -> Sequences:
    """Return runs as sequences: nothing is lost from sample to sample, and the mean speed is added."""
    samples, count = bodies.place.shape
    ones, zeros = torch.ones(samples, count), torch.zeros(count)
    return Sequences(
        (ones, SPEED * ones, 0 * ones),
        tensor32(bodies.measured),
        tensor32(bodies.place),
        torch.ones(count),
        zeros,
        zeros,
        torch.zeros(count, dtype=torch.long),
        zeros,
        torch.ones(count),
        STRIDES[0],
    )


def kalman_filter(bodies: Bodies, *, knows_width: bool) -> Array:
    """Return (N, B) the estimates of the Kalman filter that knows each sample's width, or the variance 1."""
    count = bodies.place.shape[1]
    step = np.tile(np.array([[1.0, 1.0], [0.0, 1.0]])[:, :, None], (1, 1, count))
    walk, place = np.diag([0.0, WALK]), np.array([1.0, 0.0])
    mean = np.tile([[0.0], [SPEED]], (1, count))
    covariance = np.tile(np.diag([UNKNOWN, SPEED_DEVIATION**2])[:, :, None], (1, 1, count))
    found = []
    for measured, deviation in zip(bodies.measured, bodies.deviation, strict=True):
        mean = np.einsum("ijb,jb->ib", step, mean)
        covariance = propagate(covariance, step, walk)
        variance = deviation**2 if knows_width else np.ones(count)
        mean, covariance = condition(mean, covariance, place, measured, variance)
        found.append(mean[0])
    return np.array(found)


def first_rate(step: FilterStep) -> float:
    """Return the learning rate at the start: a likelihood is steeper than a square error."""
    return 3e-3 if step.by_likelihood else 1e-2


def learn_gains(step: FilterStep, source: LinearSource, updates: int, seed: int = 1) -> None:
    """Train a filter step on the system."""
    settings = NetworkTraining(
        noises=("gaussian",),
        episode=SAMPLES,
        window=50,
        updates=updates,
        sequences=128,
        learning_rate=first_rate(step),
        seed=seed,
    )
    learn_gain(step, source.draw, settings)


def learned_estimates(step: FilterStep, bodies: Bodies) -> tuple[Array, Array]:
    """Return (N, B) the estimates of a trained step, and the standard deviations that it states."""
    places, deviations = [], []
    with torch.no_grad():
        for output, _ in filter_sequences(step, sequences_of(bodies), ALL):
            places.append(output.bend_deg.double().numpy())
            deviations.append(output.deviation_deg.double().numpy())
    return np.array(places), np.array(deviations)


def decibels(estimates: Array, truth: Array) -> float:
    """Return the mean square error in decibels."""
    return float(10 * np.log10(np.mean((estimates - truth) ** 2)))
