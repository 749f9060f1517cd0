"""A trained estimator with a trusted fallback and a monitor between them (Simplex architecture; Sha 2001)."""

import dataclasses
import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import Deployment, deployment_of, sensor_of
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.gaussian import DEVIATIONS_OF_95
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.estimation.load import load_estimator_at
from twin.estimation.registry import method_specs
from twin.estimation.two_states import TwoStates
from twin.live.checks import OFFSET_SHARE, OffsetDetector, StreamLimits, StuckSensor, real_number
from twin.live.lag import Lag
from twin.live.monitor import Monitor
from twin.live.online import OnlineEstimator
from twin.live.reading import UNKNOWN_DEG, Alarm, Health, Reading, Source
from twin.live.sensor_check import FEWEST_TWINS, SensorCheck
from twin.live.twins import draw_twins, twins_of
from twin.preset.preset import ZERO_DEVIATION_DEG
from twin.preset.sensor import SensorModel

if TYPE_CHECKING:
    from twin.preset import Preset, Ranges

PLAIN = SensorModel()
DISTRUST_SAMPLES = 3  # in a row with an alarm, after which the fallback is used
TRUST_S = 5.0  # without an alarm, after which the trained estimator is used again
BLEND_S = 0.5  # from one to the other
FARTHEST, FARTHEST_MM = 4.0, 20.0
"""Times the farthest pull of the training, or millimetres, that a pull may be where twins follow it."""
SMALL_OFFSET_DEG = 3.0  # of a zero that has moved back
AGREEMENT_S = 1.5  # time for which refused measurements must agree where twins check the sensor
DISTRUSTED = Alarm.INNOVATION | Alarm.DISAGREEMENT | Alarm.RANGE | Alarm.RATE
DISTRUSTED |= Alarm.COMMAND | Alarm.INTERVAL | Alarm.LOST
"""Alarms about the trained estimator, not about the sample."""
UNFAMILIAR = Alarm.COMMAND | Alarm.RANGE | Alarm.DISAGREEMENT
"""Of these, those that are no reason to switch while the trained estimator predicts no worse."""
_MISSING = Health.NO_MEASUREMENT | Health.IMPLAUSIBLE_MEASUREMENT | Health.OUTLIER
# Looked up once, and flags as plain numbers: either takes a tenth of a filter's step.
_UNMEASURED = (_MISSING | Health.RESTARTED | Health.REFUSED).value  # the measurement was not used as it is
_BLIND = (_MISSING | Health.GAP).value  # something at or before the sample was predicted without measurement
_UNCOMMANDED = (Health.NO_PULL | Health.IMPLAUSIBLE_PULL).value
_ADVANCED, _NO_ALARM = Source.ADVANCED, Alarm.NONE
_OFFSET, _TIMEOUT = Alarm.OFFSET.value, Alarm.TIMEOUT.value
_INPUT, _LOST, _DISTRUSTED, _UNFAMILIAR = (
    of.value for of in (Alarm.INPUT, Alarm.LOST, DISTRUSTED, UNFAMILIAR)
)
_RESTARTED, _REFUSED = Health.RESTARTED.value, Health.REFUSED.value


