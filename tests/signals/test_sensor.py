"""The sensor: what it reports against a naive loop in exact arithmetic, and the statistics of its noise."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats

from twin.preset.preset import Preset
from twin.signals.noise import draw_noise, noise_variance
from twin.signals.sensor import estimated_variance, measure, smoothed

SIGMAS = 5  # one test in two million fails by chance; the seed is fixed anyway
TICK = Fraction(1, 1000)  # s; not a binary fraction: sums of it round
ANGLES = st.floats(-3.0, 3.0)


def report(time, bend, seed: int = 0, **parameters) -> np.ndarray:
    preset = Preset("sensor", **{f"sensor_{name}": value for name, value in parameters.items()})
    return measure(preset, np.asarray(time), np.asarray(bend), np.random.default_rng(seed))


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


@pytest.mark.parametrize(("start", "sample_time"), [(1.9, 0.0556), (0.7, 0.0282), (4.0, 0.0774)])
def test_reading_that_rounds_past_the_last_sample_is_of_the_last_sample(start, sample_time):
    time = start + sample_time * np.arange(100)
    assert report(time, time, period=1e-6 * sample_time)[-1] == time[-1]


@pytest.mark.parametrize(
    ("time", "bend", "rule"),
    [
        ([0.0, 1.0, 1.0], [0.0, 0.0, 0.0], "time must increase"),
        ([0.0, np.nan, 1.0], [0.0, 0.0, 0.0], "time must increase"),
        ([0.0, 1.0], [0.0, 0.0, 0.0], r"time \(2,\) and bend \(3,\): must be two arrays of one length"),
        ([], [], r"must be two arrays of one length"),
    ],
)
def test_samples_that_do_not_belong_together_are_refused(time, bend, rule):
    with pytest.raises(ValueError, match=rule):
        report(time, bend)


@pytest.mark.parametrize("noise", ["gaussian", "laplace", "gamma"])
def test_the_variance_of_noise_is_estimated_on_a_moving_path(noise):
    time = np.arange(0, 90, 1 / 30)
    path = 40 * np.sin(time) + 10 * np.abs(np.sin(0.7 * time))  # with corners
    readings = path + 0.6 * draw_noise(noise, 1.0, path.shape, np.random.default_rng(1))
    readings[::20] = np.nan
    scale = 0.36 * noise_variance(noise, 1.0)
    assert estimated_variance(readings) == pytest.approx(scale, rel=0.15)
    assert estimated_variance(path) < 1e-3
    smooth = smoothed(time, readings)
    known = np.isfinite(readings)
    assert np.isnan(smooth[~known]).all()
    left = smooth[known] - path[known]
    assert np.std(left) < 0.45 * np.sqrt(scale)


def test_a_coarse_sensor_is_not_free_of_noise():
    rounded = np.round(0.01 * np.arange(500) / 0.5) * 0.5
    assert estimated_variance(rounded) == pytest.approx(0.25 / 12)
    assert np.isnan(estimated_variance(rounded[:30]))
