"""Check of the sensor by the motion that the command makes twins perform.

A filter of its own weights the twins, sample by sample. What it knew one to ten seconds ago, without any
measurement since, predicts the angle now (fault detection by analytical redundancy; Chow and Willsky 1984). A
sensor that sticks, drifts, or has lost its sign or its scale departs from each of these predictions, even if
an estimator follows it. Where it departs by more than healthy endoscopes ever do, only the twins predict,
from what was known ten seconds ago, until the sensor agrees with them again.

State of the filter: weights c of all twins about their mean, the error d that no twin explains, and the
sensor's zero b; random walks and decay are those of RAM (twins).
"""

import collections
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.estimation.gaussian import DEVIATIONS_OF_95
from twin.estimation.member_motion import (
    FIRST_ERROR_DEG2,
    GROWTH_DEG2_PER_MM,
    GROWTH_DEG2_PER_S,
    MEMBERS_PER_MM,
    MEMORY_MM,
    ZERO_PER_S,
)
from twin.live.reading import Alarm

Array = NDArray[np.float64]

BLOCK_S = 0.1  # samples are averaged over
WINDOW_S, FEWEST = 1.1, 3  # over which departures have their median: at least so many blocks
SNAPSHOT_S, OLDEST_S = 1.5, 10.5  # between states that are kept, and the age of the oldest
UNEXPLAINED_DEG = 0.5  # standard deviation of what no prediction explains, however sure it is
LARGEST = 6.0
"""Standard deviations of a departure from which it is an alarm."""
DOUBTFUL = 2.5  # from which the interval includes the prediction
AGREES, AGREES_S, AGREES_DEG, AGREES_STILL_S = 3.0, 2.0, 4.0, 10.0
"""Standard deviations within which a sensor must stay, how long, and along which motion, until it is
used; how long where nothing moves, as in an endoscope that is held."""
SHARE_OF_MOTION = 0.4, 1.7  # of the predicted motion, that it must show: those of healthy endoscopes
FIRST_USUAL, FIRST_DEG, MOST_DEG = 4.0, 5.0, 300.0
"""Usual square of a departure before anything is known, and the motion of the twins that it counts for;
also the motion along which departures are remembered."""
MATURE_S, MATURE_DEG = 20.0, 5.0
"""Time and motion before which the fit of the twins is unknown, and there is no alarm."""
JUMP, JUMP_S = 30.0, 10.0
"""Except for a departure this large while they hardly move, after some time: no endoscope jumps."""
CLIPPED = 4.0  # standard deviations that an innovation counts at most
FEWEST_TWINS = 10  # of which the filter makes an endoscope
_SETTLED_DEG2 = GROWTH_DEG2_PER_MM * MEMORY_MM / 2  # variance of d after a long way
_OF_MEDIAN = math.pi / 2  # variance of a median relative to that of a mean
MOVED_ZERO_S, MOVED_ZERO_DEG = 10.0, 5.0
"""Time for which, and motion along which, a constant departure makes it the new zero of the sensor."""
MOST_USUAL = 25.0  # times the usual square, that one counts at most
MOST_POINTS = 300  # blocks of an alarm that its name and its end are judged by
CLEARLY = 0.7  # times the squares of the fault that was found before


class Snapshot(NamedTuple):
    """What was known at some time."""

    mean: Array  # (n,) of c, d and b
    covariance: Array  # (n, n)
    way_mm: float  # of the tendon until then
    time_s: float
    usual: float  # mean square of departures relative to their variance
    moved_deg: float = 0.0  # motion of the twins until then
    kept: Any = None  # what came with the sample


