"""An estimator on one live stream, sample by sample: late, repeated, damaged and missing ones included.

It drives the same `start` and `step` as complete records do: an even stream gives the same bits. On an uneven
one each step spans the time that has passed.
"""

import math
import sys
from typing import Generic

import numpy as np

from twin.errors import InputError
from twin.estimation.estimator import Estimator, State
from twin.live.checks import (
    AgreeingRun,
    BiasDetector,
    OutlierGate,
    StreamClock,
    StreamLimits,
    real_number,
    samples_within,
)
from twin.live.reading import Health

EVEN = 1e-4  # share of the sample time by which a step may differ from it and counts as even
GAP_SAMPLES = 1.5  # a step in time longer than this many sample times is a gap
FILL_LIMIT_S = 10.0  # a gap is filled with no more predictions than fit into this time
FILL_LIMIT_SAMPLES = 2000  # and with no more than these: the next sample waits for them
WALK_MM = 0.25  # length of the steps in which a longer move of the tendon is predicted: one may be unstable
SPEED_S = 0.2  # time constant of the mean speed at which a missing pull goes on
HOLD_LIMIT_S = 1.0  # longest time for which it goes on
FAR_PULLS_AGREE = 3.0  # times the reach of a pull, within which two refused ones agree
REFUSED_STEPS = 3  # in a row, after which the estimator restarts
GOOD_STRETCH_S = 30.0  # of samples without a fault, after which the state before them is trusted
WILD = 10.0  # times the limit of a measurement, beyond which no estimate is possible
# Plain numbers: an operation on flags takes as long as a step.
_GOOD, _GAP, _WAITING = Health.GOOD, Health.GAP.value, Health.WAITING.value
_NO_PULL, _IMPLAUSIBLE_PULL = Health.NO_PULL.value, Health.IMPLAUSIBLE_PULL.value
_NO_MEASUREMENT, _IMPLAUSIBLE = Health.NO_MEASUREMENT.value, Health.IMPLAUSIBLE_MEASUREMENT.value
_OUTLIER, _REFUSED, _RESTARTED = Health.OUTLIER.value, Health.REFUSED.value, Health.RESTARTED.value
_FAULTY = _OUTLIER | _IMPLAUSIBLE | _IMPLAUSIBLE_PULL | _NO_PULL


