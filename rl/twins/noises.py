"""Noise families of the training: each sequence has its own, with parameters of its own.

A benchmark's noise has one level and fixed parameters (`twin.signals.noise`). Here nothing is fixed: a policy
that is to recognise unseen noise must not memorise five distributions.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from twin.errors import InputError

Array = NDArray[np.float64]

LINEAR = ("gaussian", "uniform")
"""Families without tails and skew: a learned gain can improve little there, and harm much."""
VARIANCES = (0.05, 8.0)  # least and greatest R of most families [deg^2]; a variance of outliers may be larger


class NoiseBatch(NamedTuple):
    """Noise of B sequences of N samples, of mean zero."""

    noise_deg: Array  # (B, N) [deg]
    variance: Array  # (B,) R, which the filter knows [deg^2]
    family: NDArray[np.intp]  # (B,) place of its family among the given ones
    noise_model: NDArray[np.intp]  # (B,) place of its noise model among `noise_models`; -1 if it has none
    linear: NDArray[np.bool_]  # (B,) whether the linear update is the best there is for it, or near it


class ModelOf(NamedTuple):
    """Noise model of the bank: parameters of a shape, and to which side it is turned."""

    shape: int  # number of the parameters; both sides of a skewed noise share them
    side: float  # 1 as its family draws it, -1 mirrored


def noise_models(families: Sequence[str]) -> tuple[ModelOf, ...]:
    """Return the noise models of families: one for each shape, and one for its mirror image if skewed."""
    check_families(families)
    models: list[ModelOf] = []
    first = 0
    for family in (FAMILIES[name] for name in families):
        for side in (1.0, -1.0)[: 1 + family.skewed]:
            models += [ModelOf(first + shape, side) for shape in range(family.shapes)]
        first += family.shapes
    return tuple(models)


def draw_noises(families: Sequence[str], count: int, samples: int, rng: np.random.Generator) -> NoiseBatch:
    """Draw the noise of sequences, each from one of some families; skewed ones to either side."""
    models = noise_models(families)
    known = [FAMILIES[name] for name in families]
    weights = np.array([family.weight for family in known])
    first = np.cumsum([0, *(family.shapes for family in known)])  # shape of each family
    chosen = rng.choice(len(families), count, p=weights / weights.sum())
    noise, variance, noise_model = np.empty((count, samples)), np.empty(count), np.full(count, -1)
    for row, number in enumerate(chosen):
        family = known[number]
        drawn, variance[row], shape = family.draw(samples, rng)
        side = rng.choice([-1.0, 1.0]) if family.skewed else 1.0
        noise[row] = side * drawn
        if family.shapes:
            noise_model[row] = models.index(ModelOf(int(first[number]) + shape, side))
    linear = np.array([families[number] in LINEAR for number in chosen])
    return NoiseBatch(noise, variance, chosen, noise_model, linear)


def check_families(families: Sequence[str]) -> None:
    """Refuse families that there are not."""
    wrong = [name for name in families if name not in FAMILIES or families.count(name) > 1]
    if wrong or not families:
        raise InputError(
            f"training noises {', '.join(wrong) or 'none'}: choose from {', '.join(FAMILIES)}, each once"
        )


_Drawn = tuple[Array, float, int]
"""Noise (N,) of mean zero [deg], R [deg^2], and which shape of its family it is."""


class Family(NamedTuple):
    """Family of noise."""

    weight: float  # its frequency relative to the others
    shapes: int  # into how many noise models it is divided; 0: the bank has none of it
    skewed: bool  # whether it is drawn to either side
    draw: Callable[[int, np.random.Generator], _Drawn]  # returns the noise of a sequence of so many samples


def _variance(rng: np.random.Generator, low: float = VARIANCES[0], high: float = VARIANCES[1]) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _gaussian(samples: int, rng: np.random.Generator) -> _Drawn:
    variance = _variance(rng)
    return np.sqrt(variance) * rng.standard_normal(samples), variance, 0


def _laplace(samples: int, rng: np.random.Generator) -> _Drawn:
    variance = _variance(rng)
    return rng.laplace(0.0, np.sqrt(variance / 2), samples), variance, 0


def _student(samples: int, rng: np.random.Generator) -> _Drawn:
    variance, freedom = _variance(rng), rng.uniform(2.6, 8.0)
    scale = np.sqrt(variance * (freedom - 2) / freedom)
    return scale * rng.standard_t(freedom, samples), variance, int(freedom > 4)


def _uniform(samples: int, rng: np.random.Generator) -> _Drawn:
    variance = _variance(rng)
    return np.sqrt(3 * variance) * rng.uniform(-1, 1, samples), variance, 0


def _gamma(samples: int, rng: np.random.Generator) -> _Drawn:
    variance, log_shape = _variance(rng, high=5.0), rng.uniform(*_LOG_SHAPES)
    shape = math.exp(log_shape)
    noise = rng.gamma(shape, np.sqrt(variance / shape), samples) - np.sqrt(variance * shape)
    return noise, variance, _part(log_shape, _LOG_SHAPES, _GAMMA_MODELS)


def _lognormal(samples: int, rng: np.random.Generator) -> _Drawn:
    variance, width = _variance(rng, high=5.0), rng.uniform(*_LOGNORMAL_WIDTHS)
    square = math.exp(width**2)
    scale = math.sqrt(variance / (square * (square - 1)))
    noise = scale * (rng.lognormal(0.0, width, samples) - math.sqrt(square))
    return noise, variance, _part(width, _LOGNORMAL_WIDTHS, _LOGNORMAL_MODELS)


def _weibull(samples: int, rng: np.random.Generator) -> _Drawn:
    """Another noise with an edge: from nearly exponential to Rayleigh's, that of a magnitude, and beyond."""
    variance, shape = _variance(rng, high=5.0), rng.uniform(1.1, 2.6)
    first, second = math.gamma(1 + 1 / shape), math.gamma(1 + 2 / shape)
    scale = math.sqrt(variance / (second - first**2))
    return scale * (rng.weibull(shape, samples) - first), variance, 0