class SensorCheck:
    """Filter of one stream, its snapshots, and the verdict on the sensor.

    Attributes:
        alarm: `Alarm` of the sensor as a number; 0 while it is trusted.
        doubted: whether the interval has to include the prediction; not during an alarm.
        kept: what came with the sample from which the twins predict.
        moved_zero_deg: how far the zero has moved where the last alarm ended so; 0 where the sensor agreed.
    """

    def __init__(
        self,
        members: int,  # M
        sample_time: float,  # T [s]
        noise_variance: float,  # R [deg^2]
        zero_deviation_deg: float,  # of what is known of the sensor's zero
        kept: Any = None,  # like the samples, see `push`
    ):
        """Begin with nothing known but the noise of the sensor."""
        self.alarm, self.doubted, self.kept, self.moved_zero_deg = 0, False, kept, 0.0
        self._variance = noise_variance
        self._to_weights = (np.eye(members) - 1 / members) / math.sqrt(members - 1)
        size = members + 2
        first = np.ones(size)
        first[-2:] = FIRST_ERROR_DEG2, zero_deviation_deg**2
        self._zero_growth = ZERO_PER_S * zero_deviation_deg**2
        self._known = Snapshot(np.zeros(size), np.diag(first), 0.0, 0.0, FIRST_USUAL, kept=kept)
        block_s = max(BLOCK_S, sample_time)
        self._block_s = block_s - sample_time / 2
        window = max(round(WINDOW_S / block_s), FEWEST)
        self._window_s = (window - 0.5) * block_s
        self._snapshot_s = SNAPSHOT_S - block_s / 2
        self._snapshots = collections.deque([self._known], maxlen=round(OLDEST_S / SNAPSHOT_S))
        self._window: collections.deque[tuple[Array, float, float, int]] = collections.deque(maxlen=window)
        self._points: collections.deque[tuple[float, float, float]] = collections.deque(maxlen=MOST_POINTS)
        self._agrees_s = self._zero_moved_s = self._judged_deg = 0.0
        self._mean_deg = math.nan  # of the twins in the block before
        self._clear_block()

    def push(
        self,
        members_deg: Array,  # (M,) angles of the twins [deg]
        way_mm: float,  # of the tendon since the sample before
        measurement_deg: float,  # NaN where there is none
        elapsed_s: float,  # since the sample before
        kept: Any = None,  # to be restored if the sensor turns out to be wrong from here on
    ) -> None:
        """Take in one sample."""
        self._members_deg = members_deg
        self._way_mm += way_mm
        self._time_s += elapsed_s
        if measurement_deg == measurement_deg:
            self._sum += members_deg
            self._measured_deg += measurement_deg
            self._count += 1
        if self._time_s >= self._block_s:
            self._take_block(kept)
            self._clear_block()

    def prediction(self) -> tuple[float, float]:
        """Return the angle by the twins alone and half of its 95 % interval, at the last sample [deg].

        It is from what was known when the alarm began, and without an alarm from the oldest snapshot.
        """
        now, since = self._known, self._known if self.alarm else self._snapshots[0]
        known = self._ahead(
            since, now.way_mm + self._way_mm - since.way_mm, now.time_s + self._time_s - since.time_s
        )
        angle = self._angle(self._members_deg)
        variance = max(float(angle @ known.covariance @ angle), 0.0) + UNEXPLAINED_DEG**2
        half_width = DEVIATIONS_OF_95 * math.sqrt(variance * max(known.usual, 1.0))
        return float(self._members_deg.mean() + angle @ known.mean), half_width

    def _clear_block(self) -> None:
        self._sum: Array = np.zeros(len(self._to_weights))
        self._measured_deg = self._way_mm = self._time_s = 0.0
        self._count = 0

    def _angle(self, members_deg: Array) -> Array:
        """Return how the angle follows from c, d and b, about the mean of the twins."""
        angle = np.zeros(len(members_deg) + 2)
        angle[:-2] = members_deg @ self._to_weights
        angle[-2] = 1.0
        return angle

    def _ahead(self, known: Snapshot, way_mm: float, time_s: float) -> Snapshot:
        """Return the belief after a travel and a time without a measurement."""
        keep = math.exp(-way_mm / MEMORY_MM)
        mean, covariance = known.mean.copy(), known.covariance.copy()
        mean[-2] *= keep
        covariance[-2] *= keep
        covariance[:, -2] *= keep
        diagonal = np.einsum("ii->i", covariance)
        diagonal[:-2] += MEMBERS_PER_MM * way_mm
        # d decays along the way that its variance grows by
        diagonal[-2] += _SETTLED_DEG2 * (1 - keep * keep) + GROWTH_DEG2_PER_S * time_s
        diagonal[-1] += self._zero_growth * time_s
        return known._replace(
            mean=mean,
            covariance=covariance,
            way_mm=known.way_mm + way_mm,
            time_s=known.time_s + time_s,
        )

    def _take_block(self, kept: Any) -> None:
        self._known = known = self._ahead(self._known, self._way_mm, self._time_s)
        if not self._count:
            return
        middle = self._sum / self._count
        angle = self._angle(middle)
        mean_deg = float(middle.sum()) / len(middle)
        if self._window:
            known = known._replace(moved_deg=known.moved_deg + abs(mean_deg - self._mean_deg))
        self._known, self._mean_deg = known, mean_deg
        measured = self._measured_deg / self._count - mean_deg
        self._window.append((angle, measured, known.way_mm, self._count))
        if self.alarm:
            self._judge_alarm(angle, measured)
            return
        self._known = self._updated(known, angle, measured)
        if len(self._window) == self._window.maxlen:
            self._judge()
        if self._known.time_s - self._snapshots[-1].time_s >= self._snapshot_s:
            self._snapshots.append(self._known._replace(kept=kept))

    def _updated(self, known: Snapshot, angle: Array, measured: float) -> Snapshot:
        """Return the belief after a block; an innovation counts for less where it is very large."""
        seen_as = angle.copy()
        seen_as[-1] = 1.0
        towards = known.covariance @ seen_as
        expected = float(seen_as @ towards) + self._variance / self._count
        innovation = measured - float(seen_as @ known.mean)
        share = min(CLIPPED * math.sqrt(expected) / max(abs(innovation), 1e-9), 1.0)
        gain = share / expected
        covariance = known.covariance - gain * np.outer(towards, towards)  # symmetric to the last bit
        return known._replace(mean=known.mean + gain * innovation * towards, covariance=covariance)

    def _departures(self, snapshots: list[Snapshot], usual: float) -> Array:
        """Return the (S,) median departures of the window from predictions, in standard deviations.

        These are as large as the usual square of a departure asks for.
        """
        angles = np.array([angle for angle, *_ in self._window])
        measured = np.array([of for _, of, _, _ in self._window])
        ways = np.array([way for *_, way, _ in self._window])
        means = np.array([of.mean for of in snapshots])
        gone = ways - np.array([of.way_mm for of in snapshots])[:, None]
        keep = np.exp(-gone / MEMORY_MM)
        predicted = means[:, :-2] @ angles[:, :-2].T + keep * means[:, -2:-1] + means[:, -1:]
        departure = np.sort(measured - predicted, axis=1)[:, len(measured) // 2]

        seen_as = np.tile(angles[-1], (len(snapshots), 1))
        seen_as[:, -2], seen_as[:, -1] = keep[:, -1], 1.0
        covariance = np.array([of.covariance for of in snapshots])
        variance = np.maximum((seen_as * (covariance @ seen_as[:, :, None])[:, :, 0]).sum(axis=1), 0.0)
        variance += MEMBERS_PER_MM * (angles[-1, :-2] ** 2).sum() * gone[:, -1]
        variance += _SETTLED_DEG2 * (1 - keep[:, -1] ** 2)
        variance += GROWTH_DEG2_PER_S * (self._known.time_s - np.array([of.time_s for of in snapshots]))
        count = sum(count for *_, count in self._window)
        of_noise = _OF_MEDIAN * self._variance / count
        scaled: Array = departure / np.sqrt((variance + UNEXPLAINED_DEG**2) * max(usual, 1.0) + of_noise)
        return scaled

    def _judge(self) -> None:
        """Compare the window with the predictions of older snapshots."""
        now = self._known.time_s
        old = [of for of in self._snapshots if now - of.time_s >= self._window_s]
        if not old:
            return
        oldest = self._snapshots[0]
        departures = self._departures(old, oldest.usual)
        largest = float(np.abs(departures).max())
        self.doubted = largest > DOUBTFUL
        mature = oldest.moved_deg >= MATURE_DEG and oldest.time_s >= MATURE_S
        still = self._known.moved_deg - old[-1].moved_deg < MATURE_DEG and now >= JUMP_S
        if largest > LARGEST and (mature or (still and abs(float(departures[-1])) > JUMP)):
            self._known = self._ahead(oldest, self._known.way_mm - oldest.way_mm, now - oldest.time_s)
            self._points.clear()
            self.kept = oldest.kept
            self._agrees_s = self._zero_moved_s = 0.0
            self.alarm, self.doubted, self.moved_zero_deg = Alarm.BIAS.value, False, 0.0
            return
        usual = self._known.usual
        square = float(departures[len(old) // 2]) ** 2 * max(oldest.usual, 1.0)
        square = min(square, MOST_USUAL * max(usual, 1.0))
        moved = self._known.moved_deg - self._judged_deg
        learn = moved / (FIRST_DEG + min(self._known.moved_deg, MOST_DEG))
        self._judged_deg = self._known.moved_deg
        self._known = self._known._replace(usual=usual + learn * (square - usual))

    def _judge_alarm(self, angle: Array, measured: float) -> None:
        """Name the fault, and end the alarm where the sensor agrees with the twins, or has another zero."""
        known = self._known
        predicted = self._mean_deg + float(angle @ known.mean)
        reading = self._mean_deg + measured - float(known.mean[-1])
        self._points.append((known.time_s, predicted, reading))
        self.alarm = fault_of(np.array(self._points), Alarm(self.alarm)).value
        agrees = abs(float(self._departures([known], known.usual)[0])) < AGREES
        self._agrees_s = self._agrees_s + self._time_s if agrees else 0.0
        shows_motion = self._agrees_s >= AGREES_S and self._shows_motion(self._agrees_s, AGREES_DEG)
        if shows_motion or self._agrees_s >= AGREES_STILL_S:
            self._believe(known)
            return
        self._zero_moved_s = self._zero_moved_s + self._time_s if self.alarm == Alarm.BIAS.value else 0.0
        if self._zero_moved_s >= MOVED_ZERO_S and self._shows_motion(self._zero_moved_s, MOVED_ZERO_DEG):
            _, predicted, reading = self._latest(self._zero_moved_s).T
            mean, covariance = known.mean.copy(), known.covariance.copy()
            self.moved_zero_deg = float(np.median(reading - predicted))
            mean[-1] += self.moved_zero_deg
            covariance[-1, -1] += UNEXPLAINED_DEG**2
            self._believe(known._replace(mean=mean, covariance=covariance))

    def _latest(self, seconds: float) -> Array:
        """Return the points of the latest seconds (N, 3)."""
        first = self._known.time_s - seconds
        return np.array([of for of in self._points if of[0] >= first - self._block_s / 2])

    def _shows_motion(self, seconds: float, least_deg: float) -> bool:
        """Return whether readings have moved for some time as the twins have."""
        _, predicted, reading = self._latest(seconds).T
        moved = predicted - predicted.mean()
        share = float(reading @ moved / max(moved @ moved, 1e-9))
        least, most = SHARE_OF_MOTION
        return bool(np.ptp(predicted) >= least_deg and least <= share <= most)

    def _believe(self, known: Snapshot) -> None:
        known = known._replace(kept=self.kept)
        self.alarm = 0
        self._known = known
        self._snapshots.clear()
        self._snapshots.append(known)
        self._window.clear()


def fault_of(points: Array, before: Alarm) -> Alarm:
    """Return the fault that explains readings best, from points (N, 3) of time, prediction and reading.

    Each fault is a curve with one number that is not known, a drift with two: the least squares decide,
    where they are clearly less than those of the fault that was found before.
    """
    time, predicted, reading = points.T
    off = reading - predicted
    gain = float(reading @ predicted / max(predicted @ predicted, 1e-9))
    scaled = ((reading - gain * predicted) ** 2).sum()
    since = time - time.mean()
    slope = float(off @ since / max(since @ since, 1e-9))
    squares = {
        Alarm.BIAS: ((off - off.mean()) ** 2).sum(),
        Alarm.STUCK: ((reading - reading.mean()) ** 2).sum(),
        Alarm.SIGN if gain < 0 else Alarm.GAIN: scaled,
        Alarm.DRIFT: 2 * ((off - off.mean() - slope * since) ** 2).sum(),  # for its second number
    }
    if before in squares:
        squares[before] *= CLEARLY
    return min(squares, key=lambda fault: squares[fault])
