"""Score functions of innovations: noise density convolved with a normal belief of the angle.

An innovation is noise plus what is not yet known of the angle, here normal with standard deviation s. Its
log-density has the slope -score(innovation); a filter moves its belief by that score (Masreliez 1975). For
Gaussian noise the score is innovation / (R + s^2), the Kalman filter's.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, special, stats

from twin.errors import InputError
from twin.signals.noise import (
    BACKGROUND_DEG2,
    DITHER_DEG2,
    GAMMA_SHAPE,
    OUTLIER_DEG,
    STUDENT_FREEDOM,
    noise_variance,
)
from twin.signals.sensor_errors import STEREO, stereo_noise

Array = NDArray[np.float64]

_SPREADS = np.geomspace(0.03, 60.0, 30)  # s [deg]
_MOST_DITHER = 0.1  # share of the variance up to which a dithered density is that of the noise
_INNOVATIONS = 150 * np.sinh(np.linspace(-7, 7, 2001)) / np.sinh(7)  # [deg], dense about zero


@dataclasses.dataclass(frozen=True)
class NoiseDensity:
    """Score of innovations and its mean slope, tabulated over the standard deviation s of the belief."""

    mean: float  # of the noise [deg]
    variance: float  # R of the noise [deg^2]
    scores: Array  # (spreads, innovations), (R + s^2) times the score [deg]
    informations: Array  # (spreads,), (R + s^2) times the Fisher information of an innovation
    log_densities: Array  # as `scores`: (R + s^2) times the log-density below its largest
    log_peaks: Array  # (spreads,) largest log-density of an innovation
    rough: bool = False  # it only stands for the sensor: counts with little dither, errors of the angle

    def log_density(self, innovation_deg: Array, spread_deg: float) -> Array:
        """Return the log-density of innovations [of 1 / deg]; arguments as in `score`."""
        row, peak = _between(self.log_densities, spread_deg), _between(self.log_peaks, spread_deg)
        found: Array = peak + np.interp(innovation_deg, _INNOVATIONS, row) / (self.variance + spread_deg**2)
        return found

    def score(self, innovation_deg: Array, spread_deg: float) -> Array:
        """Return the score (B,) [1 / deg] of innovations (B,) [deg] at a standard deviation of the belief."""
        row = _between(self.scores, spread_deg)
        score: Array = np.interp(innovation_deg, _INNOVATIONS, row) / (self.variance + spread_deg**2)
        return score

    def information(self, spread_deg: float) -> float:
        """Return the Fisher information of an innovation [1 / deg^2]: the mean slope of the score."""
        return float(_between(self.informations, spread_deg)) / (self.variance + spread_deg**2)


@functools.lru_cache
def noise_density(kind: str, level: float) -> NoiseDensity:
    """Return the density of a noise of `twin.signals.noise`.

    Integer Poisson noise has the density of the dithered one: the lattice would give the angle away, and
    no estimator is to profit from that.
    """
    if kind not in _MIXTURES:
        raise InputError(f"no density of {kind!r} noise; valid: {', '.join(_MIXTURES)}")
    weights, places, variances, widths = np.broadcast_arrays(*_MIXTURES[kind](level))
    scores = np.empty((len(_SPREADS), len(_INNOVATIONS)))
    informations, peaks = np.empty(len(_SPREADS)), np.empty(len(_SPREADS))
    for row, spread in enumerate(_SPREADS):
        density, slope = _mixture(_INNOVATIONS[:, None] - places, variances + spread**2, widths)
        density, slope = density @ weights, slope @ weights
        known = np.flatnonzero(density > 1e-14)
        # Outside of the support the score is extended by its last value.
        inside = np.clip(np.arange(len(density)), known[0], known[-1])
        scores[row] = (-slope / np.maximum(density, 1e-14))[inside]
        informations[row] = integrate.trapezoid(scores[row] ** 2 * density, _INNOVATIONS)
        peaks[row] = np.log(density.max())
    variance = noise_variance(kind, level)
    unit = variance + _SPREADS**2
    mean = float(np.sum(weights * places))
    scores *= unit[:, None]
    logs = -integrate.cumulative_trapezoid(scores, _INNOVATIONS, axis=1, initial=0.0)
    logs -= logs.max(axis=1, keepdims=True)
    dithered = kind == "poisson" and _MOST_DITHER * (level + DITHER_DEG2) < DITHER_DEG2
    rough = dithered or kind == STEREO
    return NoiseDensity(mean, variance, scores, informations * unit, logs, peaks, rough)


def family_densities(variance: float) -> list[NoiseDensity]:
    """Return the density of each family that has a law of this variance [deg^2]."""
    levels = dict.fromkeys(_BY_VARIANCE, variance)
    outliers = (variance - BACKGROUND_DEG2) / OUTLIER_DEG**2
    if 0 < outliers <= 1:
        levels["salt-and-pepper"] = outliers
    return [noise_density(*family) for family in levels.items()]


def _mixture(away: Array, variance: Array, width: Array) -> tuple[Array, Array]:
    """Return density and slope of components: normal laws, optionally smeared evenly over a width."""
    deviation = np.sqrt(variance)
    if not width.any():
        density = np.exp(-(away**2) / (2 * variance)) / np.sqrt(2 * np.pi) / deviation
        return density, -away / variance * density
    upper, lower = (away + width / 2) / deviation, (away - width / 2) / deviation
    # The far side of a normal law keeps its digits: both ends are taken there.
    side = np.where(away > 0, -1.0, 1.0)
    density = np.abs(special.ndtr(side * upper) - special.ndtr(side * lower)) / width
    bells = (np.exp(-(upper**2) / 2) - np.exp(-(lower**2) / 2)) / np.sqrt(2 * np.pi) / deviation
    return density, bells / width


def _between(rows: Array, spread_deg: float) -> Array:
    """Return the row of a table at a spread, linear in its logarithm between those of `_SPREADS`."""
    position = np.log(max(spread_deg, _SPREADS[0]) / _SPREADS[0]) / np.log(_SPREADS[1] / _SPREADS[0])
    lower = min(int(position), len(_SPREADS) - 2)
    share = min(float(position) - lower, 1.0)
    row: Array = (1 - share) * rows[lower] + share * rows[lower + 1]
    return row


_Mixture = tuple[Any, Any, Any, Any]  # weights, places, variances and widths of the components


def _poisson(level: float) -> _Mixture:
    counts = np.arange(int(stats.poisson(level).ppf(1 - 1e-12)) + 2)
    return stats.poisson(level).pmf(counts), counts, 0.0, 1.0


def _laplace(level: float) -> _Mixture:
    """Laplace law as a normal one of exponential variance, of mean R (Andrews and Mallows 1974)."""
    edges = np.concatenate([[0.0], np.geomspace(1e-6, 40, 200), [np.inf]])
    weights = -np.diff(np.exp(-edges))
    return weights, 0.0, level * np.concatenate([[5e-7], np.sqrt(edges[1:-2] * edges[2:-1]), [41.0]]), 0.0


def _student(level: float) -> _Mixture:
    """Student's t law as a normal one of gamma-distributed precision."""
    precision = stats.gamma(STUDENT_FREEDOM / 2, scale=2 / STUDENT_FREEDOM)
    edges = np.concatenate([[0.0], np.geomspace(1e-6, 20, 200), [np.inf]])
    middle = np.concatenate([[5e-7], np.sqrt(edges[1:-2] * edges[2:-1]), [20.0]])
    scale = level * (STUDENT_FREEDOM - 2) / STUDENT_FREEDOM
    return np.diff(precision.cdf(edges)), 0.0, scale / middle, 0.0


