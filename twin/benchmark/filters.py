"""Numerical stability of the Kalman filters: valid covariances over a million samples at extreme scales."""

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twin.benchmark.result import Result
from twin.estimation.active_model import ActiveModel, KalmanActiveModel, UnscentedActiveModel
from twin.estimation.gaussian import Belief
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]
OnProgress = Callable[[int, int], None]

FILTERS: tuple[type[ActiveModel], ...] = (KalmanActiveModel, ActiveModel, UnscentedActiveModel)
# Q, R and P may be scaled by one factor without changing the gain: at one Q, R and P span all ratios.
MEASUREMENT_VARIANCES = (1e-12, 1.0, 1e12)
INITIAL_VARIANCES = (1e-12, 1e12)
PERIOD = 1000  # samples that the command repeats
AT_ONCE = 1000  # covariances that are looked at together


def covariances(steps: int = 1_000_000, on_progress: OnProgress | None = None) -> Result:
    """Measure the least 1 - correlation^2 of the covariances of KF, EKF and UKF at extreme Q, R and P."""
    margins = []
    for done, filter_type in enumerate(FILTERS):
        margins.append(least_margin(filter_type, steps))
        if on_progress:
            on_progress(done + 1, len(FILTERS))
    margin = min(margins)
    return Result(
        f"least 1 - correlation^2 over {steps} samples of {', '.join(kind.__name__ for kind in FILTERS)}",
        margin,
        "",
        "every covariance symmetric and positive",
        margin > 0,
    )


def least_margin(filter_type: type[ActiveModel], steps: int) -> float:
    """Return the least 1 - correlation^2 of theta and f; minus infinity where a covariance is invalid."""
    settings = np.array(list(itertools.product(MEASUREMENT_VARIANCES, INITIAL_VARIANCES))).T
    active_model = filter_type(ColemanHodgdon(1.15, 22.38, 5.0), 0.1, measurement_variance=settings[0])
    rng = np.random.default_rng(0)
    phase = 2 * np.pi * np.arange(PERIOD) / PERIOD
    pull = 3 + np.sin(phase) + 0.3 * np.sin(7 * phase)
    pull[300:400] = pull[300]  # the command rests
    pulls = np.repeat(pull[:, None], settings.shape[1], axis=1)
    measurements = 60 + rng.standard_normal(pulls.shape)
    belief = active_model.start(pulls[0], np.full(settings.shape[1], 60.0))
    belief = Belief(belief.mean, np.eye(2)[:, :, None] * settings[1], belief.memory)
    least = np.inf
    seen = []
    for k in range(1, steps + 1):
        belief = active_model.step(
            belief, pulls[k % PERIOD], pulls[(k - 1) % PERIOD], measurements[k % PERIOD]
        )
        seen.append(belief.covariance)
        if len(seen) == AT_ONCE or k == steps:
            least = min(least, _margin(np.stack(seen)))
            seen.clear()
    return least


def _margin(covariance: Array) -> float:
    """Return the least 1 - correlation^2 of covariances (N, 2, 2, B)."""
    variance = np.stack([covariance[:, 0, 0], covariance[:, 1, 1]])
    symmetric = np.array_equal(covariance[:, 0, 1], covariance[:, 1, 0])
    if not (np.isfinite(covariance).all() and symmetric and (variance > 0).all()):
        return -np.inf
    return float((1 - covariance[:, 0, 1] / variance[0] * covariance[:, 0, 1] / variance[1]).min())
