"""Indices of the estimation error (eq. 13 of the RAM paper), and intervals of figures."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.estimation.gaussian import DEVIATIONS_OF_95

Array = NDArray[np.float64]
NARROWEST_DEG = 1e-3
"""Half of the narrowest interval [deg]: a belief of zero variance would be infinitely wrong."""


def error_indices(error_deg: Array) -> dict[str, Array]:
    """Return the indices of each error signal.

    The paper prints MD with squares, in deg^2, but tabulates it in degrees; its values fit
    mean |e - mean e|, which is `md_deg` here. The printed form is `md_printed_deg2`. Errors, estimate minus
    truth, are (..., N) [deg], indices (...).
    """
    error = np.asarray(error_deg, dtype=float)
    bias = error.mean(axis=-1)
    centred = error - bias[..., None]
    square = error**2
    return {
        "mae_deg": np.abs(error).mean(axis=-1),
        "rmse_deg": np.sqrt(square.mean(axis=-1)),
        "md_deg": np.abs(centred).mean(axis=-1),
        "md_printed_deg2": np.abs(square - bias[..., None] ** 2).mean(axis=-1),
        "var_deg2": (centred**2).mean(axis=-1),
        "bias_deg": bias,
    }


def interval_indices(error_deg: Array, half_width_deg: Array) -> dict[str, float]:
    """Return the calibration of stated 95 % intervals: errors and half widths of the same shape [deg].

    `coverage95` is the share of samples whose interval covers the truth; `width95_deg` its mean width; `nees`
    the mean square error in units of the variance of a normal distribution of that interval (Bar-Shalom et
    al. 2001), 1 where it is calibrated; `crps_deg` the mean continuous ranked probability score of that
    distribution (Gneiting and Raftery 2007, eq. 21).
    """
    from scipy.special import ndtr  # imported when used: cards of datasets need none of it

    half = np.maximum(half_width_deg, NARROWEST_DEG)
    sigma = half / DEVIATIONS_OF_95
    deviations = np.abs(error_deg) / sigma
    density = np.exp(-(deviations**2) / 2) / np.sqrt(2 * np.pi)
    score = sigma * (deviations * (2 * ndtr(deviations) - 1) + 2 * density - 1 / np.sqrt(np.pi))
    return {
        "coverage95": float((np.abs(error_deg) <= half).mean()),
        "width95_deg": float(2 * half.mean()),
        "nees": float((deviations**2).mean()),
        "crps_deg": float(score.mean()),
    }


def geometric_mean(values: Array, axis: int | None = None) -> Array:
    """Return the geometric mean of errors [deg], or of their ratios; one below 1e-9 counts as 1e-9."""
    mean: Array = np.exp(np.log(np.maximum(values, 1e-9)).mean(axis=axis))
    return mean


def jackknife(left_out: Sequence[Array]) -> tuple[float, float]:
    """Return the standard deviation of a figure, and its degrees of freedom, by a jackknife.

    `left_out` are the figures without each of the units of one kind, an array for each kind (Efron and
    Tibshirani 1993, section 11.2). The variances add up; the degrees of freedom are those of Satterthwaite
    (1946).
    """
    variances = [((len(of) - 1) * float(np.var(of)), len(of) - 1) for of in left_out]
    total = sum(variance for variance, _ in variances)
    squares = sum(variance**2 / freedom for variance, freedom in variances)
    return math.sqrt(total), total**2 / squares if squares else 1.0


def student_interval(
    figure: float, deviation: float, freedom: float, confidence: float = 0.95
) -> tuple[float, float]:
    """Return Student's t interval of a figure with a standard deviation of so many degrees of freedom."""
    from scipy.special import stdtrit  # imported when used: cards of datasets need none of it

    half = deviation * float(stdtrit(freedom, (1 + confidence) / 2))
    return figure - half, figure + half


def confidence_interval(values: Array, confidence: float = 0.95) -> tuple[float, float]:
    """Return Student's t interval of the mean of values whose rows and columns are independent.

    The variances of the means over rows and over columns add up (two crossed random effects); the degrees of
    freedom are those of the smaller number, so that the interval is rather too wide than too narrow. Values
    are (trainings, seeds) or (seeds,); where there is but one, both ends are the value itself.
    """
    table = np.atleast_2d(np.asarray(values, dtype=float))
    mean = float(table.mean())
    means = [side for side in (table.mean(axis=0), table.mean(axis=1)) if len(side) > 1]
    if not means:
        return mean, mean
    variance = sum(side.var(ddof=1) / len(side) for side in means)
    freedom = min(len(side) for side in means) - 1
    return student_interval(mean, float(np.sqrt(variance)), freedom, confidence)