class OnlineEstimator(Generic[State]):
    """A running estimator that no sample can break; `health` has the faults of the last one.

    The estimate is never NaN: before the stream begins it is the initial one, and a step to a state that
    contains an impossible number is not taken. Implausible samples are refused; if refused samples agree for
    a while, the estimator restarts at them, so that it is never blocked. Each sample is counted: `pushed ==
    ignored + waiting + steps`, and one for the first.

    Attributes:
        faults: of the last sample, as the number of `health`.
        state: of the estimator; None until the stream begins.
        bend_deg: latest estimate [deg].
        pull_mm: pulling distance that the estimator has stepped to; NaN until the stream begins [mm].
        pushed: samples that came.
        ignored: samples whose time stamp does not count.
        waiting: samples before the first pull.
        steps: samples after the first that the estimator has stepped to.
        filled: samples predicted in gaps.
        restarts: of the estimator.
    """

    def __init__(
        self,
        estimator: Estimator[State],
        sample_time: float,
        initial_bend_deg: float,
        limits: StreamLimits | None = None,
    ):
        """Prepare a stream of samples every T [s].

        Args:
            estimator: with the noise of the sensor, where it has a use for it.
            sample_time: T that the estimator was made for [s].
            initial_bend_deg: estimate at the first sample, whose measurement is not used [deg].
            limits: beyond which a sample is refused.
        """
        self.limits = limits or StreamLimits()
        self.sample_time = sample_time = real_number("sample_time", sample_time)
        self.bend_deg = initial_bend_deg = real_number("initial_bend_deg", initial_bend_deg)
        if not 0 < sample_time < math.inf:
            raise InputError(f"sample time {sample_time} s: must be positive and finite")
        if not abs(initial_bend_deg) <= self.limits.bend_deg or math.isinf(initial_bend_deg):
            raise InputError(
                f"initial_bend_deg = {initial_bend_deg}: must be a finite number "
                f"from {-self.limits.bend_deg:g} to {self.limits.bend_deg:g}"
            )
        self.estimator, self.form, self.faults = estimator, estimator.single(), 0
        self.pushed = self.ignored = self.waiting = self.steps = self.filled = self.restarts = 0
        self.state: State | None = None
        self.pull_mm = math.nan
        self._held_s = 0.0  # since the last pull
        self._mean_speed_mm_s = 0.0  # of the pull
        self._last_pulled: tuple[State, float, float] | None = None  # state, angle, pull; while none comes
        self._unpulled: list[tuple[float, float]] = []  # measurements since then, and the time before each
        self._gap_s, self._uneven_s = GAP_SAMPLES * sample_time, EVEN * sample_time
        self._wild_deg = WILD * self.limits.bend_deg
        largest = sys.float_info.max
        self._most_deg, self._most_mm = min(self.limits.bend_deg, largest), min(self.limits.pull_mm, largest)
        self._jump_mm, self._speed_mm_s = self.limits.pull_jump_mm, self.limits.pull_speed_mm_s
        self._refused_in_a_row = 0
        self._trusted: State | None = None  # before the latest stretch of good samples
        self._latest_good: State | None = None  # after it
        self._good_in_a_row = 0
        self._stretch = math.ceil(min(max(GOOD_STRETCH_S / sample_time, 1.0), 1e9))
        self._hold = samples_within(HOLD_LIMIT_S, sample_time)
        self._clock = StreamClock(sample_time, self.limits)
        self._gate = OutlierGate(sample_time, self.limits)
        self._enough = samples_within(self.limits.agreement_s, sample_time)
        self._far_pulls, self._outliers = AgreeingRun(self._enough), AgreeingRun(self._enough)
        self._bias = BiasDetector(sample_time)
        self._faulty = self._since_faulty = 0  # samples of a stretch of faulty ones, and after it

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

        A sample that is not later than the last is ignored, as is one more than a day ahead; if such stamps
        continue each other for a second, the stream follows this new clock. A sample more than 1.5 sample
        times after the last ends a gap: the samples between are predicted without a measurement along the
        straight line between the two pulls, as many as fit; after more than 10 s, as many as fit into 10 s,
        in larger steps. One that comes early is a sample like any other. A step spans the time since the
        sample before, or the sample time where both are equal to 1 part in 10,000.

        A pull or a measurement counts as missing if it is not finite, beyond its limit, or too far from the
        last pull or estimate. A missing pull goes on at its recent speed and comes to rest within a second;
        if the next one arrives within that time, the samples are repeated along the straight line to it.
        A value that is not a real number raises `ValueError`; the stream is then as it was before.
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
        if not abs(measurement_deg) <= self._most_deg:
            self.faults |= _IMPLAUSIBLE if math.isfinite(measurement_deg) else _NO_MEASUREMENT
            measurement_deg = math.nan
        if not abs(pull_mm) <= self._most_mm:
            self.faults |= _IMPLAUSIBLE_PULL if math.isfinite(pull_mm) else _NO_PULL
            pull_mm = math.nan
        if self.state is None:
            self._begin(pull_mm)
        else:
            self.steps += 1
            self._advance(elapsed_s, pull_mm, measurement_deg)
        if self.faults or self._faulty:
            self._restart_after_faults()
        self._good_in_a_row = 0 if self.faults else self._good_in_a_row + 1
        if self._good_in_a_row == self._stretch:
            self._trusted, self._latest_good, self._good_in_a_row = self._latest_good, self.state, 0
        return self.bend_deg

    def _begin(self, pull_mm: float) -> None:
        if math.isnan(pull_mm):  # nothing can be held: the stream has not begun
            self.waiting += 1
            self.faults |= _WAITING
            return
        self.pull_mm = pull_mm
        self.state = self.form.start(pull_mm, self.bend_deg)

    def _advance(self, elapsed_s: float, pull_mm: float, measurement_deg: float) -> None:
        self._held_s = min(self._held_s + elapsed_s, HOLD_LIMIT_S)
        unpulled = pull_mm != pull_mm  # NaN
        if not unpulled:
            reach = self._jump_mm + self._speed_mm_s * self._held_s
            last_mm = self.pull_mm if self._last_pulled is None else self._last_pulled[2]
            if abs(pull_mm - last_mm) > reach:
                self.faults |= _IMPLAUSIBLE_PULL
                self._held_s -= min(elapsed_s, self._held_s)  # a wrong pull makes no other one likelier
                refused = pull_mm, measurement_deg
                if self._far_pulls.is_accepted(pull_mm, FAR_PULLS_AGREE * reach, refused):
                    if self._restart_at(self._far_pulls):
                        return
                    self._forget_unpulled()
                else:
                    unpulled = True
            else:
                self._held_s = 0.0
                if self._far_pulls.begun:
                    self._far_pulls.clear()

        if unpulled:
            pull_mm = self._continued_pull(elapsed_s)
        else:
            if self._last_pulled is not None:
                self._repeat_unpulled(pull_mm, elapsed_s)
            if elapsed_s > 0:
                self._learn_speed((pull_mm - self.pull_mm) / elapsed_s, elapsed_s)
        travel_mm = abs(pull_mm - self.pull_mm)
        left_s = elapsed_s
        if elapsed_s > self._gap_s or travel_mm > self._jump_mm:
            left_s = self._fill(elapsed_s, pull_mm, travel_mm)
        if measurement_deg != measurement_deg:  # NaN
            self._gate.widen(elapsed_s)
        elif self._gate.passes(abs(measurement_deg - self.bend_deg)):
            if self._outliers.begun:
                self._outliers.clear()
        else:
            self.faults |= _OUTLIER
            agreeing_deg, refused = self._gate.width_deg(1.0), (pull_mm, measurement_deg)
            accepted = self._outliers.is_accepted(measurement_deg, agreeing_deg, refused)
            if accepted and self._restart_at(self._outliers, self.state):
                return
            measurement_deg = math.nan
        if unpulled:
            if self._last_pulled is None:
                assert self.state is not None
                self._last_pulled = self.state, self.bend_deg, self.pull_mm
            if len(self._unpulled) <= self._hold:
                self._unpulled.append((measurement_deg, left_s))
        self._step(pull_mm, measurement_deg, left_s)
        if measurement_deg == measurement_deg and self._bias.is_biased(measurement_deg - self.bend_deg):
            self._restart(pull_mm, self.bend_deg + self._bias.offset_deg, self.state)

    def _learn_speed(self, speed_mm_s: float, elapsed_s: float) -> None:
        """Take the speed of the latest sample into the mean, within the limit of the drive."""
        share = min(elapsed_s / SPEED_S, 1.0)
        mean_mm_s = self._mean_speed_mm_s + share * (speed_mm_s - self._mean_speed_mm_s)
        self._mean_speed_mm_s = min(max(mean_mm_s, -self._speed_mm_s), self._speed_mm_s)

    def _continued_pull(self, elapsed_s: float) -> float:
        """Return a missing pull, which goes on at its mean speed and comes to rest within a second."""
        left = max(1 - sum(of for _, of in self._unpulled) / HOLD_LIMIT_S, 0.0)
        pull_mm = self.pull_mm + self._mean_speed_mm_s * left * min(elapsed_s, HOLD_LIMIT_S)
        return min(max(pull_mm, -self._most_mm), self._most_mm)

    def _repeat_unpulled(self, pull_mm: float, elapsed_s: float) -> None:
        """Repeat the samples without a pull along the straight line to the one that has come."""
        assert self._last_pulled is not None
        unpulled = self._unpulled
        if len(unpulled) <= self._hold:
            self.state, self.bend_deg, self.pull_mm = self._last_pulled
            seconds = sum(of for _, of in unpulled) + elapsed_s
            speed = (pull_mm - self.pull_mm) / max(seconds, 1e-9)
            for measurement_deg, step_s in unpulled:
                self._step(self.pull_mm + speed * step_s, measurement_deg, step_s)
        self._forget_unpulled()

    def _forget_unpulled(self) -> None:
        self._last_pulled = None
        self._unpulled.clear()

    def _fill(self, elapsed_s: float, pull_mm: float, travel_mm: float) -> float:
        """Predict the samples of a gap, or a long move in pieces; return the time left for the sample [s]."""
        between, step_s = 0, self.sample_time
        if elapsed_s > self._gap_s:
            samples = elapsed_s / self.sample_time
            between = round(min(samples, FILL_LIMIT_S / self.sample_time + 1, FILL_LIMIT_SAMPLES + 1)) - 1
            self.filled += between
            self.faults |= _GAP
            elapsed_s = min(elapsed_s, between * step_s + self._gap_s)  # less, where more would not fit
        longest = self._jump_mm
        if not between:
            longest += self._speed_mm_s * self.sample_time
        if travel_mm > longest * (between + 1):
            between = min(math.ceil(travel_mm / WALK_MM), FILL_LIMIT_SAMPLES)
            step_s = elapsed_s / (between + 1)
        for pull in np.linspace(self.pull_mm, pull_mm, between + 2)[1:-1].tolist() if between else ():
            self._step(pull, math.nan, step_s)
        return elapsed_s - between * step_s

    def uneven_s(self, elapsed_s: float) -> float | None:
        """Return a time that a step is to span [s]; None where it is the sample time."""
        return elapsed_s if abs(elapsed_s - self.sample_time) > self._uneven_s else None

    def _step(self, pull_mm: float, measurement_deg: float, elapsed_s: float) -> None:
        assert self.state is not None
        uneven_s = self.uneven_s(elapsed_s)
        state = self.form.step(self.state, pull_mm, self.pull_mm, measurement_deg, uneven_s)
        if self._accept(state, pull_mm):
            self._refused_in_a_row = 0
            return
        self.faults |= _REFUSED
        self._refused_in_a_row += 1
        if self._refused_in_a_row >= REFUSED_STEPS:
            self._restart(pull_mm, self.bend_deg if math.isnan(measurement_deg) else measurement_deg)

    def _accept(self, state: State, pull_mm: float) -> bool:
        bend_deg = self.form.bend_deg(state)
        sound = abs(bend_deg) <= self._wild_deg and self.form.is_sound(state)
        if sound:
            self.state, self.bend_deg, self.pull_mm = state, bend_deg, pull_mm
        return sound

    def _restart_at(self, run: AgreeingRun, now: State | None = None) -> bool:
        """Restart in the middle of a run of samples that agree; not where nothing was measured."""
        found = run.restart()
        self._far_pulls.clear()
        self._outliers.clear()
        if found is None:
            return False
        first, rest = found
        self._restart(*first, now)
        for sample in rest:
            self._step(*sample, self.sample_time)
        return True

    def _restart_after_faults(self) -> None:
        """Restart from the last trusted state after a stretch of faulty samples.

        The estimator may have learned from those of them that passed the gate.
        """
        if self.faults & _FAULTY:
            self._faulty, self._since_faulty = self._faulty + 1, 0
            self._bias.doubt()
        elif self._faulty:
            self._since_faulty += 1
            if self._since_faulty >= self._enough:
                if self._faulty >= self._enough and self._trusted is not None:
                    self._restart(self.pull_mm, self.bend_deg + self._bias.offset_deg)
                self._faulty = 0

    def restart_from(self, trusted: State | None, bend_deg: float) -> None:
        """Restart at a known angle [deg], with what the estimator had learned until a state."""
        self._trusted = self._latest_good = trusted
        self._good_in_a_row = self._faulty = 0
        self._outliers.clear()
        self._restart(self.pull_mm, bend_deg, self.state)

    def _restart(self, pull_mm: float, bend_deg: float, now: State | None = None) -> None:
        """Restart at a pull [mm] and an angle [deg]; what follows the command goes on from a state, if given.

        Otherwise that too is as it was before the fault: pulls may have been wrong.
        """
        most = self.limits.bend_deg
        angle = min(max(bend_deg, -most), most)
        if self._trusted is None:
            self._accept(self.form.start(pull_mm, angle), pull_mm)
        else:
            resumed = self.form.resume(self._trusted, now or self._trusted, pull_mm, angle)
            self._accept(resumed, pull_mm)
        self._refused_in_a_row = 0
        self._held_s = 0.0
        self._forget_unpulled()
        self._bias.clear()
        self.restarts += 1
        self.faults |= _RESTARTED
