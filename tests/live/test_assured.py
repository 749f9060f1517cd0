"""A trained estimator with its fallback: which one is used, when, and how the estimate moves between them."""

import dataclasses
import math
import resource
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import COLEMAN_HODGDON

from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import Deployment
from twin.estimation.estimator import Estimator
from twin.live.assured import DISTRUSTED, AssuredEstimator
from twin.live.lag import Lag
from twin.live.online import OnlineEstimator
from twin.live.reading import Alarm, Health, Source
from twin.preset.sensor import SensorModel

T, R = 0.1, 0.1
FALLBACK = ActiveModel(COLEMAN_HODGDON, T, (1e-3, 4e-2), R, (100.0, 1.0))
DEPLOYMENT = Deployment(FALLBACK, (1.5, 4.5), (40.0, 90.0), 2.0, 40.0)
FLAGS = Alarm.INPUT | Alarm.STUCK | Alarm.TIMEOUT
Sample = tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Offset(ActiveModel):
    """A filter whose estimate is off by a constant above some angle [deg], as a bad policy would be."""

    offset_deg: float = 0.0
    from_deg: float = -math.inf

    def bend_deg(self, state):
        return state.mean[0] + self.offset_deg * (state.mean[0] > self.from_deg)

    def single(self):
        return Estimator.single(self)  # its estimate is not that of its state


def stream(samples, seed=0):
    """Pull [mm], true angle and measurement [deg] of an endoscope that drifts from its model."""
    time = np.arange(samples) * T
    pull = 3 + np.sin(2 * np.pi * time / 12)
    truth = COLEMAN_HODGDON.response(pull, 60.0) + 2 * np.sin(2 * np.pi * time / 40)
    return pull, truth, truth + math.sqrt(R) * np.random.default_rng(seed).standard_normal(samples)


def assured(advanced=FALLBACK, deployment=DEPLOYMENT):
    return AssuredEstimator("test", advanced, FALLBACK, deployment, 65.0)


def run(advanced, samples=600, deployment=DEPLOYMENT):
    pull, truth, measurement = stream(samples)
    live = assured(advanced, deployment)
    return live, [live.push(k * T, pull[k], measurement[k]) for k in range(samples)], truth


def begun(samples=200):
    """A pair after so many good samples, and the stream that goes on from there."""
    pull, truth, measurement = stream(samples + 200)
    live = assured()
    for k in range(samples):
        live.push(k * T, pull[k], measurement[k])
    return live, pull, truth, measurement


# Faults yield what comes in the place of good samples, and whether it is faulty.


