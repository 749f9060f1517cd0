"""Soundness of an estimator's state: numbers finite and of a possible size, covariances positive.

It is checked after each sample of a live stream, and so is quick on small arrays: Python compares a few
numbers in less time than NumPy takes to begin.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

LARGEST = 1e12
"""Magnitude that no number of a sound state comes near, a variance after hours without a sensor included."""
SMALL = 32  # numbers: arrays up to here are compared in Python
FEW = 4  # rows: matrices up to here are eliminated in Python
ROUNDING = 1e-9  # share of its variance that a pivot may lie below zero: lifted states begin with rank one


def is_sound(state: Any) -> bool:
    """Return whether all numbers of a state are sound, however deep in it they are."""
    if isinstance(state, np.ndarray):
        return _is_bounded(state)
    if isinstance(state, tuple):
        for part in state:
            if not is_sound(part):
                return False
        covariance = getattr(state, "covariance", None)
        return covariance is None or _is_positive(covariance)
    if isinstance(state, int | float | np.number | np.bool_):
        return -LARGEST < float(state) < LARGEST
    if isinstance(state, list | dict):
        return all(map(is_sound, state.values() if isinstance(state, dict) else state))
    if hasattr(state, "with_sensor") or not hasattr(state, "__dict__") or callable(state):
        return True
    return all(map(is_sound, vars(state).values()))


def _is_bounded(values: NDArray[Any]) -> bool:
    if values.size == 1:
        return bool(-LARGEST < values.item() < LARGEST)
    if values.size > SMALL:
        return bool(np.abs(values).max() < LARGEST)  # NaN is the largest, and not below
    numbers = values.ravel().tolist()
    return not numbers or all([-LARGEST < number < LARGEST for number in numbers])


def _is_positive(covariance: NDArray[Any]) -> bool:
    """True where (n, n) or (n, n, B) matrices have positive variances and no negative eigenvalue."""
    matrices = covariance[None] if covariance.ndim == 2 else np.moveaxis(covariance, -1, 0)
    if matrices.shape[-1] > FEW:
        diagonal = np.diagonal(matrices, axis1=-2, axis2=-1)
        return bool((diagonal > 0).all() and (np.linalg.eigvalsh(matrices) > -ROUNDING).all())
    return all(map(_has_pivots, matrices.tolist()))


def _has_pivots(rows: list[list[float]]) -> bool:
    """True where Gaussian elimination of a small matrix has no negative pivot (Sylvester's criterion)."""
    if len(rows) == 2:  # most filters, at every sample
        (p, r), (_, q) = rows
        return p > 0 and q > 0 and p * q - r * r > -ROUNDING * p * q
    variances = [row[k] for k, row in enumerate(rows)]
    if min(variances) <= 0:
        return False
    for k, (row, variance) in enumerate(zip(rows, variances, strict=True)):
        pivot = row[k]
        if pivot < -ROUNDING * variance:
            return False
        if pivot <= ROUNDING * variance:
            continue  # what is left of this coordinate follows from those before it
        for other in rows[k + 1 :]:
            share = other[k] / pivot
            for column in range(k, len(row)):
                other[column] -= share * row[column]
    return True
