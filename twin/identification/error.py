"""Identification records: validation and mean square error of a response."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]
Records = Sequence[tuple[Array, Array]]
"""Records as pairs of pulling distance (N,) [mm] and bending angle (N,) [deg]."""

NEVER_REVERSES = "the command never reverses: a loop needs at least one reversal to identify hysteresis"
DIVERGED = 1e12
"""Mean square error given to a response that is not finite [deg^2]."""


def check(records: Records) -> None:
    """Check that a hysteresis model can be identified from the records.

    Raises:
        ValueError: there is no record, a command does not move or never reverses, or a value is not finite.
    """
    if not records:
        raise InputError("no record to identify from")
    for index, (pull, bend) in enumerate(records):
        if not (np.isfinite(pull).all() and np.isfinite(bend).all()):
            raise InputError(f"record {index}: command and angle must be finite")
        if not (np.abs(np.diff(pull)) > 1e-9).any():
            raise InputError(f"record {index}: the command never moves")
    if not any((np.diff(pull) > 0).any() and (np.diff(pull) < 0).any() for pull, _ in records):
        raise InputError(NEVER_REVERSES)


class Stack:
    """Records of any length stacked into one array: shorter ones are padded, with zero weight there."""

    def __init__(self, records: Records):
        samples = max(len(pull) for pull, _ in records)
        self.pull = np.stack([np.pad(pull, (0, samples - len(pull)), mode="edge") for pull, _ in records])
        self.bend = np.stack([np.pad(bend, (0, samples - len(bend))) for _, bend in records])
        self.weight = np.stack([np.arange(samples) < len(pull) for pull, _ in records])

    def error(self, model: HysteresisModel) -> Array:
        """Return response minus angle, (..., records, N) [deg]; 0 where a record has ended.

        The response starts from the measured angle at the first sample.
        """
        return np.where(self.weight, model.response(self.pull, self.bend[:, 0]) - self.bend, 0)

    def mean_square_error(self, model: HysteresisModel) -> Array:
        """Return `mean_square_error` of these records."""
        with np.errstate(over="ignore", invalid="ignore"):
            total = (self.error(model) ** 2).sum(axis=(-1, -2))
        mean: Array = np.nan_to_num(total / self.weight.sum(), nan=DIVERGED, posinf=DIVERGED)
        return mean


def mean_square_error(model: HysteresisModel, records: Records) -> Array:
    """Return the mean square error over all samples of all records [deg^2].

    Args:
        model: of one set of parameters, or of candidates: each parameter of shape (candidates, 1).
        records: `(pull_mm (N,), bend_deg (N,))` of each record.

    Returns:
        A scalar array or (candidates,); `DIVERGED` where a candidate diverges.
    """
    return Stack(records).mean_square_error(model)
