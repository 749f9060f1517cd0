"""The sensor: what it reports against a naive loop in exact arithmetic, and the statistics of its noise."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats

from twin.preset.preset import Preset
from twin.signals.sensor import measure

SIGMAS = 5  # one test in two million fails by chance; the seed is fixed anyway
TICK = Fraction(1, 1000)  # s; not a binary fraction: sums of it round
STARTS = st.floats(0.0, 1000.0) | st.just(1.7e9)  # s; the last one as a clock on the wall counts
ANGLES = st.floats(-3.0, 3.0)


def report(time, bend, seed: int = 0, **parameters) -> np.ndarray:
    preset = Preset("sensor", **{f"sensor_{name}": value for name, value in parameters.items()})
    return measure(preset, np.asarray(time), np.asarray(bend), np.random.default_rng(seed))


def swing(time: np.ndarray) -> np.ndarray:
    return np.sin(3 * time) + 0.2 * np.cos(17 * time)


def naive(ticks: list[int], bend: list[float], period: int, latency: int) -> list[Fraction]:
    """One sample after the other, one reading after the other, in whole ticks: nothing rounds."""
    reported = []
    for now in ticks:
        if period:
            taken = [ticks[0] + period * j for j in range((ticks[-1] - ticks[0]) // period + 1)]
        else:
            taken = ticks
        arrived = [instant for instant in taken if instant + latency <= now]
        instant = arrived[-1] if arrived else ticks[0]

        after = next(k for k, tick in enumerate(ticks) if tick >= instant)
        if ticks[after] == instant:
            reported.append(Fraction(bend[after]))
        else:
            share = Fraction(instant - ticks[after - 1], ticks[after] - ticks[after - 1])
            reported.append((1 - share) * Fraction(bend[after - 1]) + share * Fraction(bend[after]))
    return reported


@given(bend=st.lists(ANGLES, min_size=1, max_size=50), start=st.floats(0.0, 100.0))
@example(bend=[0.0, -0.0, 5e-324], start=0.0)
def test_sensor_without_parameters_reports_the_truth_bit_for_bit_and_draws_nothing(bend, start):
    rng = np.random.default_rng(0)
    time, truth = start + 0.01 * np.arange(len(bend)), np.array(bend)
    reported = measure(Preset("ideal"), time, truth, rng)
    assert reported.tobytes() == truth.tobytes()
    assert reported is not truth
    assert rng.bit_generator.state == np.random.default_rng(0).bit_generator.state


@given(
    start=st.integers(0, 10_000),
    increments=st.lists(st.integers(1, 20), max_size=40) | st.integers(1, 20).map(lambda step: [step] * 40),
    period=st.integers(0, 60),
    latency=st.integers(0, 100),
    data=st.data(),
)
def test_report_is_that_of_a_naive_loop_in_exact_arithmetic(start, increments, period, latency, data):
    ticks = [start + sum(increments[:k]) for k in range(len(increments) + 1)]
    bend = data.draw(st.lists(ANGLES, min_size=len(ticks), max_size=len(ticks)))
    time = [float(tick * TICK) for tick in ticks]
    reported = report(time, bend, period=float(period * TICK), latency=float(latency * TICK))
    np.testing.assert_allclose(reported, np.array(naive(ticks, bend, period, latency), float), atol=1e-12)


@given(
    sample_time=st.floats(1e-4, 0.1),
    start=STARTS,
    ratio=st.integers(1, 7),
    summed=st.booleans(),
)
def test_period_of_whole_samples_gives_one_reading_every_so_many(sample_time, start, ratio, summed):
    time = start + (np.cumsum(np.full(300, sample_time)) if summed else sample_time * np.arange(300))
    bend = np.random.default_rng(1).uniform(-1, 1, 300)
    every = np.repeat(bend[::ratio], ratio)[:300]
    assert report(time, bend, period=ratio * sample_time).tobytes() == every.tobytes()
    noisy = report(time, bend, period=ratio * sample_time, noise=0.1)
    assert len(np.unique(noisy)) == -(-300 // ratio)


@given(
    sample_time=st.floats(1e-3, 0.1),
    start=STARTS,
    delay=st.integers(0, 30),
    ratio=st.sampled_from([0, 0.4, 1, 3, 2.7]),
)
def test_latency_of_whole_samples_is_an_exact_shift(sample_time, start, delay, ratio):
    time = start + sample_time * np.arange(200)
    sensor = {"period": ratio * sample_time, "noise": 0.01, "resolution": 1e-3}
    prompt = report(time, swing(time), **sensor)
    late = report(time, swing(time), latency=delay * sample_time, **sensor)
    assert late[delay:].tobytes() == prompt[: 200 - delay].tobytes()
    assert (late[:delay] == prompt[0]).all()


@given(
    sample_time=st.floats(1e-3, 0.1),
    period=st.floats(1e-3, 0.5),
    latency=st.floats(0.0, 0.5),
)
def test_age_of_what_is_reported_lies_between_latency_and_a_period_more(sample_time, period, latency):
    time = 2.0 + sample_time * np.arange(400)
    age = time - report(time, time, period=period, latency=latency)  # the angle tells when it was read
    arrived = time >= 2.0 + latency + 1e-5 * sample_time
    assert (age[arrived] >= latency - 1e-5 * sample_time).all()
    assert (age[arrived] <= latency + period + 1e-5 * sample_time).all()
    np.testing.assert_array_equal((time - age)[~arrived], 2.0)


@given(bend=st.lists(ANGLES, min_size=1, max_size=50), step=st.floats(1e-6, 1.0))
def test_rounding_is_to_the_nearest_step(bend, step):
    reported = report(0.01 * np.arange(len(bend)), bend, resolution=step)
    assert (np.abs(reported - bend) <= step / 2 * (1 + 1e-9)).all()
    np.testing.assert_allclose(reported / step, np.round(reported / step), rtol=1e-12)


def test_noise_is_added_before_the_reading_is_rounded():
    reported = report(0.01 * np.arange(1000), np.full(1000, 0.3), noise=0.1, resolution=0.05)
    np.testing.assert_allclose(reported / 0.05, np.round(reported / 0.05), atol=1e-9)
    assert len(np.unique(reported)) > 5


@pytest.mark.parametrize("latency", [0.0, 0.013])
@pytest.mark.parametrize(("period", "noise"), [(0.0, 0.02), (0.01, 0.5), (0.025, 0.02)])
def test_noise_is_gaussian_independent_and_drawn_once_per_reading(period, noise, latency):
    time = 0.01 * np.arange(100_000)
    error = report(time, np.zeros_like(time), period=period, noise=noise, latency=latency)
    changes = np.flatnonzero(np.diff(error)) + 1
    readings = error[np.r_[0, changes]]
    newest = round(1e6 * time[-1]) - round(1e6 * latency)  # us
    assert len(readings) == newest // round(1e6 * (period or 0.01)) + 1

    count = len(readings)
    assert readings.mean() == pytest.approx(0.0, abs=SIGMAS * noise / np.sqrt(count))
    assert readings.var() == pytest.approx(noise**2, rel=SIGMAS * np.sqrt(2 / count))
    assert stats.kstest(readings / noise, stats.norm.cdf).pvalue > 0.001
    for lag in (1, 2, 10):
        correlation = np.mean(readings[lag:] * readings[:-lag]) / noise**2
        assert abs(correlation) < SIGMAS / np.sqrt(count)


def test_report_repeats_with_its_seed_and_leaves_the_truth_alone():
    time = 0.01 * np.arange(500)
    bend = swing(time)
    sensor = {"period": 0.03, "latency": 0.015, "noise": 0.05}
    first = report(time, bend, **sensor)
    assert first.tobytes() == report(time, bend, **sensor).tobytes()
    assert (first != report(time, bend, seed=1, **sensor)).any()
    report(time, bend, noise=0.05, resolution=0.1)
    assert bend.tobytes() == swing(time).tobytes()


@given(
    least=st.sampled_from([5e-324, 1e-300, 1e-20, 1e-10]),
    sample_time=st.floats(1e-3, 0.1),
    start=st.floats(0.0, 10.0),
    latency=st.floats(0.0, 1.0),
)
def test_sensor_of_tiny_period_and_step_reads_without_pause(least, sample_time, start, latency):
    time = start + sample_time * np.arange(100)
    rounding = 3e-6 * sample_time
    late = report(time, time, period=least, resolution=least, latency=latency)
    np.testing.assert_allclose(late, np.maximum(time - latency, start), atol=rounding)
    prompt = report(time, time, resolution=least)
    np.testing.assert_allclose(prompt, time, atol=least)


@pytest.mark.parametrize(("start", "sample_time"), [(1.9, 0.0556), (0.7, 0.0282), (4.0, 0.0774)])
def test_reading_that_rounds_past_the_last_sample_is_of_the_last_sample(start, sample_time):
    time = start + sample_time * np.arange(100)
    assert report(time, time, period=1e-6 * sample_time)[-1] == time[-1]


@pytest.mark.parametrize(
    ("time", "bend", "rule"),
    [
        ([0.0, 1.0, 1.0], [0.0, 0.0, 0.0], "time must increase"),
        ([0.0, 2.0, 1.0], [0.0, 0.0, 0.0], "time must increase"),
        ([0.0, np.nan, 1.0], [0.0, 0.0, 0.0], "time must increase"),
        ([0.0, 1.0], [0.0, 0.0, 0.0], r"time \(2,\) and bend \(3,\): must be two arrays of one length"),
        ([[0.0, 1.0]], [[0.0, 0.0]], r"must be two arrays of one length"),
        ([], [], r"must be two arrays of one length"),
    ],
)
def test_samples_that_do_not_belong_together_are_refused(time, bend, rule):
    with pytest.raises(ValueError, match=rule):
        report(time, bend)
