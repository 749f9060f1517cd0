"""One-step prediction errors of a model of hysteresis, measurement by measurement, along whole records."""

import numpy as np
from numpy.typing import NDArray

from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]


def surprises(
    model: HysteresisModel, pull_mm: Array, measurement_deg: Array, memory: Array
) -> tuple[Array, Array]:
    """Return each measurement less the model's prediction of it from the measurement before.

    Args:
        model: of hysteresis.
        pull_mm: (N, B).
        measurement_deg: (N, B), none missing.
        memory: (m, B) of the model at the first sample.

    Returns:
        (N - 1, B) differences [deg], and the (m, B) memory at the last sample.
    """
    path = np.empty((len(memory), *pull_mm.shape))  # the command alone moves the memory
    if len(memory):
        path[:, 0] = memory
        for k in range(1, len(pull_mm)):
            _, path[:, k] = model.step(measurement_deg[k - 1], path[:, k - 1], pull_mm[k], pull_mm[k - 1])
    before, pull, previous = measurement_deg[:-1], pull_mm[1:], pull_mm[:-1]
    flat = path[:, :-1].reshape(len(path), before.size)
    foretold, _ = model.step(before.ravel(), flat, pull.ravel(), previous.ravel())
    return measurement_deg[1:] - foretold.reshape(before.shape), path[:, -1]


def affine_step(
    model: HysteresisModel, memory: Array, pull_mm: Array, previous_pull_mm: Array
) -> tuple[Array, Array, Array]:
    """Return keep and drive [deg] of a step keep theta + drive, and the memory of the model behind it."""
    rest = np.zeros_like(pull_mm)
    drive, after = model.step(rest, memory, pull_mm, previous_pull_mm)
    return model.slope(rest, pull_mm, previous_pull_mm), drive, after


def affine_steps(model: HysteresisModel, pull_mm: Array) -> tuple[Array, Array]:
    """Return keep and drive, (records, N) each, of the steps keep theta + drive to each sample."""
    keep, drive = np.ones_like(pull_mm), np.zeros_like(pull_mm)
    memory = model.start(pull_mm[:, 0])
    for k in range(1, pull_mm.shape[1]):
        keep[:, k], drive[:, k], memory = affine_step(model, memory, pull_mm[:, k], pull_mm[:, k - 1])
    return keep, drive
