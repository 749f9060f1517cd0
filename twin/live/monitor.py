"""Monitor of a trained estimator: evidence against it, sample by sample.

The fallback predicts each measurement; so does the trained estimator, moved on by the motion that the
fallback predicts. The one that predicts worse is farther from the truth, whatever constant the sensor may be
off by.
"""

import math

from twin.estimation.deployment import Deployment
from twin.live.reading import Alarm

WINDOW_S = 2.5  # time constant of the averages
LASTING_S = 1.0  # for which estimates must disagree
TIMEOUT_S, TIMEOUT_SAMPLES = 1.0, 5  # without a measurement
WORSE = 2.0  # times the mean square innovation of the fallback
NO_WORSE = 1.25  # times it, up to which the two count as equal
NOISE_SHARE = 0.5  # of R, beyond which it must be worse
OFFSET = 4.0  # standard deviations of the sensor allowed for the mean innovation: more than any noise's mean
FAR = 3.0  # standard deviations by which both may disagree beyond their intervals
SPIKE = 6.0  # standard deviations that a measurement may be off by
MOST = 16.0  # variances that one innovation counts in the averages
FASTER = 2.0  # times the fastest of the training
BEYOND = 0.5  # share of the angles of the training by which an estimate may leave them
LARGEST_HALF_WIDTH_DEG = 90.0
# Plain numbers: an operation on flags takes a microsecond.
_INNOVATION, _DISAGREEMENT, _RANGE = (of.value for of in (Alarm.INNOVATION, Alarm.DISAGREEMENT, Alarm.RANGE))
_RATE, _COMMAND, _INTERVAL = Alarm.RATE.value, Alarm.COMMAND.value, Alarm.INTERVAL.value
_TIMEOUT, _INPUT, _BEGINNING = Alarm.TIMEOUT.value, Alarm.INPUT.value, Alarm.BEGINNING.value
_JUDGED = _INNOVATION | _DISAGREEMENT | _RATE  # what needs averages


