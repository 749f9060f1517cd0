"""The estimation task: training records, and what is drawn anew for every trial, unknown to the estimator."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.signals.noise import draw_noise

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class TrainingTask:
    """Recorded episodes of equal length, and what is unknown about them to the estimator.

    Attributes:
        pull_mm: (records, N) pulling distance [mm].
        bend_deg: (records, N) true bending angle [deg]: it makes measurements and rewards, never
            observations.
        noise: kind of the measurement noise.
        noise_level: its level: the paper trains at R = 0.1.
        initial_error_deg: the initial estimate is off by up to this, evenly drawn [deg].
    """

    pull_mm: Array
    bend_deg: Array
    noise: str = "gaussian"
    noise_level: float = 0.1
    initial_error_deg: float = 20.0

    def draw(
        self, count: int, rng: np.random.Generator, first: NDArray[np.int64] | int = 0
    ) -> tuple[NDArray[np.int64], Array, Array]:
        """Draw episodes: (count,) records, (count, N) measurements and (count,) initial estimates [deg].

        The estimates are of the angle at the first sample of each episode, (count,) or the same for all.
        """
        record = rng.integers(len(self.pull_mm), size=count)
        truth = self.bend_deg[record]
        measurement = truth + draw_noise(self.noise, self.noise_level, truth.shape, rng)
        initial = truth[np.arange(count), first] + rng.uniform(
            -self.initial_error_deg, self.initial_error_deg, size=count
        )
        return record, measurement, initial


def stack_records(records: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Cut `(pull_mm, bend_deg)` records to the shortest and stack them: two (records, N) arrays."""
    samples = min(len(pull) for pull, _ in records)
    return np.stack([pull[:samples] for pull, _ in records]), np.stack(
        [bend[:samples] for _, bend in records]
    )
