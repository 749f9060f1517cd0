"""Measurement noise of the RAM paper, in degrees: Gaussian of variance R, Poisson of expectation lambda."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def draw_noise(kind: str, level: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Draw additive measurement noise.

    Args:
        kind: one of `NOISES`.
        level: variance R [deg^2] of Gaussian noise; expectation lambda [deg] of Poisson noise (eq. 14).
        shape: shape of the result.
        rng: where the numbers come from.

    Returns:
        Noise to be added to the true angle [deg]. Poisson noise is not centred: its mean is lambda.

    Raises:
        ValueError: the kind is unknown or the level is negative.
    """
    if kind not in NOISES:
        raise ValueError(f"unknown noise {kind!r}; valid: {', '.join(NOISES)}")
    if not (np.isfinite(level) and level >= 0):
        raise ValueError(f"{kind} noise of level {level}: must be a number that is not negative")
    return NOISES[kind](level, shape, rng)


def noise_variance(kind: str, level: float) -> float:
    """Return the variance of a noise [deg^2]: what a filter is told as R.

    It is the level itself, plus the 1 / 12 of the uniform dither where there is one.
    """
    if kind not in NOISES:
        raise ValueError(f"unknown noise {kind!r}; valid: {', '.join(NOISES)}")
    return level + 1 / 12 if kind == "poisson-dithered" else level


def _gaussian(level: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    return np.sqrt(level) * rng.standard_normal(shape)


def _poisson(level: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    return rng.poisson(level, shape).astype(float)


def _dithered_poisson(level: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Poisson noise off its integer lattice, which would leak the angle: y mod 1 = theta mod 1."""
    return rng.poisson(level, shape) + rng.uniform(-0.5, 0.5, shape)


NOISES: dict[str, Callable[[float, tuple[int, ...], np.random.Generator], Array]] = {
    "gaussian": _gaussian,
    "poisson": _poisson,
    "poisson-dithered": _dithered_poisson,
}
