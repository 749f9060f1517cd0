"""A trained estimator beside its fallback: who is believed, when, and how the estimate moves between them."""

import dataclasses
import math

import numpy as np
import pytest
from assured_streams import DEPLOYMENT, FALLBACK, Offset, R, Runaway, T, assured, stream
from hypothesis import given, settings
from hypothesis import strategies as st
from planted_faults import FAULTS

from twin.estimation.health import Health
from twin.estimation.online import OnlineEstimator
from twin.runtime.assured import AssuredEstimator
from twin.runtime.monitor import DISTRUSTED, Monitor
from twin.runtime.reading import Alarm, Source

FLAGS = Alarm.INPUT | Alarm.STUCK | Alarm.TIMEOUT
any_number = st.floats(allow_nan=True, allow_infinity=True)
times = st.one_of(st.floats(-1, 30), any_number)
rarely_broken = st.one_of(st.floats(-5, 90), any_number)


def run(advanced, samples=600, seed=0):
    pull, truth, measurement = stream(samples, seed)
    live = assured(advanced)
    readings = [live.push(k * T, pull[k], measurement[k]) for k in range(samples)]
    return live, readings, truth


def test_a_good_estimator_is_believed_without_an_alarm():
    live, readings, truth = run(FALLBACK, 3000)
    assert live.switches == live.fallback_samples == 0
    late = readings[100:]
    assert {reading.source for reading in late} == {Source.ADVANCED}
    assert all(reading.alarms is Alarm.NONE and reading.health is Health.GOOD for reading in late)
    held = [
        reading.low_deg <= bend <= reading.high_deg for reading, bend in zip(late, truth[100:], strict=True)
    ]
    assert np.mean(held) > 0.9


@pytest.mark.parametrize("offset_deg", [-8.0, 8.0])
def test_an_estimator_that_goes_astray_is_left_within_three_seconds(offset_deg):
    live, readings, truth = run(Offset(**vars(FALLBACK), offset_deg=offset_deg, from_deg=75.0))
    astray = next(k for k, bend in enumerate(truth) if k > 100 and bend > 75)
    after = readings[astray : astray + 30]
    assert after[-1].source is Source.FALLBACK
    assert after[-1].alarms & (Alarm.DISAGREEMENT | Alarm.INNOVATION)
    assert abs(after[-1].bend_deg - truth[astray + 29]) < 2
    assert live.switches >= 1


@pytest.mark.parametrize("rate_deg_s", [55.0, 80.0, 200.0, math.nan])
def test_an_estimator_that_begins_anew_again_and_again_is_left(rate_deg_s):
    """Each time nothing is known of it: it must not be trusted for that."""
    wide = dataclasses.replace(DEPLOYMENT, bend_deg=(-270.0, 270.0), bend_speed_deg_s=500.0)
    pull, truth, measurement = stream(1200)
    live = AssuredEstimator("test", Runaway(**vars(FALLBACK), rate_deg_s=rate_deg_s), wide, T, R, 65.0)
    readings = [live.push(k * T, pull[k], measurement[k]) for k in range(1200)]
    assert live.switches >= 1
    assert any(Alarm.LOST in reading.alarms for reading in readings)
    error = np.array([reading.bend_deg for reading in readings[150:]]) - truth[150:]
    assert np.sqrt(np.mean(error**2)) < 0.5


def test_the_estimate_does_not_jump_where_trust_moves():
    _, readings, truth = run(Offset(**vars(FALLBACK), offset_deg=6.0))
    blends = [k for k, reading in enumerate(readings) if reading.source is Source.BLEND]
    assert blends
    steps = np.abs(np.diff([reading.bend_deg for reading in readings]) - np.diff(truth))
    assert max(steps[k - 1] for k in blends) < 6.0 / 5 + 1.0  # a fifth of the way a sample, and the noise


def test_trust_is_lost_by_three_alarms_in_a_row_and_comes_back_after_five_seconds_without_one():
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


