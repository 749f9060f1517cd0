"""Measurement noise in degrees: the RAM paper's Gaussian and Poisson, and others that it never trains on.

A kind of noise has one level. A filter knows the variance, a set-membership filter the largest magnitude;
Fisher's information is there for a Cramer-Rao bound.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.signals.sensor_errors import FAULTS, STEREO, SensorErrors, stereo_noise

Array = NDArray[np.float64]

OUTLIER_DEG = 10.0  # magnitude of an outlier of salt-and-pepper noise [deg]
BACKGROUND_DEG2 = 0.1  # variance of the Gaussian noise that outliers are added to, as in training [deg^2]
STUDENT_FREEDOM = 3  # degrees of freedom: heavy tails that still have a variance
GAMMA_SHAPE = 2.0
DITHER_DEG2 = 1 / 12  # variance of what dithers counts: even over their step of a degree [deg^2]


@dataclasses.dataclass(frozen=True)
class _Kind:
    """Kind of noise: how it is drawn, and its moments as functions of the level."""

    draw: Callable[[float, tuple[int, ...], np.random.Generator], Array]  # of a level and a shape [deg]
    variance: Callable[[float], float]  # [deg^2]
    mean: Callable[[float], float] = lambda level: 0.0  # [deg]
    bound: Callable[[float], float] = lambda level: np.inf  # largest magnitude [deg]
    information: Callable[[float], float | None] = lambda level: None  # [1 / deg^2]; None: not finite


def draw_noise(kind: str, level: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Draw additive measurement noise [deg] of a kind of `NOISES`, which gives its level a meaning.

    - gaussian, laplace, student-t, uniform, gamma: the variance R [deg^2];
    - poisson, poisson-dithered: the expectation lambda [deg] (eq. 14);
    - salt-and-pepper: the probability that a sample is off by +-`OUTLIER_DEG` besides its Gaussian noise.

    Poisson and gamma noise are not centred: their means are lambda and sqrt(`GAMMA_SHAPE` R).
    """
    known = _known(kind)
    if not (np.isfinite(level) and level >= 0):
        raise InputError(f"{kind} noise of level {level}: must be a number that is not negative")
    if kind == "salt-and-pepper" and level > 1:
        raise InputError(f"salt-and-pepper noise of level {level:g}: a probability is at most 1")
    return known.draw(level, shape, rng)


def draw_errors(
    kind: str, level: float, bend_deg: Array, sample_time: float, rng: np.random.Generator
) -> Array:
    """Draw the errors of a sensor along a true angle (N,) [deg]: noise, or those of one of `SENSORS`.

    They are NaN where nothing is measured.
    """
    sensor = SENSORS.get(kind)
    if sensor is None:
        return draw_noise(kind, level, bend_deg.shape, rng)
    if not 0 <= level <= sensor.most:
        raise InputError(f"{kind} noise of level {level}: must be from 0 to {sensor.most:g} {sensor.unit}")
    return sensor.draw(level, bend_deg, sample_time, rng)


def noise_variance(kind: str, level: float) -> float:
    """Return the variance of a noise [deg^2]: the R of a Kalman filter."""
    return SENSORS[kind].variance(level) if kind in SENSORS else _known(kind).variance(level)


def noise_mean(kind: str, level: float) -> float:
    """Return the mean of a noise [deg]; zero for the errors of a sensor."""
    return 0.0 if kind in SENSORS else _known(kind).mean(level)


def noise_bound(kind: str, level: float) -> float:
    """Return the largest magnitude of a noise [deg]; infinite where it is unbounded."""
    return np.inf if kind in SENSORS else _known(kind).bound(level)


def fisher_information(kind: str, level: float) -> float | None:
    """Return the Fisher information of one sample about the angle, the integral of p'^2 / p [1 / deg^2].

    It is at least 1 / variance, and equals it for Gaussian noise alone (Fisher 1925). None where it is not
    finite: on a lattice, where the density jumps, and at the edge of the gamma law.
    """
    return None if kind in SENSORS else _known(kind).information(level)


