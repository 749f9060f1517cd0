"""An estimator on one live stream, sample by sample, whatever comes late, twice, broken or not at all.

It drives the same `start` and `step` as whole records do: an even stream gives the same bits.
"""

import math
from typing import Generic

import numpy as np

from twin.errors import InputError
from twin.estimation.estimator import Estimator, State

GAP_SAMPLES = 1.5  # a step in time longer than this many sample times is a gap
FILL_LIMIT_S = 10.0  # a gap is filled with no more predictions than fit into this time


class OnlineEstimator(Generic[State]):
    """A running estimator; public counters tell what it had to make good.

    The estimate is never NaN: before the stream begins it is the initial one, and a step that would lead to
    no finite angle is not taken.

    Attributes:
        steps: samples after the first that the estimator has stepped to.
        ignored: samples that came no later than the one before, or with no finite time.
        filled: samples predicted in gaps.
        missing_measurements: samples without a finite measurement.
        held_pulls: samples without a finite pull.
        refused: steps that would have led to no finite angle.
    """

    def __init__(self, estimator: Estimator[State], sample_time: float, initial_bend_deg: float):
        """Prepare a stream.

        Args:
            estimator: told of the sensor, if it is to be.
            sample_time: T, the time between samples that the estimator was made for [s].
            initial_bend_deg: estimate at the first sample, whose measurement is not used [deg].

        Raises:
            ValueError: the sample time or the initial estimate is no proper number.
        """
        if not 0 < sample_time < math.inf:
            raise InputError(f"sample time {sample_time} s: must be positive and finite")
        if not math.isfinite(initial_bend_deg):
            raise InputError(f"initial_bend_deg = {initial_bend_deg}: must be a finite number")
        self.estimator = estimator
        self.sample_time = sample_time
        self.bend_deg = float(initial_bend_deg)
        self.steps = self.ignored = self.filled = 0
        self.missing_measurements = self.held_pulls = self.refused = 0
        self._state: State | None = None  # until the first pull
        self._time_s = -math.inf
        self._pull_mm = math.nan

    def push(self, time_s: float, pull_mm: float, measurement_deg: float = math.nan) -> float:
        """Take in one sample and return the estimate at it [deg].

        A sample no later than the last is ignored. One that comes more than 1.5 sample times after it ends a
        gap: the samples between are predicted without a measurement along the straight line between the two
        pulls, as many as fit; after more than 10 s, as many as fit into 10 s, so that the whole way of the
        tendon is still gone, in larger steps. One that comes early is a sample as any other.

        Args:
            time_s: its time stamp [s].
            pull_mm: commanded pulling distance, taken to stand where it was if it is not finite [mm].
            measurement_deg: measured angle, missing if it is not finite [deg].
        """
        if not (math.isfinite(time_s) and time_s > self._time_s):
            self.ignored += 1
            return self.bend_deg
        if not math.isfinite(measurement_deg):
            self.missing_measurements += 1
            measurement_deg = math.nan
        if not math.isfinite(pull_mm):
            self.held_pulls += 1
            pull_mm = self._pull_mm

        if self._state is None:
            if math.isfinite(pull_mm):  # else nothing can be held: the stream has not begun
                self._state = self.estimator.start(np.array([pull_mm]), np.array([self.bend_deg]))
                self._time_s, self._pull_mm = time_s, pull_mm
            return self.bend_deg

        between = self._samples_between(time_s)
        with np.errstate(all="ignore"):  # a step that overflows is refused
            for pull in np.linspace(self._pull_mm, pull_mm, between + 2)[1:-1].tolist():
                self._step(pull, math.nan)
            self._step(pull_mm, measurement_deg)
        self.filled += between
        self.steps += 1
        self._time_s = time_s
        return self.bend_deg

    def _samples_between(self, time_s: float) -> int:
        samples = (time_s - self._time_s) / self.sample_time
        if samples <= GAP_SAMPLES:
            return 0
        return round(min(samples, FILL_LIMIT_S / self.sample_time + 1)) - 1

    def _step(self, pull_mm: float, measurement_deg: float) -> None:
        assert self._state is not None
        before, now, measured = (np.array([value]) for value in (self._pull_mm, pull_mm, measurement_deg))
        state = self.estimator.step(self._state, now, before, measured)
        bend_deg = float(self.estimator.bend_deg(state)[0])
        if math.isfinite(bend_deg):
            self._state, self.bend_deg, self._pull_mm = state, bend_deg, pull_mm
        else:
            self.refused += 1