def test_a_command_beyond_the_training_takes_the_fallback():
    live = assured()
    pull, _, measurement = stream(400)
    for k in range(200):
        live.push(k * T, pull[k], measurement[k])
    for k in range(200, 260):
        reading = live.push(k * T, min(pull[200] + 0.05 * (k - 199), 5.5), measurement[200])
    assert Alarm.COMMAND in reading.alarms
    assert reading.source is Source.FALLBACK


@pytest.mark.parametrize("kind", [int, np.float32, np.float64, np.array])
def test_a_stuck_sensor_is_told_whatever_type_its_numbers_have(kind):
    live = assured()
    pull, _, measurement = stream(200)
    for k in range(150):
        live.push(k * T, pull[k], measurement[k])
    told = [live.push(k * T, pull[k], kind(75)).alarms for k in range(150, 160)]
    assert all(Alarm.STUCK in alarms for alarms in told[2:])


def test_packets_that_come_twice_do_not_make_a_stuck_sensor_usual():
    live = assured()
    pull, _, measurement = stream(400)
    for k in range(300):
        for _ in range(3):
            live.push(k * T, pull[k], measurement[k])
    told = [live.push(k * T, pull[k], measurement[299]).alarms for k in range(300, 310)]
    assert all(Alarm.STUCK in alarms for alarms in told[2:])


def test_a_stuck_sensor_is_told_within_three_samples_and_does_not_hold_the_estimate():
    live = assured()
    pull, truth, measurement = stream(400)
    for k in range(200):
        live.push(k * T, pull[k], measurement[k])
    for k in range(200, 230):
        reading = live.push(k * T, pull[k], measurement[199])
        if k >= 202:
            assert Alarm.STUCK in reading.alarms
    assert abs(reading.bend_deg - truth[229]) < abs(measurement[199] - truth[229]) / 2


def test_a_quantised_sensor_is_soon_not_stuck():
    live = assured()
    pull, truth, _ = stream(2000)
    rounded = np.round(truth / 2) * 2
    alarms = [Alarm.STUCK in live.push(k * T, pull[k], rounded[k]).alarms for k in range(2000)]
    assert 0 < sum(alarms[:200]) < 100
    assert sum(alarms[200:]) < 20


def test_silence_of_the_sensor_is_told():
    live = assured()
    pull, _, measurement = stream(300)
    for k in range(200):
        live.push(k * T, pull[k], measurement[k])
    told = [live.push(k * T, pull[k]).alarms for k in range(200, 230)]
    assert Alarm.TIMEOUT in told[-1]
    assert Alarm.TIMEOUT not in told[2]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_a_planted_fault_is_flagged_within_three_samples_and_harms_no_more_than_the_fallback(fault):
    pull, truth, measurement = stream(4000, seed=3)
    live, alone = assured(), OnlineEstimator(FALLBACK, T, 65.0)
    rng = np.random.default_rng(4)
    samples = [(k * T, float(pull[k]), float(measurement[k])) for k in range(4000)]
    k, squares, flags = 0, np.zeros(2), []
    while k < 3800:
        for sample in samples[k : k + 100]:
            live.push(*sample), alone.push(*sample)
        k += 100
        length = int(rng.integers(4, 20))
        began, flagged = None, None
        for place, (sample, faulty) in enumerate(fault(samples[k : k + length], rng)):
            reading, bend = live.push(*sample), alone.push(*sample)
            assert math.isfinite(reading.bend_deg)
            assert reading.low_deg <= reading.bend_deg <= reading.high_deg
            began = place if faulty and began is None else began
            if (
                began is not None
                and flagged is None
                and (reading.health is not Health.GOOD or reading.alarms & FLAGS)
            ):
                flagged = place
            at = round(sample[0] / T) if math.isfinite(sample[0]) and abs(sample[0]) < 400 else None
            if faulty and at is not None and 0 <= at < 4000:
                squares += (reading.bend_deg - truth[at]) ** 2, (bend - truth[at]) ** 2
        flags.append(began is None or (flagged is not None and flagged - began < 3))
        k += length
    assert all(flags)
    assert math.sqrt(squares[0]) <= 1.1 * math.sqrt(squares[1]) + 1e-9