def _known(kind: str) -> _Kind:
    if kind not in NOISES:
        raise InputError(f"unknown noise {kind!r}; valid: {', '.join(NOISES)}")
    return NOISES[kind]


def _gaussian(level: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    noise: Array = np.sqrt(level) * rng.standard_normal(shape)
    return noise


def _dithered_poisson(level: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Draw Poisson noise off its integer lattice, which would leak the angle: y mod 1 = theta mod 1."""
    noise: Array = rng.poisson(level, shape) + rng.uniform(-0.5, 0.5, shape)
    return noise


def _student_scale(level: float) -> float:
    return float(np.sqrt(level * (STUDENT_FREEDOM - 2) / STUDENT_FREEDOM))


def _student_information(level: float) -> float:
    return (STUDENT_FREEDOM + 1) / (STUDENT_FREEDOM + 3) / _student_scale(level) ** 2


def _salt_and_pepper(level: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    outlier = rng.choice([-OUTLIER_DEG, OUTLIER_DEG], shape) * (rng.uniform(size=shape) < level)
    noise: Array = _gaussian(BACKGROUND_DEG2, shape, rng) + outlier
    return noise


def _salt_and_pepper_information(level: float) -> float:
    """Return the Fisher information of the mixture of three normal densities of one width."""
    places = np.array([-OUTLIER_DEG, 0.0, OUTLIER_DEG])
    weights = np.array([level / 2, 1 - level, level / 2])
    noise = np.linspace(-OUTLIER_DEG - 3, OUTLIER_DEG + 3, 20_001)
    away = noise[:, None] - places
    bells = weights * np.exp(-(away**2) / (2 * BACKGROUND_DEG2)) / np.sqrt(2 * np.pi * BACKGROUND_DEG2)
    density, slope = bells.sum(axis=1), -(bells * away / BACKGROUND_DEG2).sum(axis=1)
    score = np.divide(slope**2, density, out=np.zeros_like(slope), where=density > 0)
    return float(np.trapezoid(score, noise))


NOISES: dict[str, _Kind] = {
    "gaussian": _Kind(_gaussian, float, information=lambda level: 1 / level),
    "poisson": _Kind(lambda level, shape, rng: rng.poisson(level, shape).astype(float), float, mean=float),
    "poisson-dithered": _Kind(_dithered_poisson, lambda level: level + DITHER_DEG2, mean=float),
    "laplace": _Kind(
        lambda level, shape, rng: rng.laplace(0.0, np.sqrt(level / 2), shape),
        float,
        information=lambda level: 2 / level,
    ),
    "student-t": _Kind(
        lambda level, shape, rng: _student_scale(level) * rng.standard_t(STUDENT_FREEDOM, shape),
        float,
        information=_student_information,
    ),
    "uniform": _Kind(
        lambda level, shape, rng: rng.uniform(-np.sqrt(3 * level), np.sqrt(3 * level), shape),
        float,
        bound=lambda level: float(np.sqrt(3 * level)),
    ),
    "salt-and-pepper": _Kind(
        _salt_and_pepper,
        lambda level: BACKGROUND_DEG2 + level * OUTLIER_DEG**2,
        information=_salt_and_pepper_information,
    ),
    "gamma": _Kind(
        lambda level, shape, rng: rng.gamma(GAMMA_SHAPE, np.sqrt(level / GAMMA_SHAPE), shape),
        float,
        mean=lambda level: float(np.sqrt(GAMMA_SHAPE * level)),
    ),
}
"""Kinds of noise by name. The order is fixed: streams of random numbers are named by the place."""
SENSORS: dict[str, SensorErrors] = {
    STEREO: SensorErrors(
        "Stereo vision, {:g} passes / min",
        "passes a minute",
        60,  # more instruments in a minute hide it for good
        lambda level, bend_deg, T, rng: stereo_noise().draw(level, bend_deg, T, rng),
        lambda level: stereo_noise().variance,
    ),
    **FAULTS,
}
"""Errors along a record, by name: what was measured of the stereo sensor, and faults."""
KINDS = (*NOISES, *SENSORS)
"""Names of the errors that a sensor can have. The order is fixed, as that of `NOISES`."""
