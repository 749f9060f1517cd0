"""Noise families of the training: each sequence has its own, with parameters of its own.

A benchmark's noise has one level and fixed parameters (`twin.signals.noise`). Here nothing is fixed: a policy
that is to recognise what it has not met must not learn five distributions by heart.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError

Array = NDArray[np.float64]

LINEAR = ("gaussian", "uniform")
"""Families without tails and skew: what a policy could gain there is little, what it can spoil is much."""
VARIANCES = (0.05, 8.0)  # least and greatest R of most families [deg^2]; a variance of outliers may be larger


class NoiseBatch(NamedTuple):
    """Noise of B sequences of N samples."""

    noise_deg: Array  # (B, N) [deg]
    variance: Array  # (B,) R, which the filter knows [deg^2]
    mean_deg: Array  # (B,) mean of the noise, which it does not know [deg]
    family: NDArray[np.intp]  # (B,) place of its family among the given ones
    noise_model: NDArray[np.intp]  # (B,) place of its noise model among those of the given families
    linear: NDArray[np.bool_]  # (B,) whether the linear update is the best there is for it, or near it


def draw_noises(families: Sequence[str], count: int, samples: int, rng: np.random.Generator) -> NoiseBatch:
    """Draw the noise of sequences, each from one of some families."""
    check_families(families)
    known = [FAMILIES[name] for name in families]
    weights = np.array([family.weight for family in known])
    first = np.cumsum([0, *(family.noise_models for family in known)])  # noise model of each family
    chosen = rng.choice(len(families), count, p=weights / weights.sum())
    noise = np.empty((count, samples))
    variance, mean, noise_model = np.empty(count), np.empty(count), np.empty(count, np.intp)
    for row, number in enumerate(chosen):
        noise[row], variance[row], mean[row], kind = known[number].draw(samples, rng)
        noise_model[row] = first[number] + kind
    linear = np.array([families[number] in LINEAR for number in chosen])
    return NoiseBatch(noise, variance, mean, chosen, noise_model, linear)


def count_noise_models(families: Sequence[str]) -> int:
    """Return the number of noise models that families have together."""
    check_families(families)
    return sum(FAMILIES[name].noise_models for name in families)


def check_families(families: Sequence[str]) -> None:
    """Refuse families that there are not."""
    wrong = [name for name in families if name not in FAMILIES or families.count(name) > 1]
    if wrong or not families:
        raise InputError(
            f"training noises {', '.join(wrong) or 'none'}: choose from {', '.join(FAMILIES)}, each once"
        )


_Drawn = tuple[Array, float, float, int]
"""Noise (N,) [deg], R [deg^2], mean [deg], and which noise model of its family it is."""


class Family(NamedTuple):
    """Family of noise."""

    weight: float  # how often it is met, among the others
    noise_models: int  # into how many noise models it is divided, by the parameters that change its shape
    draw: Callable[[int, np.random.Generator], _Drawn]  # returns the noise of a sequence of so many samples


def _variance(rng: np.random.Generator, low: float = VARIANCES[0], high: float = VARIANCES[1]) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _gaussian(samples: int, rng: np.random.Generator) -> _Drawn:
    variance = _variance(rng)
    return np.sqrt(variance) * rng.standard_normal(samples), variance, 0.0, 0


def _laplace(samples: int, rng: np.random.Generator) -> _Drawn:
    variance = _variance(rng)
    return rng.laplace(0.0, np.sqrt(variance / 2), samples), variance, 0.0, 0


def _student(samples: int, rng: np.random.Generator) -> _Drawn:
    variance, freedom = _variance(rng), rng.uniform(2.6, 8.0)
    scale = np.sqrt(variance * (freedom - 2) / freedom)
    return scale * rng.standard_t(freedom, samples), variance, 0.0, int(freedom > 4)


def _uniform(samples: int, rng: np.random.Generator) -> _Drawn:
    variance = _variance(rng)
    return np.sqrt(3 * variance) * rng.uniform(-1, 1, samples), variance, 0.0, 0


def _gamma(samples: int, rng: np.random.Generator) -> _Drawn:
    variance, shape = _variance(rng, high=4.0), rng.uniform(*_GAMMA_SHAPES)
    return (
        rng.gamma(shape, np.sqrt(variance / shape), samples),
        variance,
        float(np.sqrt(variance * shape)),
        _part(shape, _GAMMA_SHAPES, _GAMMA_MODELS),
    )


def _weibull(samples: int, rng: np.random.Generator) -> _Drawn:
    """Another noise with an edge: from nearly exponential to Rayleigh's, that of a magnitude, and beyond."""
    variance, shape = _variance(rng, high=4.0), rng.uniform(*_WEIBULL_SHAPES)
    first, second = math.gamma(1 + 1 / shape), math.gamma(1 + 2 / shape)
    scale = math.sqrt(variance / (second - first**2))
    return (
        scale * rng.weibull(shape, samples),
        variance,
        scale * first,
        _part(shape, _WEIBULL_SHAPES, _WEIBULL_MODELS),
    )