def test_good_samples_raise_no_flag():
    """Of continuous noise, heavy or not: 20,000 samples; `make endurance` has a million."""
    pull, truth, _ = stream(20_000)
    noise = np.random.default_rng(9).laplace(scale=math.sqrt(R / 2), size=20_000)
    live, flagged = assured(), 0
    for k in range(20_000):
        reading = live.push(k * T, pull[k], truth[k] + noise[k])
        flagged += k > 100 and bool(reading.alarms or reading.health)
    assert flagged <= 2


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.tuples(st.one_of(st.floats(-1, 30), any_number), rarely_broken, rarely_broken), max_size=40)
)
def test_whatever_comes_the_estimate_and_its_interval_are_numbers(samples):
    live = assured()
    for sample in samples:
        reading = live.push(*sample)
        assert math.isfinite(reading.bend_deg)
        assert reading.low_deg <= reading.bend_deg <= reading.high_deg
        assert reading.high_deg - reading.low_deg <= 360


def test_the_same_samples_give_the_same_bits():
    first, second = (run(FALLBACK)[1] for _ in range(2))
    assert first == second


def test_what_is_no_number_is_refused_and_changes_nothing():
    live = assured()
    live.push(0.0, 3.0, 60.0)
    before = live.reading
    with pytest.raises(ValueError, match="pull_mm = 'x': must be a number"):
        live.push(0.1, "x", 60.0)
    assert live.reading == before
    for _ in range(3):  # a number of it that is one has not been seen either
        with pytest.raises(ValueError, match="time_s = 'x': must be a number"):
            live.push("x", 3.0, 60.5)
    assert Alarm.STUCK not in live.push(0.1, 3.0, 60.5).alarms


def test_a_fault_before_the_stream_begins_is_told():
    live = assured()
    assert live.push(math.nan, 1.0, 1.0).alarms == Alarm.BEGINNING | Alarm.INPUT
    waiting = live.push(0.0, math.nan, 1.0)
    assert waiting.interval_deg is None
    assert waiting.high_deg - waiting.low_deg == pytest.approx(360)
    live.push(0.1, 3.0, 65.0)
    assert live.push(0.2, 3.0, 65.5).interval_deg is not None


def test_judging_begins_after_the_same_time_however_few_samples_have_a_measurement():
    """As where a camera is slower than the drive."""
    pull, _, measurement = stream(400)
    ended = []
    for every in (1, 4):
        live = assured()
        of_stream = [
            live.push(k * T, pull[k], measurement[k] if k % every == 0 else math.nan) for k in range(200)
        ]
        ended.append(next(k for k, reading in enumerate(of_stream) if Alarm.BEGINNING not in reading.alarms))
    assert ended[0] * T == pytest.approx(2.5, abs=0.2)
    assert abs(ended[1] - ended[0]) <= 4


@pytest.mark.parametrize(("sample_time", "samples"), [(0.02, 125), (T, 25), (2.0, 3)])
def test_judging_begins_after_a_window_at_any_sample_time(sample_time, samples):
    monitor = Monitor(DEPLOYMENT, sample_time, R)
    told = [
        monitor.judge(60.0, 1.0, 60.0, 1.0, 0.1, 0.2, 0.0, 3.0, sample_time, measured=True)
        for _ in range(samples + 3)
    ]
    begun = next(k for k, alarms in enumerate(told) if not alarms & Alarm.BEGINNING.value)
    assert abs(begun - samples) <= 1


def test_the_fallback_is_tuned_for_another_sample_time_as_a_random_walk():
    finer = DEPLOYMENT.fallback_at(T / 4, 2.0)
    assert finer.sample_time == T / 4
    assert finer.measurement_variance == 2.0
    np.testing.assert_allclose(np.array(finer.process_variance) * 4, FALLBACK.process_variance)
    assert dataclasses.replace(finer, sample_time=T).model == FALLBACK.model
