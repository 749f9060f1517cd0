"""An estimator on one live stream, sample by sample, whatever comes late, twice, broken or not at all.

It drives the same `start` and `step` as whole records do: an even stream gives the same bits.
"""

import math
import sys
from typing import Generic

import numpy as np

from twin.errors import InputError
from twin.estimation.agreement import AgreeingRun, Refused
from twin.estimation.estimator import Estimator, State
from twin.estimation.health import Health, StreamLimits
from twin.estimation.outlier_gate import OutlierGate
from twin.estimation.real_number import real_number
from twin.estimation.residual_watch import ResidualWatch
from twin.estimation.stream_clock import StreamClock, samples_within

GAP_SAMPLES = 1.5  # a step in time longer than this many sample times is a gap
FILL_LIMIT_S = 10.0  # a gap is filled with no more predictions than fit into this time
FILL_LIMIT_SAMPLES = 2000  # and with no more than these: the next sample waits for them
WALK_MM = 0.25  # a longer way of the tendon is gone in steps of this length: models are unstable in one
HOLD_LIMIT_S = 1.0  # a pull may have moved on for so long while it was held
FAR_PULLS_AGREE = 3.0  # times the reach of a pull, within which two that were refused agree
REFUSED_STEPS = 3  # in a row, after which the estimator begins anew
GOOD_STRETCH_S = 30.0  # of samples without a fault, after which the state before them is trusted
_GOOD = Health.GOOD  # looked up once: an attribute of an enumeration takes as long as ten sums
LIES = (Health.OUTLIER | Health.IMPLAUSIBLE_MEASUREMENT | Health.IMPLAUSIBLE_PULL | Health.NO_PULL).value
WILD = 10.0  # times the limit of a measurement, beyond which no estimate is sound


