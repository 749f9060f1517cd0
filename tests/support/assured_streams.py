"""Streams for the assured estimator: an endoscope of Coleman and Hodgdon, estimators of any worth."""

import dataclasses
import math
from typing import Any

import numpy as np
from models import COLEMAN_HODGDON
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator
from twin.estimation.gaussian import Belief
from twin.runtime.assured import AssuredEstimator
from twin.runtime.deployment import Deployment

Array = NDArray[np.float64]
T = 0.1
R = 0.1
FALLBACK = ActiveModel(COLEMAN_HODGDON, T, (1e-3, 4e-2), R, (100.0, 1.0))
DEPLOYMENT = Deployment(FALLBACK, (1.5, 4.5), (40.0, 90.0), 2.0, 40.0)


@dataclasses.dataclass(frozen=True)
class Offset(ActiveModel):
    """A filter whose estimate is off by a constant from some angle on: what a bad policy looks like.

    Attributes:
        offset_deg: that it is off by [deg].
        from_deg: where [deg].
    """

    offset_deg: float = 0.0
    from_deg: float = -math.inf

    def bend_deg(self, state: Belief) -> Array:
        """Return the estimate [deg]."""
        bend: Array = state.mean[0] + self.offset_deg * (state.mean[0] > self.from_deg)
        return bend

    def single(self) -> Any:
        """Return it as a batch of one: its estimate is not that of its state."""
        return Estimator.single(self)


@dataclasses.dataclass(frozen=True)
class Runaway(Offset):
    """A filter that goes astray by a constant rate; without a finite one no step of it is sound.

    Attributes:
        rate_deg_s: that its angle runs away with [deg / s].
    """

    rate_deg_s: float = 0.0

    def step(self, state: Belief, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array) -> Belief:
        """Return the belief one sample later."""
        mean, covariance, *rest = super().step(
            state, pull_mm, previous_pull_mm, np.full_like(pull_mm, np.nan)
        )
        return Belief(mean + np.array([[self.rate_deg_s * self.sample_time], [0.0]]), covariance, *rest)


def stream(samples: int, seed: int = 0, noise_deg: float = math.sqrt(R)) -> tuple[Array, Array, Array]:
    """Return pull [mm], true angle and measurement [deg] of an endoscope that drifts from its model."""
    time = np.arange(samples) * T
    pull = 3 + np.sin(2 * np.pi * time / 12)
    truth = COLEMAN_HODGDON.response(pull, 60.0) + 2 * np.sin(2 * np.pi * time / 40)
    return pull, truth, truth + noise_deg * np.random.default_rng(seed).standard_normal(samples)


def assured(advanced: Estimator[Any] = FALLBACK, initial_deg: float = 65.0) -> AssuredEstimator:
    """Return a pair of an estimator and the fallback, before its first sample."""
    return AssuredEstimator("test", advanced, DEPLOYMENT, T, R, initial_deg)
