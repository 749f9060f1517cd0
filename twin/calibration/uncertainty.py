"""Uncertainty of fitted parameters, and warnings about those that the logs do not determine."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.calibration.descent import variance_of
from twin.calibration.parameters import SIGNED, FreeParameters
from twin.calibration.search import Fit
from twin.preset.preset import parameter_limits
from twin.preset.randomization import Ranges

Array = NDArray[np.float64]

UNKNOWN = 0.5  # relative standard deviation above which a positive parameter counts as poorly known
BLIND = 3.0  # above which it counts as unknown: a factor of 20
ENTANGLED = 0.98  # correlation above which two parameters are known only in combination


@dataclasses.dataclass(frozen=True)
class Uncertainty:
    """Standard deviations and correlations of fitted parameters."""

    deviation: dict[str, float]  # standard deviation of each parameter by name, in its own unit
    correlation: Array  # correlation of the estimates, (P, P)
    warnings: tuple[str, ...]  # one sentence for each parameter or pair that the logs do not determine


def uncertainty(fit: Fit) -> Uncertainty:
    """Estimate standard deviations and correlations by linearised least squares.

    The covariance is s^2 (J^T J)^-1 (Seber and Wild 1989), with s^2 of `variance_of`, and more where a walk
    met valleys that explain the logs too: `_between`.
    """
    free = fit.free
    finite = np.isfinite(fit.jacobian).all(axis=0)
    residual, jacobian = fit.residual, np.where(finite, fit.jacobian, 0.0)
    variance = variance_of(residual, jacobian.shape[1])
    covariance = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12) * variance
    if fit.neighbours.size and variance > 0:
        covariance += _between(fit.neighbours, jacobian, variance)
    blind = np.abs(jacobian).max(axis=0) < 1e-9  # no residual feels the parameter
    covariance[blind] = covariance[:, blind] = 0.0
    deviation = np.where(blind, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    scale = np.where(np.isfinite(deviation) & (deviation > 0), deviation, 1.0)
    correlation = covariance / np.outer(scale, scale)
    return Uncertainty(
        free.standard_deviation(fit.preset, deviation),
        correlation,
        tuple(_warnings(fit, free, deviation, correlation)),
    )


def _between(neighbours: Array, jacobian: Array, variance: float) -> Array:
    """Return the mean square distance (P, P) of the fit from its neighbours, by their likelihood.

    A point counts by its likelihood, exp(-rise / 2 s^2), less that of linear theory about the fit,
    exp(-|J d|^2 / 2 s^2). Each stands for a valley as wide as that of the fit, which is a rule of thumb.
    """
    away = neighbours[:, 1:]
    likely = np.exp(-np.maximum(neighbours[:, 0], 0.0) / (2 * variance))
    known = np.exp(-((away @ jacobian.T) ** 2).sum(axis=1) / (2 * variance))
    missing = np.maximum(likely - known, 0.0)
    square: Array = (away.T * (missing / (1 + missing.sum()))) @ away
    return square


def likely_ranges(fit: Fit, known: Uncertainty) -> Ranges:
    """Return ranges for domain randomisation: three standard deviations about each fitted parameter.

    A parameter that the logs do not determine is drawn within a factor of 3, or one step of the search where
    it may be negative; all stay within their physical limits.
    """
    ranges = []
    for name in fit.free.names:
        value, deviation = getattr(fit.preset, name), known.deviation[name]
        least, most = parameter_limits(name)
        if name in SIGNED:
            reach = min(3 * deviation, SIGNED[name])
            low, high = value - reach, value + reach
        else:
            factor = np.exp(min(3 * deviation, np.log(3.0) * value) / value) if value > 0 else 1.0
            low, high = value / factor, value * factor
        low, high = (float(np.clip(float(f"{end:.4g}"), least, most)) for end in (low, high))
        if low < high:
            ranges.append((name, low, high))
    return Ranges(tuple(ranges))


def _warnings(fit: Fit, free: FreeParameters, deviation: Array, correlation: Array) -> list[str]:
    numbers = free.encode(fit.preset)
    warnings = []
    places = zip(free.names, numbers, free.lower, free.upper, deviation, strict=True)
    for name, number, low, high, d in places:
        value = getattr(fit.preset, name)
        if not np.isfinite(d):
            warnings.append(f"{name}: the logs do not depend on it")
        elif min(number - low, high - number) < 1e-2:
            warnings.append(f"{name} = {value:.4g} ran to its limit: the logs do not determine it")
        elif name not in SIGNED and d > BLIND:
            warnings.append(f"{name} = {value:.4g}: the logs do not determine it")
        elif name not in SIGNED and d > UNKNOWN:
            warnings.append(f"{name} = {value:.4g} is known to a factor of {np.exp(d):.2g} only")
    for i, j in np.argwhere(np.abs(np.tril(correlation, -1)) > ENTANGLED):
        pair = f"{free.names[j]} and {free.names[i]}"
        warnings.append(f"{pair} cannot be determined separately ({correlation[i, j]:+.3f})")
    return warnings
