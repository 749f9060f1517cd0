"""A log sample by sample through a runtime, as a live stream of the same samples would be."""

import dataclasses
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from twin.episode import Episode
from twin.evaluation.metrics import error_indices
from twin.evaluation.reading import record_name
from twin.runtime.assured import AssuredEstimator
from twin.stream.sample import StreamSample

Array = NDArray[np.float64]

STEADY_S = 5.0
"""Time from the start of a record that `rmse_steady_deg` leaves out [s]."""


@dataclasses.dataclass(frozen=True)
class StreamLog:
    """Samples of a record as a sensor and a drive would have sent them.

    Attributes:
        name: of the record.
        time_s: (N,) time stamps [s].
        pull_mm: (N,) commanded pulling distance [mm].
        measurement_deg: (N,) measured angle, NaN where it is missing [deg].
        truth_deg: (N,) true angle of a simulated record; NaN in a measured log, where nobody knows it [deg].
    """

    name: str
    time_s: Array
    pull_mm: Array
    measurement_deg: Array
    truth_deg: Array

    @property
    def is_measured(self) -> bool:
        """True where the truth is not known."""
        return bool(np.isnan(self.truth_deg).all())


def log_of(episode: Episode, number: int, sample_time: float) -> StreamLog:
    """Return the samples of an episode at about a sample time: every n-th, none of them interpolated.

    Args:
        episode: with any samples.
        number: names it where it has no name.
        sample_time: T; n is the whole number nearest to T over the record's own, at least 1 [s].
    """
    every = max(round(sample_time / episode.sample_time), 1)
    truth = np.full(len(episode.time), np.nan) if episode.is_measured else episode.truth_deg
    return StreamLog(
        name=record_name(episode, number),
        time_s=episode.time[::every],
        pull_mm=episode.pull_mm[::every],
        measurement_deg=episode.measured_deg[::every],
        truth_deg=truth[::every],
    )


def replay(runtime: AssuredEstimator, log: StreamLog) -> Iterator[StreamSample]:
    """Yield each sample of a log with its reading."""
    columns = (log.time_s, log.pull_mm, log.measurement_deg)
    for time_s, pull_mm, measurement_deg in zip(*(column.tolist() for column in columns), strict=True):
        yield StreamSample(time_s, pull_mm, measurement_deg, runtime.push(time_s, pull_mm, measurement_deg))


def log_errors(log: StreamLog, bend_deg: Array) -> tuple[Array, Array]:
    """Return the errors of the estimates of a log, against the truth or, in a measured one, the measurements.

    Args:
        log: N samples.
        bend_deg: (N,) estimates [deg].

    Returns:
        Errors from the second sample on, as the first one is where the estimate is given, and those after
        `STEADY_S`; samples at which nothing is known to compare with are left out [deg].
    """
    error = bend_deg - (log.measurement_deg if log.is_measured else log.truth_deg)
    scored = np.isfinite(error)
    scored[0] = False
    steady = scored & (log.time_s - log.time_s[0] >= STEADY_S)
    return error[scored], error[steady]


def rmse_deg(errors: list[Array]) -> float | None:
    """Return the RMSE over the errors of several logs [deg]; None without any."""
    error = np.concatenate([*errors, np.empty(0)])
    return float(error_indices(error)["rmse_deg"]) if error.size else None
