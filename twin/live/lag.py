"""Lag of a sensor on a live stream: estimators run at the time of the readings and predict the present."""

import math
from collections import deque
from typing import Any

from twin.live.online import OnlineEstimator

BACK_S = 1.0  # a stamp farther back than this is of another clock


class Lag:
    """Pulls of the latest `seconds`: those that belong to late readings, and those since."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._samples = deque[tuple[float, float]]()  # times [s] and pulls [mm], from the lag on
        self._then = math.nan  # time that the latest reading is from [s]

    def pull_mm(self, time_s: float, pull_mm: float) -> float:
        """Take in a sample; return the pull at the time that its reading is from [mm], linear in between.

        A missing pull counts as the one before. NaN is returned before the first.
        """
        samples = self._samples
        if samples and time_s < samples[-1][0] - BACK_S:
            samples.clear()
        if not math.isfinite(time_s) or (samples and time_s <= samples[-1][0]):
            return pull_mm  # the estimators ignore this sample
        if not math.isfinite(pull_mm):
            pull_mm = samples[-1][1] if samples else math.nan
        if pull_mm == pull_mm:
            samples.append((time_s, pull_mm))
        self._then = then = time_s - self.seconds
        while len(samples) > 1 and samples[1][0] <= then:
            samples.popleft()
        if len(samples) < 2 or samples[0][0] >= then:  # it rested before the first
            return samples[0][1] if samples else pull_mm
        (begin, before), (end, after) = samples[0], samples[1]
        return before + (after - before) * (then - begin) / (end - begin)

    def predicted(self, online: OnlineEstimator[Any]) -> Any:
        """Return the state of an estimator now, predicted along the pulls since the time of its reading."""
        state, form, pull_mm = online.state, online.form, online.pull_mm
        reach = online.limits.pull_jump_mm + online.limits.pull_speed_mm_s * self.seconds
        before = self._then
        for time_s, pull in self._samples:
            if time_s > before and abs(pull - pull_mm) <= reach:  # no wrong pull is followed
                ahead = form.step(state, pull, pull_mm, math.nan, online.uneven_s(time_s - before))
                if not form.is_sound(ahead):
                    break
                state, pull_mm, before = ahead, pull, time_s
        return state