def _salt_and_pepper(level: float) -> _Mixture:
    weights = np.array([level / 2, 1 - level, level / 2])
    return weights, np.array([-OUTLIER_DEG, 0.0, OUTLIER_DEG]), BACKGROUND_DEG2, 0.0


def _gamma(level: float) -> _Mixture:
    """Gamma law as narrow uniform bins: no mixture of normal laws has its edge."""
    law = stats.gamma(GAMMA_SHAPE, scale=np.sqrt(level / GAMMA_SHAPE))
    edges = np.sqrt(level) * np.concatenate([np.linspace(0, 8, 500), np.linspace(8, 20, 60)[1:]])
    return np.diff(law.cdf(edges)), (edges[1:] + edges[:-1]) / 2, 0.0, np.diff(edges)


def _stereo(level: float) -> _Mixture:
    """Errors of the stereo sensor over all angles, as uniform bins: their dependence on the angle is lost."""
    counts, edges = np.histogram(stereo_noise().errors_deg, bins=40)
    return counts / counts.sum(), (edges[1:] + edges[:-1]) / 2, 0.0, np.diff(edges)


_MIXTURES: dict[str, Callable[[float], _Mixture]] = {
    "gaussian": lambda level: (1.0, np.zeros(1), level, 0.0),
    "poisson": _poisson,
    "poisson-dithered": _poisson,
    "laplace": _laplace,
    "student-t": _student,
    "uniform": lambda level: (1.0, np.zeros(1), 0.0, np.sqrt(12 * level)),
    "salt-and-pepper": _salt_and_pepper,
    "gamma": _gamma,
    STEREO: _stereo,
}

_BY_VARIANCE = ("gaussian", "poisson", "laplace", "student-t", "uniform", "gamma")
"""Families whose level is their variance."""