class Monitor:
    """Averages over one stream, and the limits for it."""

    def __init__(self, deployment: Deployment, sample_time: float, noise_variance: float):
        """Begin with nothing known, for a sample time T [s] and a sensor of variance R [deg^2]."""
        self._sample_time, self._variance = sample_time, noise_variance
        noise_deg = math.sqrt(noise_variance)
        self._far_deg = FAR * noise_deg
        self._offset_deg = OFFSET * noise_deg + 1.0
        self._noise_share = NOISE_SHARE * noise_variance
        self._learn = 1 - math.exp(-sample_time / WINDOW_S)
        self._lasting = max(round(LASTING_S / sample_time), 2)
        self._timeout = max(round(TIMEOUT_S / sample_time), TIMEOUT_SAMPLES)
        self._window_s = max(WINDOW_S, 3 * sample_time) - sample_time / 2
        self._usual_s = 1.5 * sample_time  # from one measurement to the next
        self._longest_s = max(LASTING_S, self._usual_s)
        self._low_mm, self._high_mm = deployment.pull_mm
        low, high = deployment.bend_deg
        beyond = BEYOND * (high - low) + FAR * noise_deg
        self._low_deg, self._high_deg = low - beyond, high + beyond
        self._speed_mm_s = FASTER * deployment.pull_speed_mm_s
        self._step_deg = FASTER * deployment.bend_speed_deg_s * sample_time + SPIKE * noise_deg + 1.0
        self._unmeasured = 0
        self.clear()

    def clear(self) -> None:
        """Reset the averages, after an estimator has restarted."""
        self._apart = 0
        self._seen_s = 0.0  # time covered by measurements
        self._since_s = 0.0  # time since the last one
        self._mean = self._square = self._mean_fallback = 0.0
        self._square_fallback = self._variance
        self._before_deg = self._fallback_before_deg = math.nan
        self.nis = 1.0  # mean square of the fallback's innovations over their expected variance

    @property
    def predicts_no_worse(self) -> bool:
        """Whether the trained estimator predicts measurements no worse than the fallback."""
        return self._seen_s >= self._window_s and self._square <= NO_WORSE * self._square_fallback

    def judge(
        self,
        bend_deg: float,
        half_width_deg: float,
        fallback_deg: float,
        fallback_half_width_deg: float,
        innovation_deg: float,
        expected: float,
        moved_mm: float,
        pull_mm: float,
        elapsed_s: float,
        measured: bool,
    ) -> int:
        """Take in one sample and return its `Alarm`, as a number.

        Known are the estimate and half of its 95 % interval [deg], the same of the fallback, its innovation
        (measurement minus prediction) [deg] with the variance that it expected [deg^2], the command and its
        travel since the previous sample [mm], the time since then [s], and whether the measurement was used.
        """
        alarms = 0
        if not self._low_mm <= pull_mm <= self._high_mm or moved_mm > self._speed_mm_s * elapsed_s + 1e-6:
            alarms |= _COMMAND
        if not self._low_deg <= bend_deg <= self._high_deg:
            alarms |= _RANGE
        if not 0 <= half_width_deg <= LARGEST_HALF_WIDTH_DEG and self._seen_s >= self._window_s:
            alarms |= _INTERVAL
        before, fallback_before = self._before_deg, self._fallback_before_deg
        self._before_deg, self._fallback_before_deg = bend_deg, fallback_deg
        self._since_s += elapsed_s
        if measured:
            since_s, self._since_s = self._since_s, 0.0
            self._unmeasured = 0
            if before == before:  # not NaN: there was a sample before
                alarms |= self._compare(before - fallback_before, innovation_deg, expected, since_s)
        else:
            self._unmeasured += 1
            if self._unmeasured >= self._timeout:
                alarms |= _TIMEOUT
        if self._seen_s < self._window_s:
            return alarms & ~_JUDGED | _BEGINNING
        stepped = abs(bend_deg - before)
        if stepped > self._step_deg and stepped * self._sample_time > self._step_deg * elapsed_s:
            alarms |= _RATE
        far = half_width_deg + FAR / 2 * fallback_half_width_deg + self._far_deg
        self._apart = self._apart + 1 if abs(bend_deg - fallback_deg) > far else 0
        if self._apart >= self._lasting:
            alarms |= _DISAGREEMENT
        return alarms

    def _compare(self, apart_deg: float, innovation_deg: float, expected: float, since_s: float) -> int:
        if since_s > self._longest_s:
            since_s = self._longest_s  # one sample after a pause is not a window of them
        self._seen_s += since_s
        own = innovation_deg - apart_deg  # of the trained one, moved on as the fallback has moved on
        # Conditions in the place of min and max, which take longer than all sums of a sample.
        square = innovation_deg * innovation_deg
        usual = expected if expected > self._square_fallback else self._square_fallback
        if square > SPIKE * SPIKE * usual < own * own:
            return _INPUT
        learn = self._learn if since_s <= self._usual_s else 1 - math.exp(-since_s / WINDOW_S)
        most = MOST * usual
        off, off_fallback = own - self._mean, innovation_deg - self._mean_fallback
        self._mean += learn * off
        self._mean_fallback += learn * off_fallback
        own_square, fallback_square, share = off * off, off_fallback * off_fallback, square / expected
        self._square += learn * ((own_square if own_square < most else most) - self._square)
        self._square_fallback += learn * (
            (fallback_square if fallback_square < most else most) - self._square_fallback
        )
        self.nis += learn * ((share if share < MOST else MOST) - self.nis)
        worse = self._square > WORSE * self._square_fallback + self._noise_share
        if not worse and abs(self._mean) <= self._offset_deg:
            return 0
        # A fallback that follows a wrong model at a distance may show this only in its mean.
        total = self._square + self._mean * self._mean
        return _INNOVATION if total >= self._square_fallback + self._mean_fallback**2 else 0