def _part(value: float, limits: tuple[float, float], parts: int) -> int:
    low, high = limits
    return min(int(parts * (value - low) / (high - low)), parts - 1)


def _poisson(samples: int, rng: np.random.Generator) -> _Drawn:
    mean = _variance(rng, high=4.0)
    return rng.poisson(mean, samples).astype(float), mean, mean, 0


def _dithered_poisson(samples: int, rng: np.random.Generator) -> _Drawn:
    noise, variance, mean, kind = _poisson(samples, rng)
    return noise + rng.uniform(-0.5, 0.5, samples), variance + 1 / 12, mean, kind


def _outliers(samples: int, rng: np.random.Generator) -> _Drawn:
    share, size, variance = rng.uniform(0.01, 0.1), rng.uniform(4.0, 15.0), _variance(rng, 0.03, 0.6)
    outlier = rng.choice([-size, size], samples) * (rng.uniform(size=samples) < share)
    noise = np.sqrt(variance) * rng.standard_normal(samples) + outlier
    kind = 3 * int(share > 0.04) + int(size > 7) + int(size > 11)
    return noise, float(variance + share * size**2), 0.0, kind


def _contaminated(samples: int, rng: np.random.Generator) -> _Drawn:
    """A sensor with one-sided errors now and then: a mixture of two normal distributions."""
    share, away, width = rng.uniform(0.05, 0.35), rng.uniform(1.5, 4.5), rng.uniform(0.7, 2.0)
    side, variance = rng.choice([-1.0, 1.0]), _variance(rng, high=5.0)
    badly = rng.uniform(size=samples) < share
    normal = rng.standard_normal(samples)
    scale = np.sqrt(variance / (1 - share + share * (width**2 + away**2) - (share * away) ** 2))
    noise: Array = scale * np.where(badly, side * away + width * normal, normal)
    kind = 3 * int(side > 0) + int(share > 0.12) + int(share > 0.22)
    return noise, variance, float(scale * side * share * away), kind


_GAMMA_SHAPES, _GAMMA_MODELS = (1.2, 3.5), 5
_WEIBULL_SHAPES, _WEIBULL_MODELS = (1.1, 2.6), 4

FAMILIES: dict[str, Family] = {
    "gaussian": Family(0.20, 1, _gaussian),
    "laplace": Family(0.10, 1, _laplace),
    "student-t": Family(0.10, 2, _student),
    "uniform": Family(0.10, 1, _uniform),
    "gamma": Family(0.14, _GAMMA_MODELS, _gamma),
    "weibull": Family(0.08, _WEIBULL_MODELS, _weibull),
    "poisson": Family(0.14, 1, _poisson),
    "poisson-dithered": Family(0.10, 1, _dithered_poisson),
    "salt-and-pepper": Family(0.12, 6, _outliers),
    "contaminated": Family(0.12, 6, _contaminated),
}
"""Families by name, with how often each is met among those of a training."""

STANDARD = tuple(name for name in FAMILIES if name != "weibull")
"""Families that are met unless others are asked for; weibull is like gamma, and can stand in for it."""