def _part(value: float, limits: tuple[float, float], parts: int) -> int:
    low, high = limits
    return min(int(parts * (value - low) / (high - low)), parts - 1)


def _poisson(samples: int, rng: np.random.Generator) -> _Drawn:
    mean = _variance(rng, high=4.0)
    return rng.poisson(mean, samples).astype(float) - mean, mean, 0


def _dithered_poisson(samples: int, rng: np.random.Generator) -> _Drawn:
    noise, variance, kind = _poisson(samples, rng)
    return noise + rng.uniform(-0.5, 0.5, samples), variance + 1 / 12, kind


def _outliers(samples: int, rng: np.random.Generator) -> _Drawn:
    share, size, variance = rng.uniform(0.01, 0.1), rng.uniform(4.0, 15.0), _variance(rng, 0.03, 0.6)
    outlier = rng.choice([-size, size], samples) * (rng.uniform(size=samples) < share)
    noise = np.sqrt(variance) * rng.standard_normal(samples) + outlier
    return noise, float(variance + share * size**2), 2 * int(share > 0.04) + int(size > 8)


def _two_normals(
    samples: int,
    rng: np.random.Generator,
    shares: tuple[float, float],
    distances: tuple[float, float],
    widths: tuple[float, float],
) -> tuple[Array, float, float]:
    """Draw a mixture of two normal distributions; returns noise, R and the share of the second one.

    Distance and width of the second are in units of the deviation of the first.
    """
    share, away, width = rng.uniform(*shares), rng.uniform(*distances), rng.uniform(*widths)
    variance = _variance(rng, high=5.0)
    second, normal = rng.uniform(size=samples) < share, rng.standard_normal(samples)
    scale = math.sqrt(variance / (1 - share + share * (width**2 + away**2) - (share * away) ** 2))
    noise: Array = scale * (np.where(second, away + width * normal, normal) - share * away)
    return noise, variance, share


def _contaminated(samples: int, rng: np.random.Generator) -> _Drawn:
    """A sensor with one-sided errors now and then."""
    noise, variance, share = _two_normals(samples, rng, (0.05, 0.35), (1.5, 4.5), (0.7, 2.0))
    return noise, variance, int(share > 0.12) + int(share > 0.22)


def _two_modes(samples: int, rng: np.random.Generator) -> _Drawn:
    """A sensor that switches between two readings."""
    noise, variance, _ = _two_normals(samples, rng, (0.2, 0.5), (2.0, 6.0), (0.5, 1.5))
    return noise, variance, 0


def _correlated(samples: int, rng: np.random.Generator) -> _Drawn:
    """An autoregression of first order, normal or skewed; no model of the bank has a memory."""
    variance, memory = _variance(rng, high=4.0), rng.uniform(0.3, 0.95)
    shape = float(np.exp(rng.uniform(0.0, 3.0)))
    white = (rng.gamma(shape, 1.0, samples) - shape) / np.sqrt(shape)
    if rng.uniform() < 0.5:
        white = rng.standard_normal(samples)
    white[1:] *= np.sqrt(1 - memory**2)
    return np.sqrt(variance) * lfilter([1.0], [1.0, -memory], white), variance, 0


_LOG_SHAPES, _GAMMA_MODELS = (math.log(1.1), math.log(12.0)), 3
_LOGNORMAL_WIDTHS, _LOGNORMAL_MODELS = (0.3, 1.0), 2

FAMILIES: dict[str, Family] = {
    "gaussian": Family(0.20, 1, False, _gaussian),
    "laplace": Family(0.10, 1, False, _laplace),
    "student-t": Family(0.10, 2, False, _student),
    "uniform": Family(0.10, 1, False, _uniform),
    "gamma": Family(0.14, _GAMMA_MODELS, True, _gamma),
    "lognormal": Family(0.10, _LOGNORMAL_MODELS, True, _lognormal),
    "weibull": Family(0.05, 0, True, _weibull),
    "poisson": Family(0.06, 1, True, _poisson),
    "poisson-dithered": Family(0.12, 1, True, _dithered_poisson),
    "salt-and-pepper": Family(0.12, 4, False, _outliers),
    "contaminated": Family(0.10, 3, True, _contaminated),
    "two-modes": Family(0.06, 1, True, _two_modes),
    "correlated": Family(0.08, 0, True, _correlated),
}
"""Families by name, with their frequency in a training."""

STANDARD = tuple(FAMILIES)
"""Families of a training by default."""