def no_measurement(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    return (((time, pull, math.nan), True) for time, pull, _ in good)


def no_pull(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    return (((time, math.nan, measured), True) for time, _, measured in good)


def spikes(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    for time, pull, measured in good:
        yield (time, pull, measured + rng.choice([-1, 1]) * rng.uniform(15, 90)), True


def stuck(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    return (((time, pull, good[0][2]), place > 0) for place, (time, pull, _) in enumerate(good))


def infinite(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    for time, pull, _ in good:
        yield (time, pull, float(rng.choice([math.inf, -math.inf, 1e300, -1e5]))), True


def repeated(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    return ((sample, again) for sample in good for again in (False, True))


def out_of_order(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    for first, second in zip(good[::2], good[1::2], strict=False):
        yield second, False
        yield first, True


def clock_jump(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    wrong = float(rng.choice([-3600.0, 1e12, math.nan]))
    return (((time + wrong, pull, measured), True) for time, pull, measured in good[:3])


def silence(good: list[Sample], rng: np.random.Generator) -> Iterator[tuple[Sample, bool]]:
    return iter([(good[-1], True)] if len(good) > 1 else [])


FAULTS = (no_measurement, no_pull, spikes, stuck, infinite, repeated, out_of_order, clock_jump, silence)


def test_good_estimator_is_used_without_an_alarm():
    live, readings, truth = run(FALLBACK, 2000)
    assert live.switches == live.fallback_samples == 0
    late = readings[100:]
    assert {reading.source for reading in late} == {Source.ADVANCED}
    assert all(reading.alarms is Alarm.NONE and reading.health is Health.GOOD for reading in late)
    covered = [
        reading.low_deg <= bend <= reading.high_deg for reading, bend in zip(late, truth[100:], strict=True)
    ]
    assert np.mean(covered) > 0.9
    assert readings == run(FALLBACK, 2000)[1]  # the same bits


@pytest.mark.parametrize("offset_deg", [-8.0, 8.0])
def test_estimator_that_goes_astray_is_replaced_within_three_seconds(offset_deg):
    live, readings, truth = run(Offset(**vars(FALLBACK), offset_deg=offset_deg, from_deg=75.0))
    astray = next(k for k, bend in enumerate(truth) if k > 100 and bend > 75)
    after = readings[astray : astray + 30]
    assert after[-1].source is Source.FALLBACK
    assert after[-1].alarms & (Alarm.DISAGREEMENT | Alarm.INNOVATION)
    assert abs(after[-1].bend_deg - truth[astray + 29]) < 2
    assert live.switches >= 1


def test_estimate_does_not_jump_where_trust_moves():
    _, readings, truth = run(Offset(**vars(FALLBACK), offset_deg=6.0))
    blends = [k for k, reading in enumerate(readings) if reading.source is Source.BLEND]
    assert blends
    steps = np.abs(np.diff([reading.bend_deg for reading in readings]) - np.diff(truth))
    assert max(steps[k - 1] for k in blends) < 6.0 / 5 + 1.0  # a fifth of the way a sample, and the noise


def test_trust_is_lost_by_three_alarms_in_a_row_and_returns_after_five_seconds_without_one():
    live, readings, _ = run(Offset(**vars(FALLBACK), offset_deg=60.0, from_deg=75.0), 1200)
    alarmed = [bool(reading.alarms & DISTRUSTED) for reading in readings]
    fallback = [reading.source is Source.FALLBACK for reading in readings]
    assert live.switches >= 2
    for k in range(200, 1200):
        if all(alarmed[k - 8 : k + 1]):
            assert fallback[k]
        if not any(alarmed[k - 60 : k + 1]):
            assert readings[k].source is Source.ADVANCED
        if fallback[k] and not fallback[k - 1]:
            assert any(all(alarmed[m - 2 : m + 1]) for m in range(k - 6, k + 1))


@pytest.mark.parametrize("kind", [int, np.float32, np.array])
def test_stuck_sensor_is_found_within_three_samples_and_does_not_hold_the_estimate(kind):
    live, pull, truth, _ = begun()
    readings = [live.push(k * T, pull[k], kind(75)) for k in range(200, 230)]
    assert all(Alarm.STUCK in reading.alarms for reading in readings[2:])
    assert abs(readings[-1].bend_deg - truth[229]) < abs(75 - truth[229]) / 2


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_planted_fault_is_flagged_within_three_samples_and_harms_no_more_than_the_fallback(fault):
    pull, truth, measurement = stream(4000, seed=3)
    live, alone = assured(), OnlineEstimator(FALLBACK, T, 65.0)
    rng = np.random.default_rng(4)
    samples = [(k * T, float(pull[k]), float(measurement[k])) for k in range(4000)]
    k, squares = 0, np.zeros(2)
    while k < 3800:
        for sample in samples[k : k + 100]:
            live.push(*sample), alone.push(*sample)
        k += 100
        length = int(rng.integers(4, 20))
        began = flagged = None
        for place, (sample, faulty) in enumerate(fault(samples[k : k + length], rng)):
            reading, bend = live.push(*sample), alone.push(*sample)
            assert math.isfinite(reading.bend_deg)
            assert reading.low_deg <= reading.bend_deg <= reading.high_deg
            began = place if faulty and began is None else began
            flag = reading.health is not Health.GOOD or reading.alarms & FLAGS
            flagged = place if began is not None and flagged is None and flag else flagged
            at = round(sample[0] / T) if abs(sample[0]) < 400 else None
            if faulty and at is not None and 0 <= at < 4000:
                squares += (reading.bend_deg - truth[at]) ** 2, (bend - truth[at]) ** 2
        assert began is None or (flagged is not None and flagged - began < 3)
        k += length
    assert math.sqrt(squares[0]) <= 1.1 * math.sqrt(squares[1]) + 1e-9


def test_good_samples_raise_no_flag():
    """Of continuous noise, heavy or not; `make endurance` has millions."""
    pull, truth, _ = stream(10_000)
    noise = np.random.default_rng(9).laplace(scale=math.sqrt(R / 2), size=10_000)
    live, flagged = assured(), 0
    for k in range(10_000):
        reading = live.push(k * T, pull[k], truth[k] + noise[k])
        flagged += k > 100 and bool(reading.alarms or reading.health)
    assert flagged <= 1


any_number = st.floats(allow_nan=True, allow_infinity=True)
times = st.one_of(st.floats(-1, 30), any_number)
rarely_broken = st.one_of(st.floats(-5, 90), any_number)


@given(st.lists(st.tuples(times, rarely_broken, rarely_broken), max_size=40))
@settings(max_examples=50, deadline=None)
def test_estimate_and_interval_are_numbers_whatever_comes(samples):
    live = assured()
    for sample in samples:
        reading = live.push(*sample)
        assert math.isfinite(reading.bend_deg)
        assert reading.low_deg <= reading.bend_deg <= reading.high_deg
        assert reading.high_deg - reading.low_deg <= 360


TURN = 1200  # samples after which the stream repeats


def endless(first, count, pull, truth, rng):
    noise = math.sqrt(R) * rng.standard_normal(count)
    places = np.arange(first, first + count) % TURN
    return [
        ((first + k) * T, float(pull[place]), float(truth[place] + noise[k]))
        for k, place in enumerate(places)
    ]


@pytest.mark.endurance
def test_a_million_samples_with_planted_faults():
    pull, truth, _ = stream(TURN)
    rng = np.random.default_rng(8)
    live, k, faulty, missed, good, false = assured(), 0, 0, 0, 0, 0
    while live.samples < 1_000_000 or faulty < 100_000:
        fault = FAULTS[int(rng.integers(len(FAULTS)))]
        length = int(rng.choice([4, 5, 10, 30, 100]))
        began = flagged = None
        for place, (sample, is_faulty) in enumerate(fault(endless(k, length, pull, truth, rng), rng)):
            reading = live.push(*sample)
            assert math.isfinite(reading.bend_deg + reading.low_deg + reading.high_deg)
            faulty += is_faulty
            began = place if is_faulty and began is None else began
            flag = reading.health is not Health.GOOD or reading.alarms & FLAGS
            flagged = place if began is not None and flagged is None and flag else flagged
        missed += began is not None and (flagged is None or flagged - began >= 3)
        k += length
        for number, sample in enumerate(endless(k, 150, pull, truth, rng)):
            reading = live.push(*sample)
            if number > 100:  # after the consequences of the fault
                good += 1
                false += reading.health is not Health.GOOD or reading.alarms is not Alarm.NONE
        k += 150
    print(f"{live.samples} samples, {faulty} faulty: {missed} faults missed; {false} flags in {good} good")
    assert missed == 0
    assert false <= good / 1e5 + 1


@pytest.mark.endurance
def test_memory_is_flat_over_ten_million_samples():
    pull, truth, _ = stream(TURN)
    rng = np.random.default_rng(8)
    live, used = assured(), []
    for block in range(100):
        for sample in endless(100_000 * block, 100_000, pull, truth, rng):
            live.push(*sample)
        used.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    assert used[-1] - used[10] < 2


def test_silence_of_the_sensor_is_found():
    live, pull, _, _ = begun()
    alarms = [live.push(k * T, pull[k]).alarms for k in range(200, 230)]
    assert Alarm.TIMEOUT in alarms[-1]
    assert Alarm.TIMEOUT not in alarms[2]


def test_what_is_no_number_is_refused_and_changes_nothing():
    live = assured()
    live.push(0.0, 3.0, 60.0)
    before = live.reading
    for _ in range(3):  # the number after it has not been seen either
        with pytest.raises(ValueError, match="time_s = 'x': must be a number"):
            live.push("x", 3.0, 60.5)
    assert live.reading == before
    assert Alarm.STUCK not in live.push(0.1, 3.0, 60.5).alarms


LATE = 2  # samples


def late(sensor):
    return AssuredEstimator("test", FALLBACK, FALLBACK, DEPLOYMENT, 65.0, sensor=sensor)


def readings(live, pull, measured):
    return [live.push(k * T, pull[k], measured[k]) for k in range(len(pull))]


def test_zero_and_scale_are_corrected():
    pull, _, measured = stream(200)
    corrected = readings(late(SensorModel(zero_deg=2.0, scale=1.1)), pull, 1.1 * measured + 2.0)
    plain = readings(assured(), pull, measured)
    np.testing.assert_allclose([of.bend_deg for of in corrected], [of.bend_deg for of in plain], atol=1e-9)


def test_the_estimate_is_the_prediction_from_the_time_of_the_reading():
    """The same filter, run where readings are from, and its model from there on."""
    pull, truth, measured = stream(300)
    seen = np.concatenate([np.full(LATE, measured[0]), measured[:-LATE]])
    found = readings(late(SensorModel(lag_s=LATE * T)), pull, seen)
    then = readings(assured(), np.concatenate([np.full(LATE, pull[0]), pull[:-LATE]]), seen)
    for k in range(50, 300):
        # the model keeps the error that the filter has found: eq. 5 of each step is its response
        moved = COLEMAN_HODGDON.response(pull[k - LATE : k + 1], then[k].bend_deg)[-1]
        assert found[k].bend_deg == pytest.approx(moved, abs=0.5)
        assert found[k].high_deg - found[k].low_deg >= then[k].high_deg - then[k].low_deg
    error, old = (np.array([of.bend_deg for of in some[50:]]) - truth[50:] for some in (found, then))
    assert np.sqrt(np.mean(error**2)) < 0.25 * np.sqrt(np.mean(old**2))
    assert all(of.source is Source.ADVANCED for of in found[50:])


def test_a_wrong_pull_is_not_followed():
    pull, _, measured = stream(200)
    live = late(SensorModel(lag_s=LATE * T))
    before = readings(live, pull[:150], measured[:150])[-1]
    reading = live.push(150 * T, 80.0, measured[150])
    assert abs(reading.bend_deg - before.bend_deg) < 2


def test_pulls_of_the_past_are_linear_between_samples():
    lag = Lag(0.25)
    assert math.isnan(lag.pull_mm(0.0, math.nan))
    found = [lag.pull_mm(0.1 * k, float(k)) for k in range(1, 8)]
    np.testing.assert_allclose(found, [1, 1, 1, 1.5, 2.5, 3.5, 4.5], atol=1e-12)
    assert lag.pull_mm(0.8, math.nan) == pytest.approx(5.5)  # the pull stands at 7
    assert lag.pull_mm(0.8, 100.0) == 100.0  # a repeated stamp, which the estimators ignore
    assert lag.pull_mm(1.05, 7.0) == pytest.approx(7.0)
    assert lag.pull_mm(-5.0, 3.0) == 3.0  # another clock


def test_noise_variance_is_that_of_corrected_measurements():
    assert assured().noise_variance == R


@dataclasses.dataclass(frozen=True)
class Unexplained(Offset):
    """A filter on twins, none of which explains an error of the angle [deg]."""

    error_deg: float = 0.0

    @property
    def has_physics(self):
        return True

    def model_error_deg(self, state):
        return self.error_deg, 0.05


@pytest.mark.parametrize("error", [-2.0, 0.3, 2.0])
def test_measurements_that_stay_off_all_twins_widen_the_interval_to_them(error):
    _, readings, _ = run(Unexplained(**vars(FALLBACK) | {"error_deg": error}), 60)
    for reading in readings[12:]:
        above, below = reading.high_deg - reading.bend_deg, reading.bend_deg - reading.low_deg
        assert bool(reading.alarms & Alarm.OFFSET) is (abs(error) > 1)
        assert below - above == pytest.approx(1.5 * error if abs(error) > 1 else 0.0, abs=1e-9)
        assert reading.source is Source.ADVANCED