class OnlineEstimator(Generic[State]):
    """A running estimator that no sample can break; `health` tells what was wrong with the last one.

    The estimate is never NaN: before the stream begins it is the initial one, and a step that would lead to
    a state that is not sound, in any number of it, is not taken. What is far from all that is known is
    refused; where refused samples agree among themselves for a while, the estimator begins anew at them, so
    that it is never locked out. Every sample that is pushed is counted once as ignored, waiting, first or
    step: `pushed == ignored + waiting + first + steps`. The other counters tell what it had to make good.

    Attributes:
        faults: of the last sample, as the number of `health`: an operation on flags takes as long as a step.
        state: state of the estimator; None until the stream begins.
        pull_mm: pulling distance that the estimator has stepped to [mm]; NaN until the stream begins.
        pushed: samples that came.
        ignored: samples whose time stamp does not count.
        waiting: samples before the first pull.
        first: one, as soon as the stream has begun.
        steps: samples after the first that the estimator has stepped to.
        filled: samples predicted in gaps.
        missing_measurements: samples without a finite measurement.
        implausible_measurements: samples whose measurement is beyond its limit.
        outliers: samples whose measurement is too far from the last estimate.
        held_pulls: samples without a finite pull.
        implausible_pulls: samples whose pull is beyond its limit, or too far from the last.
        refused: steps that would have led to no sound state.
        restarts: how often the estimator began anew.
        clock_resets: how often the stream went on by another clock.
    """

    def __init__(
        self,
        estimator: Estimator[State],
        sample_time: float,
        initial_bend_deg: float,
        limits: StreamLimits | None = None,
    ):
        """Prepare a stream.

        Args:
            estimator: told of the sensor, if it is to be.
            sample_time: T, the time between samples that the estimator was made for [s].
            initial_bend_deg: estimate at the first sample, whose measurement is not used [deg].
            limits: beyond which a sample is not believed; the wide ones of `StreamLimits`, if not given.

        Raises:
            ValueError: the sample time or the initial estimate is no proper number.
        """
        self.limits = limits or StreamLimits()
        sample_time = real_number("sample_time", sample_time)
        initial_bend_deg = real_number("initial_bend_deg", initial_bend_deg)
        if not 0 < sample_time < math.inf:
            raise InputError(f"sample time {sample_time} s: must be positive and finite")
        if not abs(initial_bend_deg) <= self.limits.bend_deg or math.isinf(initial_bend_deg):
            raise InputError(
                f"initial_bend_deg = {initial_bend_deg}: must be a finite number "
                f"from {-self.limits.bend_deg:g} to {self.limits.bend_deg:g}"
            )
        self.estimator = estimator
        self.sample_time = sample_time
        self.bend_deg = initial_bend_deg
        self.form = estimator.single()
        self.faults = 0
        self.pushed = self.ignored = self.waiting = self.first = self.steps = self.filled = 0
        self.missing_measurements = self.implausible_measurements = self.outliers = 0
        self.held_pulls = self.implausible_pulls = 0
        self.refused = self.restarts = self.clock_resets = 0
        self.state: State | None = None  # until the first pull
        self.pull_mm = math.nan
        self._held_s = 0.0  # since the last pull
        self._gap_s = GAP_SAMPLES * sample_time
        self._wild_deg = WILD * self.limits.bend_deg
        self._most_deg, self._most_mm = (
            min(most, sys.float_info.max) for most in (self.limits.bend_deg, self.limits.pull_mm)
        )
        self._jump_mm, self._speed_mm_s = self.limits.pull_jump_mm, self.limits.pull_speed_mm_s
        self._refused_in_a_row = 0
        self._trusted: State | None = None  # before the latest stretch of good samples
        self._latest_good: State | None = None  # behind it
        self._good_in_a_row = 0
        self._stretch = math.ceil(min(max(GOOD_STRETCH_S / sample_time, 1.0), 1e9))
        self._clock = StreamClock(sample_time, self.limits)
        self._gate = OutlierGate(sample_time, self.limits)
        enough = samples_within(self.limits.agreement_s, sample_time)
        self._far_pulls, self._outliers = AgreeingRun(enough), AgreeingRun(enough)
        self._watch = ResidualWatch(sample_time)
        self._enough = enough
        self._lies = self._since_lie = 0

    @property
    def health(self) -> Health:
        """Faults of the last sample."""
        return Health(self.faults) if self.faults else _GOOD

    @property
    def half_width_deg(self) -> float:
        """Half of the 95 % interval of the estimate [deg]; NaN where none is stated."""
        if self.state is None or not self.form.states_interval:
            return math.nan
        return self.form.half_width_deg(self.state)

    def push(self, time_s: float, pull_mm: float, measurement_deg: float = math.nan) -> float:
        """Take in one sample and return the estimate at it [deg].

        A sample no later than the last is ignored, as is one more than a day ahead; where such stamps go on
        from each other for a second, the sender has a new clock, and the stream goes on by it. A sample that
        comes more than 1.5 sample times after the last ends a gap: the samples between are predicted without
        a measurement along the straight line between the two pulls, as many as fit; after more than 10 s, as
        many as fit into 10 s, so that the whole way of the tendon is still gone, in larger steps. One that
        comes early is a sample as any other.

        Args:
            time_s: its time stamp [s].
            pull_mm: commanded pulling distance, taken to stand where it was if it is not finite, beyond its
                limit or too far from the last [mm].
            measurement_deg: measured angle, missing if it is not finite, beyond its limit or too far from the
                last estimate [deg].

        Raises:
            ValueError: one of them is no real number; the stream is then as it was before.
        """
        if not type(time_s) is type(pull_mm) is type(measurement_deg) is float:
            time_s, pull_mm = real_number("time_s", time_s), real_number("pull_mm", pull_mm)
            measurement_deg = real_number("measurement_deg", measurement_deg)
        self.pushed += 1
        self.faults = 0
        elapsed_s = self._clock.elapsed(time_s)
        if self._clock.fault is not _GOOD:
            self.faults |= self._clock.fault.value
            if math.isnan(elapsed_s):
                self.ignored += 1
                return self.bend_deg
            self.clock_resets += 1
        if not abs(measurement_deg) <= self._most_deg:
            measurement_deg = self._plausible_measurement(measurement_deg)
        if not abs(pull_mm) <= self._most_mm:
            pull_mm = self._plausible_pull(pull_mm)
        if self.state is None:
            self._begin(pull_mm)
        else:
            self.steps += 1
            self._advance(elapsed_s, pull_mm, measurement_deg)
        if self.faults or self._lies:
            self._leave_lies_behind()
        self._good_in_a_row = 0 if self.faults else self._good_in_a_row + 1
        if self._good_in_a_row == self._stretch:
            self._trusted, self._latest_good, self._good_in_a_row = self._latest_good, self.state, 0
        return self.bend_deg

    def _plausible_measurement(self, measurement_deg: float) -> float:
        """Return NaN in the place of a measurement that is not within the limits."""
        if math.isfinite(measurement_deg):
            self.implausible_measurements += 1
            self.faults |= Health.IMPLAUSIBLE_MEASUREMENT.value
        else:
            self.missing_measurements += 1
            self.faults |= Health.NO_MEASUREMENT.value
        return math.nan

    def _plausible_pull(self, pull_mm: float) -> float:
        """Return NaN in the place of a pull that is not within the limits."""
        if math.isfinite(pull_mm):
            self.implausible_pulls += 1
            self.faults |= Health.IMPLAUSIBLE_PULL.value
        else:
            self.held_pulls += 1
            self.faults |= Health.NO_PULL.value
        return math.nan

    def _begin(self, pull_mm: float) -> None:
        if math.isnan(pull_mm):  # nothing can be held: the stream has not begun
            self.waiting += 1
            self.faults |= Health.WAITING.value
            return
        self.first = 1
        self.pull_mm = pull_mm
        self.state = self.form.start(pull_mm, self.bend_deg)

    def _advance(self, elapsed_s: float, pull_mm: float, measurement_deg: float) -> None:
        """Step to a sample whose stamp, pull and measurement are each within their limits, or NaN."""
        self._held_s = min(self._held_s + elapsed_s, HOLD_LIMIT_S)
        if pull_mm != pull_mm:  # NaN
            pull_mm = self.pull_mm
        else:
            reach = self._jump_mm + self._speed_mm_s * self._held_s
            if abs(pull_mm - self.pull_mm) > reach:
                self.implausible_pulls += 1
                self.faults |= Health.IMPLAUSIBLE_PULL.value
                self._held_s -= min(elapsed_s, self._held_s)  # a wrong pull makes no other one likelier
                tolerance = FAR_PULLS_AGREE * reach
                if self._far_pulls.believes(pull_mm, tolerance, Refused(pull_mm, measurement_deg)):
                    if self._restart(self._far_pulls):
                        return
                else:
                    pull_mm = self.pull_mm
            else:
                self._held_s = 0.0
                if self._far_pulls.begun:
                    self._far_pulls.clear()

        way_mm = abs(pull_mm - self.pull_mm)
        if elapsed_s > self._gap_s or way_mm > self._jump_mm:
            self._fill(elapsed_s, pull_mm, way_mm)
        if measurement_deg != measurement_deg:  # NaN
            self._gate.widen(elapsed_s)
        elif self._gate.passes(abs(measurement_deg - self.bend_deg)):
            if self._outliers.begun:
                self._outliers.clear()
        else:
            self.outliers += 1
            self.faults |= Health.OUTLIER.value
            refused = Refused(pull_mm, measurement_deg)
            believed = self._outliers.believes(measurement_deg, self._gate.agreement_deg, refused)
            if believed and self._restart(self._outliers):
                return
            measurement_deg = math.nan
        self._step(pull_mm, measurement_deg)
        if measurement_deg == measurement_deg and self._watch.is_astray(measurement_deg - self.bend_deg):
            self._begin_anew(pull_mm, self.bend_deg + self._watch.offset_deg)

    def _fill(self, elapsed_s: float, pull_mm: float, way_mm: float) -> None:
        """Predict the samples of a gap, and all of a way that is too long for one step."""
        samples = elapsed_s / self.sample_time
        between = 0
        if elapsed_s > self._gap_s:
            between = round(min(samples, FILL_LIMIT_S / self.sample_time + 1, FILL_LIMIT_SAMPLES + 1)) - 1
            self.filled += between
            self.faults |= Health.GAP.value
        longest = self._jump_mm
        if not between:
            longest += self._speed_mm_s * self.sample_time
        if way_mm > longest * (between + 1):
            between = min(math.ceil(way_mm / WALK_MM), FILL_LIMIT_SAMPLES)
        for pull in np.linspace(self.pull_mm, pull_mm, between + 2)[1:-1].tolist() if between else ():
            self._step(pull, math.nan)

    def _step(self, pull_mm: float, measurement_deg: float) -> None:
        assert self.state is not None
        if self._take(self.form.step(self.state, pull_mm, self.pull_mm, measurement_deg), pull_mm):
            self._refused_in_a_row = 0
            return
        self.refused += 1
        self.faults |= Health.REFUSED.value
        self._refused_in_a_row += 1
        if self._refused_in_a_row >= REFUSED_STEPS:
            bend_deg = self.bend_deg if math.isnan(measurement_deg) else measurement_deg
            self._begin_anew(pull_mm, bend_deg)

    def _take(self, state: State, pull_mm: float) -> bool:
        """Go on from a state, if it is sound."""
        bend_deg = self.form.bend_deg(state)
        sound = abs(bend_deg) <= self._wild_deg and self.form.is_sound(state)
        if sound:
            self.state, self.bend_deg, self.pull_mm = state, bend_deg, pull_mm
        return sound

    def _restart(self, run: AgreeingRun) -> bool:
        """Begin anew in the middle of a run of samples that agree; not where nothing was measured."""
        found = run.restart()
        self._far_pulls.clear()
        self._outliers.clear()
        if found is None:
            return False
        begin, behind = found
        self._begin_anew(begin.pull_mm, begin.measurement_deg)
        for sample in behind:
            self._step(sample.pull_mm, sample.measurement_deg)
        return True

    def _leave_lies_behind(self) -> None:
        """Begin anew behind a stretch of lies: what of it passed the gate may have been learned from."""
        if self.faults & LIES:
            self._lies, self._since_lie = self._lies + 1, 0
            self._watch.doubt()
        elif self._lies:
            self._since_lie += 1
            if self._since_lie >= self._enough:
                if self._lies >= self._enough and self._trusted is not None:
                    self._begin_anew(self.pull_mm, self.bend_deg + self._watch.offset_deg)
                self._lies = 0

    def _begin_anew(self, pull_mm: float, bend_deg: float) -> None:
        most = self.limits.bend_deg
        angle = min(max(bend_deg, -most), most)
        if self._trusted is None:
            begun = self.form.start(pull_mm, angle)
        else:
            begun = self.form.resume(self._trusted, pull_mm, angle)
        self._take(begun, pull_mm)
        self._refused_in_a_row = 0
        self._held_s = 0.0
        self._watch.clear()
        self.restarts += 1
        self.faults |= Health.RESTARTED.value