class AssuredEstimator:
    """A running pair of estimators on one live stream; no sample can break it.

    The trained estimator is trusted until the monitor raises alarms about it in three samples in a row, and
    again after five seconds without one; between the two the estimate moves within half a second.

    A sensor that is wrong counts as missing. Where there are twins, they detect this (`SensorCheck`): while
    the sensor departs from what the command makes possible, only the twins predict; when it agrees with them
    again, both estimators continue with what they had learned before.

    Measurements are corrected for the zero, the scale and the lag of the sensor: both estimators run at the
    time of the measurement, and the reading is their prediction from there to now.

    Attributes:
        method: name of the trained method.
        sample_time: T [s].
        advanced: the trained estimator on the stream.
        fallback: the trusted filter on it.
        reading: the latest.
        noise_variance: R, of corrected measurements [deg^2].
        sensor: by which measurements are corrected.
        samples: that came.
        fallback_samples: of them, those at which the fallback had any part in the estimate.
        switches: how often trust was lost.
        present: state of the trained estimator now; None until the stream begins.
    """

    def __init__(
        self,
        method: str,  # name of the trained method
        advanced: Estimator[Any],  # the trained estimator, with the noise of the sensor
        fallback: ActiveModel,  # on a model of Coleman and Hodgdon, with T and noise of the stream
        deployment: Deployment,  # ranges of the training
        initial_bend_deg: float,  # estimate at the first sample [deg]
        limits: StreamLimits | None = None,  # beyond which a sample is refused
        sensor: SensorModel = PLAIN,  # by which measurements are corrected
        twins: Estimator[Any] | None = None,  # that check the sensor, where the trained estimator has none
    ):
        """Prepare a stream that starts at an estimate [deg]."""
        self.method, self.sample_time = method, fallback.sample_time
        limits = limits or StreamLimits()
        if advanced.has_physics or twins:
            # Twins check refused measurements before both estimators restart at them; a far pull takes
            # seconds.
            farthest_mm = max(FARTHEST * max(abs(of) for of in deployment.pull_mm), FARTHEST_MM)
            limits = dataclasses.replace(
                limits,
                agreement_s=max(limits.agreement_s, AGREEMENT_S),
                pull_mm=min(limits.pull_mm, farthest_mm),
            )
        self.advanced = OnlineEstimator(advanced, self.sample_time, initial_bend_deg, limits)
        self.fallback = OnlineEstimator(fallback, self.sample_time, initial_bend_deg, limits)
        self.noise_variance = float(np.asarray(fallback.measurement_variance))
        self._monitor = Monitor(deployment, self.sample_time, self.noise_variance)
        self._stuck, self._offset = StuckSensor(), OffsetDetector(self.sample_time)
        self.sensor = sensor
        self._lag = Lag(sensor.lag_s) if sensor.lag_s else None
        self.present: Any = None
        self.samples = self.fallback_samples = self.switches = 0
        unknown = initial_bend_deg - UNKNOWN_DEG, initial_bend_deg + UNKNOWN_DEG
        self.reading = Reading(initial_bend_deg, *unknown, Source.ADVANCED, Health.WAITING, Alarm.BEGINNING)
        self._states_interval = self.advanced.form.states_interval
        self._weight = 1.0  # of the trained estimator
        self._own_physics = advanced.has_physics
        self._zero_deviation_deg = float(
            np.asarray(getattr(advanced, "zero_deviation_deg", ZERO_DEVIATION_DEG))
        )
        self._twins: OnlineEstimator[Any] | None = self.advanced if advanced.has_physics else None
        if twins:
            self._twins = OnlineEstimator(twins, self.sample_time, 0.0, limits)
        self._check: SensorCheck | None = None  # from the first sample on, where there are twins
        self._moved_mm, self._twins_restarts = 0.0, 0
        self._moved_zero_deg = 0.0  # of a sensor that is used again although it departs from the twins
        self._patience = max(round(TRUST_S / self.sample_time), 1)
        self._trusted = True
        self._bad = self._good = 0  # samples in a row
        self._time_s, self._pull_mm = math.nan, math.nan
        self._restarts = (0, 0)

    def push(self, time_s: float, pull_mm: float, measurement_deg: float = math.nan) -> Reading:
        """Take in one sample, with NaN for what is missing, and return the reading at it.

        A value that is not a real number raises `ValueError`; the stream is then as it was before.
        """
        if not type(time_s) is type(pull_mm) is type(measurement_deg) is float:
            time_s, pull_mm = real_number("time_s", time_s), real_number("pull_mm", pull_mm)
            measurement_deg = real_number("measurement_deg", measurement_deg)
        if self.sensor is not PLAIN:
            measurement_deg = self.sensor.angle_deg(measurement_deg)
            if self._lag is not None:
                pull_mm = self._lag.pull_mm(time_s, pull_mm)
        # A repeated packet is no evidence of a stuck sensor.
        stuck = not time_s <= self._time_s and self._stuck.is_stuck(measurement_deg)
        wrong = stuck or (self._check is not None and self._check.alarm)
        accepted = math.nan if wrong else measurement_deg
        advanced, fallback = self.advanced, self.fallback
        ignored = fallback.ignored
        bend = advanced.push(time_s, pull_mm, accepted)
        fallback_deg = fallback.push(time_s, pull_mm, accepted)
        if self._twins is not None and self._twins is not advanced:
            self._twins.push(time_s, pull_mm)
        self.samples += 1
        state = fallback.state
        if not isinstance(state, TwoStates):  # the stream has not begun
            faulty = _INPUT if advanced.faults & ~Health.WAITING.value else 0
            return self._read(bend, UNKNOWN_DEG, _ADVANCED, Alarm.BEGINNING.value | faulty)
        if fallback.ignored != ignored:
            last = self.reading
            half_width = (last.high_deg - last.low_deg) / 2
            return self._read(last.bend_deg, half_width, last.source, last.alarms.value | _INPUT)
        before_s, self._time_s = self._time_s, time_s
        elapsed = self._time_s - before_s
        if not elapsed > 0:  # the first, or another clock
            elapsed = self.sample_time
        faults = advanced.faults | fallback.faults
        alarms, half_width, fallback_half_width = self._judge(state, elapsed, bend, fallback_deg, faults)
        if stuck:
            alarms |= Alarm.STUCK.value
        check = None
        if self._twins is not None:
            check = self._check_sensor(self._twins, math.nan if stuck else measurement_deg, elapsed)
        # The sample at which an alarm ends is the last of the twins.
        if check is not None and (check.alarm or (wrong and not stuck)):
            return self._read(*check.prediction(), Source.TWINS, (alarms | check.alarm) & ~_TIMEOUT)
        if self._own_physics:
            error, deviation = self.advanced.form.model_error_deg(self.advanced.state)
            alarms |= _OFFSET * self._offset.is_off(error, deviation)
        if alarms == 0 and self._trusted and self._weight == 1.0:  # as it should be
            self._bad = 0
            return self._read(bend, half_width, _ADVANCED, alarms)
        self._decide(alarms)
        weight = self._weight = self._moved(elapsed, faults)
        if weight == 1.0:
            return self._read(bend, half_width, _ADVANCED, alarms)
        self.fallback_samples += 1
        if weight == 0.0:
            return self._read(fallback_deg, fallback_half_width, Source.FALLBACK, alarms)
        blend = weight * bend + (1 - weight) * fallback_deg
        widest = weight * half_width + (1 - weight) * fallback_half_width
        return self._read(blend, widest, Source.BLEND, alarms)

    def _judge(
        self, state: TwoStates, elapsed_s: float, bend: float, fallback_deg: float, faults: int
    ) -> tuple[int, float, float]:
        """Return the alarms, and half of both intervals [deg]."""
        advanced, fallback, monitor = self.advanced, self.fallback, self._monitor
        lost = self._lost(faults) if faults else 0
        fallback_half_width = DEVIATIONS_OF_95 * math.sqrt(
            state.p * (monitor.nis if monitor.nis > 1.0 else 1.0)
        )
        if self._states_interval:
            half_width = advanced.half_width_deg
        else:  # the smallest that contains the fallback's
            half_width = abs(bend - fallback_deg) + fallback_half_width
        pull, before = fallback.pull_mm, self._pull_mm
        self._pull_mm = pull
        moved_mm = self._moved_mm = 0.0 if before != before else abs(pull - before)
        alarms = monitor.judge(
            bend,
            half_width if self._states_interval else fallback_half_width,
            fallback_deg,
            fallback_half_width,
            state.innovation_deg,
            state.expected,
            moved_mm,
            pull,
            elapsed_s,
            measured=not faults & _UNMEASURED and state.innovation_deg != 0.0,
        )
        return alarms | _INPUT | lost if faults else alarms, half_width, fallback_half_width

    def _lost(self, faults: int) -> int:
        """Reset the averages where either restarted; return LOST where the trained one alone failed."""
        before, self._restarts = self._restarts, (self.advanced.restarts, self.fallback.restarts)
        if faults & _RESTARTED:
            self._monitor.clear()
            if self._restarts[0] > before[0] and self._restarts[1] == before[1]:
                self._bad = DISTRUST_SAMPLES
                return _LOST
        return _LOST if self.advanced.faults & ~self.fallback.faults & _REFUSED else 0

    def _check_sensor(
        self, twins: OnlineEstimator[Any], measurement_deg: float, elapsed_s: float
    ) -> SensorCheck | None:
        """Check the sensor, if there are enough twins; when an alarm ends, both estimators restart."""
        advanced, fallback = self.advanced, self.fallback
        members = twins.form.twins_deg(twins.state)
        if len(members) < FEWEST_TWINS:
            return None
        check, states = self._check, (advanced.state, fallback.state)
        limits = advanced.limits
        jumped = self._moved_mm > limits.pull_jump_mm + limits.pull_speed_mm_s * elapsed_s
        # Twins that have jumped no longer predict from before the jump.
        if check is None or ((jumped or twins.restarts != self._twins_restarts) and not check.alarm):
            self._twins_restarts = twins.restarts
            check = self._check = SensorCheck(
                len(members), self.sample_time, self.noise_variance, self._zero_deviation_deg, states
            )
        if not abs(measurement_deg) <= limits.bend_deg:
            measurement_deg = math.nan
        was = check.alarm
        check.push(members, self._moved_mm, measurement_deg, elapsed_s, states)
        if was and not check.alarm:
            bend, _ = check.prediction()
            advanced.restart_from(check.kept[0], bend)
            fallback.restart_from(check.kept[1], bend)
            self._twins_restarts = twins.restarts
            self._moved_zero_deg += check.moved_zero_deg
            if abs(self._moved_zero_deg) < SMALL_OFFSET_DEG:
                self._moved_zero_deg = 0.0
            self._monitor.clear()
            self._trusted, self._weight, self._good, self._bad = True, 1.0, 0, 0
        return check

    def _decide(self, alarms: int) -> None:
        distrusted = alarms & _DISTRUSTED
        if not distrusted or (not distrusted & ~_UNFAMILIAR and self._monitor.predicts_no_worse):
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
        """Return the weight of the trained estimator, on its way to one or to zero.

        Without a measurement, one that predicts by the fallback's own model adds nothing to it, as it was not
        trained to predict; without a pull, one that weights the command more is more wrong.
        """
        blind = not self._own_physics and bool(faults & _BLIND)
        step = elapsed_s / BLEND_S
        if self._trusted and not blind and not faults & _UNCOMMANDED:
            return min(self._weight + step, 1.0)
        return max(self._weight - step, 0.0)

    def _read(self, bend: float, half_width: float, source: Source, alarms: int) -> Reading:
        if not half_width < UNKNOWN_DEG:
            half_width = UNKNOWN_DEG
        self.present = self.advanced.state
        if self._lag is not None and self.advanced.state is not None and self.fallback.state is not None:
            moved, wider = self._until_now(self._lag)
            bend, half_width = bend + moved, min(half_width + wider, UNKNOWN_DEG)
        raised = Alarm(alarms) if alarms else _NO_ALARM
        low, high = bend - half_width, bend + half_width
        if alarms & _OFFSET:
            offset = OFFSET_SHARE * self._offset.offset_deg
            low, high = low - max(offset, 0.0), high - min(offset, 0.0)
        if self._moved_zero_deg and source is not Source.TWINS:
            raised |= Alarm.OFFSET
            low, high = low - max(self._moved_zero_deg, 0.0), high - min(self._moved_zero_deg, 0.0)
        if self._check is not None and self._check.doubted:
            twins_deg, half = self._check.prediction()
            low, high = min(low, twins_deg - half), max(high, twins_deg + half)
        self.reading = Reading(bend, low, high, source, self.advanced.health, raised)
        return self.reading

    def _until_now(self, lag: Lag) -> tuple[float, float]:
        """Return how far the estimate moves from the time of the measurement to now, and the interval grows.

        Both are of the two estimators by their weights [deg].
        """
        advanced, fallback, weight = self.advanced, self.fallback, self._weight
        self.present = lag.predicted(advanced)
        alone, before = lag.predicted(fallback), fallback.state
        assert isinstance(before, TwoStates)
        moved = weight * (advanced.form.bend_deg(self.present) - advanced.bend_deg)
        moved += (1 - weight) * (fallback.form.bend_deg(alone) - fallback.bend_deg)
        wider = DEVIATIONS_OF_95 * (math.sqrt(alone.p) - math.sqrt(before.p))
        if self._states_interval:
            wider *= 1 - weight
            wider += weight * (advanced.form.half_width_deg(self.present) - advanced.half_width_deg)
        return moved, max(wider, 0.0)


