"""A trained estimator with a trusted fallback beside it and a monitor between them (Simplex; Sha 2001)."""

import math
from typing import Any

from twin.estimation.estimator import Estimator
from twin.estimation.gaussian import DEVIATIONS_OF_95
from twin.estimation.health import Health, StreamLimits
from twin.estimation.online import OnlineEstimator
from twin.estimation.real_number import real_number
from twin.estimation.two_states import TwoStates
from twin.runtime.deployment import Deployment
from twin.runtime.monitor import DISTRUSTED, Monitor
from twin.runtime.reading import UNKNOWN_DEG, Alarm, Reading, Source

DISTRUST_SAMPLES = 3  # in a row with an alarm, after which the fallback is taken
TRUST_S = 5.0  # without an alarm, after which the trained estimator is taken again
BLEND_S = 0.5  # from one to the other
# Looked up once, and flags as plain numbers: either takes a tenth of a filter's step.
_ADVANCED, _NO_ALARM = Source.ADVANCED, Alarm.NONE
_INPUT, _LOST, _DISTRUSTED = Alarm.INPUT.value, Alarm.LOST.value, DISTRUSTED.value
_RESTARTED, _REFUSED = Health.RESTARTED.value, Health.REFUSED.value


class AssuredEstimator:
    """A running pair of estimators on one live stream; no sample can break it.

    The trained estimator is believed until the monitor speaks against it in three samples in a row, and again
    after five seconds without an alarm; between the two the estimate moves within half a second. A sensor
    that is stuck counts as none.

    Attributes:
        method: name of the trained method.
        sample_time: T [s].
        reading: the latest.
        samples: that came.
        fallback_samples: of them, those at which the fallback had any part in the estimate.
        switches: how often trust was lost.
    """

    def __init__(
        self,
        method: str,
        advanced: Estimator[Any],
        deployment: Deployment,
        sample_time: float,
        noise_variance: float,
        initial_bend_deg: float,
        limits: StreamLimits | None = None,
    ):
        """Prepare a stream.

        Args:
            method: name of the trained method.
            advanced: the trained estimator, told of the sensor.
            deployment: the fallback, and the limits of the training.
            sample_time: T [s].
            noise_variance: R of the sensor [deg^2].
            initial_bend_deg: estimate at the first sample [deg].
            limits: beyond which a sample is not believed.

        Raises:
            ValueError: the sample time or the initial estimate is no proper number.
        """
        self.method = method
        self.sample_time = sample_time
        self.advanced = OnlineEstimator(advanced, sample_time, initial_bend_deg, limits)
        fallback = deployment.fallback_at(sample_time, noise_variance)
        self.fallback = OnlineEstimator(fallback, sample_time, initial_bend_deg, limits)
        self.monitor = Monitor(deployment, sample_time, noise_variance)
        self.samples = self.fallback_samples = self.switches = 0
        unknown = initial_bend_deg - UNKNOWN_DEG, initial_bend_deg + UNKNOWN_DEG
        self.reading = Reading(initial_bend_deg, *unknown, Source.ADVANCED, Health.WAITING, Alarm.BEGINNING)
        self._states = self.advanced.form.states_interval
        self._weight = 1.0  # of the trained estimator
        self._own_physics = advanced.has_physics
        self._patience = max(round(TRUST_S / sample_time), 1)
        self._trusted = True
        self._bad = self._good = 0  # samples in a row
        self._time_s, self._pull_mm = math.nan, math.nan
        self._restarts = (0, 0)

    def push(self, time_s: float, pull_mm: float, measurement_deg: float = math.nan) -> Reading:
        """Take in one sample and return what is known then.

        Args:
            time_s: its time stamp [s].
            pull_mm: commanded pulling distance, NaN where there is none [mm].
            measurement_deg: measured angle, NaN where there is none [deg].

        Raises:
            ValueError: one of them is no real number; the stream is then as it was before.
        """
        if not type(time_s) is type(pull_mm) is type(measurement_deg) is float:
            time_s, pull_mm = real_number("time_s", time_s), real_number("pull_mm", pull_mm)
            measurement_deg = real_number("measurement_deg", measurement_deg)
        # A packet that came before says nothing of its sensor.
        stuck = not time_s <= self._time_s and self.monitor.stuck.is_stuck(measurement_deg)
        believed = math.nan if stuck else measurement_deg
        advanced, fallback = self.advanced, self.fallback
        ignored = fallback.ignored
        bend = advanced.push(time_s, pull_mm, believed)
        fallback_deg = fallback.push(time_s, pull_mm, believed)
        self.samples += 1
        state = fallback.state
        if not isinstance(state, TwoStates):  # the stream has not begun
            faulty = _INPUT if advanced.faults & ~Health.WAITING.value else 0
            return self._tell(bend, UNKNOWN_DEG, _ADVANCED, Alarm.BEGINNING.value | faulty)
        if fallback.ignored != ignored:  # nothing is known that was not known before
            last = self.reading
            return self._tell(
                last.bend_deg, (last.high_deg - last.low_deg) / 2, last.source, last.alarms.value | _INPUT
            )
        before_s, self._time_s = self._time_s, time_s
        elapsed = self._time_s - before_s
        if not elapsed > 0:  # the first, or another clock
            elapsed = self.sample_time
        faults = advanced.faults | fallback.faults
        alarms, half_width, fallback_half_width = self._judge(state, elapsed, bend, fallback_deg, faults)
        if stuck:
            alarms |= Alarm.STUCK.value
        if alarms == 0 and self._trusted and self._weight == 1.0:  # as it should be
            self._bad = 0
            return self._tell(bend, half_width, _ADVANCED, alarms)
        self._decide(alarms)
        weight = self._weight = self._moved(elapsed, faults)
        if weight == 1.0:
            return self._tell(bend, half_width, _ADVANCED, alarms)
        self.fallback_samples += 1
        if weight == 0.0:
            return self._tell(fallback_deg, fallback_half_width, Source.FALLBACK, alarms)
        blend = weight * bend + (1 - weight) * fallback_deg
        widest = weight * half_width + (1 - weight) * fallback_half_width
        return self._tell(blend, widest, Source.BLEND, alarms)

    def _judge(
        self, state: TwoStates, elapsed_s: float, bend: float, fallback_deg: float, faults: int
    ) -> tuple[int, float, float]:
        """Return the alarms, and half of both intervals [deg]."""
        advanced, fallback, monitor = self.advanced, self.fallback, self.monitor
        lost = 0
        if faults:
            lost = self._lost(faults)
        fallback_half_width = DEVIATIONS_OF_95 * math.sqrt(
            state.p * (monitor.nis if monitor.nis > 1.0 else 1.0)
        )
        if self._states:
            half_width = advanced.half_width_deg
        else:  # the smallest that holds the fallback's
            half_width = abs(bend - fallback_deg) + fallback_half_width
        pull, before = fallback.pull_mm, self._pull_mm
        self._pull_mm = pull
        alarms = monitor.judge(
            bend,
            half_width if self._states else fallback_half_width,
            fallback_deg,
            fallback_half_width,
            state.innovation_deg,
            state.expected,
            0.0 if before != before else abs(pull - before),
            pull,
            elapsed_s,
            measured=not faults & UNMEASURED and state.innovation_deg != 0.0,
        )
        return alarms | _INPUT | lost if faults else alarms, half_width, fallback_half_width

    def _lost(self, faults: int) -> int:
        """Begin new averages where either began anew, and return whether the trained one alone is in need."""
        before, self._restarts = self._restarts, (self.advanced.restarts, self.fallback.restarts)
        if faults & _RESTARTED:
            self.monitor.clear()
            if self._restarts[0] > before[0] and self._restarts[1] == before[1]:
                self._bad = DISTRUST_SAMPLES
                return _LOST
        return _LOST if self.advanced.faults & ~self.fallback.faults & _REFUSED else 0

    def _decide(self, alarms: int) -> None:
        """Take or give trust, with hysteresis."""
        if not alarms & _DISTRUSTED:
            self._bad = 0
            self._good += 1
            if not self._trusted and self._good >= self._patience:
                self._trusted = True
        else:
            self._good = 0
            self._bad += 1
            if self._trusted and self._bad >= DISTRUST_SAMPLES:
                self._trusted = False
                self.switches += 1

    def _moved(self, elapsed_s: float, faults: int) -> float:
        """Return the weight of the trained estimator, on its way to one or to none.

        Without a measurement, one that foretells by the fallback's own model has nothing to add to it, as it
        was not trained to foretell; without a pull, one that believes the command more believes more that is
        wrong.
        """
        blind = not self._own_physics and bool(faults & BLIND)
        step = elapsed_s / BLEND_S
        if self._trusted and not blind and not faults & UNLED:
            return min(self._weight + step, 1.0)
        return max(self._weight - step, 0.0)

    def _tell(self, bend: float, half_width: float, source: Source, alarms: int) -> Reading:
        if not half_width < UNKNOWN_DEG:
            half_width = UNKNOWN_DEG
        health = self.advanced.health
        raised = Alarm(alarms) if alarms else _NO_ALARM
        self.reading = Reading(bend, bend - half_width, bend + half_width, source, health, raised)
        return self.reading


_MISSING = Health.NO_MEASUREMENT | Health.IMPLAUSIBLE_MEASUREMENT | Health.OUTLIER
UNMEASURED = (_MISSING | Health.RESTARTED | Health.REFUSED).value
"""Faults of a sample whose measurement was not taken in as it is."""
BLIND = (_MISSING | Health.GAP).value
"""Faults of a sample that something stands before which was foretold alone."""
UNLED = (Health.NO_PULL | Health.IMPLAUSIBLE_PULL).value
"""Faults of a sample whose pull is not known."""
