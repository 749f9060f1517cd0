"""Identification of the Prandtl-Ishlinskii model: non-negative least squares (Lawson and Hanson 1974).

The angle is linear in the weights, so the problem is convex: no seed, no search.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from twin.errors import InputError
from twin.hysteresis import PrandtlIshlinskii
from twin.hysteresis.prandtl_ishlinskii import plays_along
from twin.identification.error import Records, check, mean_square_error

Array = NDArray[np.float64]

PLAYS = 8
"""Number of plays where no thresholds are given."""


def identify_prandtl_ishlinskii(
    records: Records, *, thresholds_mm: Sequence[float] = ()
) -> tuple[PrandtlIshlinskii, float]:
    """Fit the weights of one Prandtl-Ishlinskii model to all records.

    The first angle of a record is measured with noise that a play never forgets, so the level of each record
    is left free in the fit. The error that is returned is that of the response from the measured first angle,
    as for other models.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` of each record, its first pull reached from rest at zero.
        thresholds_mm: of the plays; if not given, `spread_thresholds`.

    Returns:
        The best model and its RMSE over all samples [deg].

    Raises:
        ValueError: there is no record, a command does not move or never reverses, a value is not finite, or
            the thresholds are negative or not all different.
    """
    check(records)
    thresholds = tuple(map(float, thresholds_mm)) or spread_thresholds(records)
    if not (
        np.isfinite(thresholds).all() and min(thresholds) >= 0 and len(set(thresholds)) == len(thresholds)
    ):
        raise InputError(f"thresholds {list(thresholds)} mm: must be different and not negative")
    plays = np.concatenate([_centred(plays_along(pull, thresholds)) for pull, _ in records], axis=1)
    bend = np.concatenate([_centred(angle) for _, angle in records])
    weights, _ = nnls(plays.T, bend)
    model = PrandtlIshlinskii(tuple(map(float, weights)), thresholds)
    return model, float(np.sqrt(mean_square_error(model, records)))


def spread_thresholds(records: Records) -> tuple[float, ...]:
    """Return `PLAYS` thresholds [mm], evenly spaced from 0 to just below half the largest command range.

    A play of half the range is dragged once and never comes back.
    """
    half = max(float(np.ptp(pull)) for pull, _ in records) / 2
    return tuple(float(threshold) for threshold in np.arange(PLAYS) * half / PLAYS)


def _centred(values: Array) -> Array:
    centred: Array = values - values.mean(axis=-1, keepdims=True)
    return centred