REST, UNKNOWN = STARTS = ("rest", "unknown")
"""History of a session before its start: at rest, or unknown."""


def load_runtime(
    path: str | Path,
    *,
    sample_time: float | None = None,
    noise_variance: float | None = None,
    initial_bend_deg: float = 0.0,
    limits: StreamLimits | None = None,
    sensor: SensorModel | None = None,
    start: str = UNKNOWN,
    initial_deviation_deg: float = math.inf,
    twins: "tuple[Preset, Ranges] | None" = None,
) -> AssuredEstimator:
    """Return the runtime of a trained file, ready for the first sample.

    The sample time T [s] is that of `load_estimator_at`, if not given; the sensor that measurements are
    corrected for, and the variance R of its noise [deg^2], are those of the trained file. Samples beyond the
    limits are refused. A session starts at `REST`, or with an `UNKNOWN` history. Estimators that support it
    weight the initial estimate by its standard deviation. The twins that check the sensor are of the ranges
    of an endoscope (`twins`), or those that it was trained on; RAM (twins) has its own.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, not a file that training wrote, or cannot run at this sample time.
    """
    prepared = prepare_runtime(
        path,
        sample_time=sample_time,
        noise_variance=noise_variance,
        limits=limits,
        sensor=sensor,
        start=start,
        initial_deviation_deg=initial_deviation_deg,
        twins=twins,
    )
    return prepared(initial_bend_deg)


