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


FIXED = 0.3  # standard deviation of a positive parameter that is not fitted, on the scale of the search
SHARED = 1.5  # times by which a fixed parameter widens an uncertainty that is then stated to depend on it


@dataclasses.dataclass(frozen=True)
class Uncertainty:
    """Standard deviations and correlations of fitted parameters."""

    # standard deviation of each parameter by name, in its own unit: with those that are not fitted fixed, and
    # in all, with these uncertain by 30 % or, where they may be negative, by a step of the search
    deviation: dict[str, float]
    total: dict[str, float]
    correlation: Array  # correlation of the estimates, (P, P)
    zero_deviation: float  # of the sensor's zero in all [rad]; NaN if it is not known
    warnings: tuple[str, ...]  # one sentence for each parameter or pair that the logs do not determine
    conditions: tuple[str, ...]  # one sentence for each parameter that is known only by a fixed one


def uncertainty(fit: Fit) -> Uncertainty:
    """Estimate standard deviations and correlations by linearised least squares.

    The covariance is s^2 (J^T J)^-1 (Seber and Wild 1989), with s^2 of `variance_of`, and more where a walk
    found other valleys that explain the logs: `_between`. In all, parameters that are not fitted are treated
    as fitted ones with a prior.
    """
    free, count = fit.free, len(fit.free.names)
    finite = np.isfinite(fit.jacobian).all(axis=0)
    residual, jacobian = fit.residual, np.where(finite, fit.jacobian, 0.0)
    variance = variance_of(residual, jacobian.shape[1])
    covariance = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12) * variance
    everything = covariance
    if fit.fixed and variance > 0:
        both = np.hstack([jacobian, fit.fixed_jacobian])
        prior = np.array([0.0] * count + [1.0 if name in SIGNED else FIXED**-2 for name in fit.fixed])
        everything = np.linalg.pinv(both.T @ both / variance + np.diag(prior), rcond=1e-12)
    slope = fit.zero_slope[: len(everything)]
    zero_deviation = float(np.sqrt(slope @ everything @ slope)) if slope.size else np.nan
    between = _between(fit.neighbours, jacobian, variance) if fit.neighbours.size and variance > 0 else 0.0
    covariance, in_all = covariance + between, everything[:count, :count] + between
    blind = np.abs(jacobian).max(axis=0) < 1e-9  # no residual depends on the parameter
    covariance[blind] = covariance[:, blind] = 0.0
    deviation, total = (
        np.where(blind, np.inf, np.sqrt(np.maximum(np.diag(of), 0.0))) for of in (covariance, in_all)
    )
    total = np.maximum(total, deviation)
    scale = np.where(np.isfinite(deviation) & (deviation > 0), deviation, 1.0)
    correlation = covariance / np.outer(scale, scale)
    return Uncertainty(
        free.standard_deviation(fit.preset, deviation),
        free.standard_deviation(fit.preset, total),
        correlation,
        zero_deviation,
        tuple(_warnings(fit, free, deviation, correlation)),
        tuple(_conditions(fit, deviation, total, everything)),
    )


def _conditions(fit: Fit, deviation: Array, total: Array, everything: Array) -> list[str]:
    """Return, for each parameter that is not fitted, those that the logs determine only together with it."""
    count, found = len(fit.free.names), dict[str, list[str]]()
    apart = np.sqrt(np.diag(everything)[count:])
    apart[apart == 0] = np.inf  # what the logs do not feel is bound to nothing
    alone, all_of = (fit.free.standard_deviation(fit.preset, of) for of in (deviation, total))
    for place, name in enumerate(fit.free.names):
        if fit.fixed and np.isfinite(deviation[place]) and total[place] > SHARED * deviation[place]:
            shared = np.abs(everything[place, count:]) / apart
            value = getattr(fit.preset, name)
            found.setdefault(fit.fixed[int(shared.argmax())], []).append(
                f"{name} {value:.3g} +- {alone[name]:.2g} (+- {all_of[name]:.2g} with it free)"
            )
    return [
        f"with {of} fixed at {getattr(fit.preset, of):.4g}: {', '.join(what)}; the logs cannot separate them"
        for of, what in found.items()
    ]


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
        if name.startswith("sensor"):  # it is no part of the endoscope
            continue
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
            warnings.append(f"{name} = {value:.4g} is at its limit: the logs do not determine it")
        elif name not in SIGNED and d > BLIND:
            warnings.append(f"{name} = {value:.4g}: the logs do not determine it")
        elif name not in SIGNED and d > UNKNOWN:
            warnings.append(f"{name} = {value:.4g} is uncertain by a factor of {np.exp(d):.2g}")
    for i, j in np.argwhere(np.abs(np.tril(correlation, -1)) > ENTANGLED):
        pair = f"{free.names[j]} and {free.names[i]}"
        warnings.append(f"{pair} cannot be determined separately ({correlation[i, j]:+.3f})")
    return warnings