def prepare_runtime(
    path: str | Path | TrainedFile,
    *,
    sample_time: float | None = None,
    noise_variance: float | None = None,
    limits: StreamLimits | None = None,
    sensor: SensorModel | None = None,
    start: str = UNKNOWN,
    initial_deviation_deg: float = math.inf,
    twins: "tuple[Preset, Ranges] | None" = None,
) -> Callable[[float], AssuredEstimator]:
    """Read a trained file once for many streams: the function from an initial estimate to a runtime."""
    file = path if isinstance(path, TrainedFile) else read_trained_file(Path(path))
    deployment = deployment_of(file)
    if sample_time is not None:
        sample_time = _positive("sample_time", sample_time)
    sensor = sensor_of(file) if sensor is None else sensor
    if noise_variance is None:
        of_training = float(np.asarray(deployment.fallback.measurement_variance))
        noise_variance = sensor.variance_deg2 or of_training
    noise_variance = _positive("noise_variance", noise_variance) / sensor.scale**2
    if start not in STARTS:
        raise InputError(f"start = {start!r}: valid are {', '.join(STARTS)}")
    if not initial_deviation_deg > 0:
        raise InputError(f"initial_deviation_deg = {initial_deviation_deg:g}: must be positive")
    estimator, T = load_estimator_at(file, sample_time, sensor)
    estimator = estimator.begun(start == REST, initial_deviation_deg)
    advanced = estimator.with_sensor(Sensor(noise_variance, sensor.zero_deviation_deg / sensor.scale))
    method = next(spec.name for spec in method_specs() if spec.training and spec.training.agent == file.agent)
    fallback = deployment.fallback_at(T, noise_variance)
    checked_by = None if estimator.has_physics else twins or twins_of(file)
    return functools.partial(
        AssuredEstimator,
        *(method, advanced, fallback, deployment),
        limits=limits,
        sensor=PLAIN if sensor.is_plain else sensor,
        twins=draw_twins(*checked_by, deployment.pull_mm, T, start == REST) if checked_by else None,
    )


def _positive(name: str, value: Any) -> float:
    number = real_number(name, value)
    if not 0 < number < math.inf:
        raise InputError(f"{name} = {number:g}: must be positive and finite")
    return number
