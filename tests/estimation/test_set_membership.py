"""The set-membership filter: the truth never leaves its interval, and the interval is worth having."""

import dataclasses

import numpy as np
import pytest
from bounded_system import BATCH, COLEMAN_HODGDON, MODELS, SAMPLES, T, bounded, pulls, simulate
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.estimator import Sensor
from twin.estimation.set_membership import ErrorBound, SetMembershipFilter
from twin.hysteresis.prandtl_ishlinskii import PrandtlIshlinskii

NAMES = [model.name for model in MODELS]


@pytest.mark.parametrize("style", ["even", "ends", "one sided"])
@pytest.mark.parametrize("model", MODELS, ids=NAMES)
@settings(max_examples=8)
@given(
    slope=st.floats(0, 20),
    floor=st.sampled_from([0.0, 0.01, 0.5]),
    noise=st.floats(0.01, 5),
    seed=st.integers(0, 10_000),
)
def test_truth_is_in_the_set_in_all_runs_at_all_samples(model, style, slope, floor, noise, seed):
    """40 runs of 120 samples in each of 72 settings, gaps in the measurements included."""
    rng = np.random.default_rng(seed)
    bound = ErrorBound(slope, floor)
    pull = pulls(rng)
    bend = simulate(model, bound, pull, rng, style)
    measurement = bend + noise * bounded(rng, bend.shape, style)
    measurement[rng.random(bend.shape) < 0.1] = np.nan
    initial = bend[:, 0] + 20 * bounded(rng, (BATCH,), style)
    tuned = SetMembershipFilter(model, T, bound).with_sensor(Sensor(noise**2 / 3, bound=noise))
    low, high = tuned.intervals(pull, measurement, initial)
    assert ((low <= bend) & (bend <= high)).all()


@given(slope=st.floats(0, 20), floor=st.floats(0, 1), noise=st.floats(0.01, 5), seed=st.integers(0, 10_000))
def test_the_interval_is_the_exact_one(slope, floor, noise, seed):
    """One number is the state: its interval shrinks by the model, grows by the bound, meets the strip."""
    rng = np.random.default_rng(seed)
    bound = ErrorBound(slope, floor)
    pull = pulls(rng, 5, 60)
    bend = simulate(COLEMAN_HODGDON, bound, pull, rng, "even")
    measurement = bend + rng.uniform(-noise, noise, bend.shape)
    tuned = SetMembershipFilter(COLEMAN_HODGDON, T, bound, noise)
    low, high = tuned.intervals(pull, measurement, bend[:, 0])
    exact_low, exact_high = bend[:, 0] - 20, bend[:, 0] + 20
    a, b, c = dataclasses.astuple(COLEMAN_HODGDON)
    for k in range(1, 60):
        move = pull[:, k] - pull[:, k - 1]
        reach = slope * np.abs(move) + floor
        keep, drive = 1 - a * np.abs(move), a * np.abs(move) * b * pull[:, k] + c * move
        ends = np.sort([keep * exact_low + drive, keep * exact_high + drive], axis=0)
        exact_low = np.maximum(ends[0] - reach, measurement[:, k] - noise)
        exact_high = np.minimum(ends[1] + reach, measurement[:, k] + noise)
        np.testing.assert_allclose(low[:, k], exact_low, atol=1e-4)
        np.testing.assert_allclose(high[:, k], exact_high, atol=1e-4)


@pytest.mark.parametrize("jump", [15.0, -400.0])
def test_a_measurement_that_breaks_its_bound_does_not_lose_the_truth(jump):
    """The set then holds what model and measurement say, and the next measurements narrow it."""
    rng = np.random.default_rng(4)
    bound = ErrorBound(1.0, 0.05)
    pull = pulls(rng)
    bend = simulate(COLEMAN_HODGDON, bound, pull, rng, "even")
    clean = bend + rng.uniform(-1, 1, bend.shape)
    tuned = SetMembershipFilter(COLEMAN_HODGDON, T, bound, 1.0)
    outlier = clean.copy()
    outlier[::2, 60] += jump
    low, high = tuned.intervals(pull, outlier, bend[:, 0])
    assert ((low <= bend) & (bend <= high)).all()
    assert ((low <= outlier - 1) & (outlier + 1 <= high))[::2, 60].all()
    assert (high - low)[:, -1].max() < 2
    untouched = tuned.intervals(pull, clean, bend[:, 0])
    np.testing.assert_array_equal(low[1::2], untouched[0][1::2])
    np.testing.assert_array_equal(high[1::2], untouched[1][1::2])


@pytest.mark.parametrize("jump", [15.0, -400.0])
def test_a_model_that_breaks_its_bound_does_not_lose_the_truth(jump):
    """The angle is pushed at sample 60, and stays there."""
    rng = np.random.default_rng(5)
    plays = PrandtlIshlinskii([5.0], [0.0])
    tuned = SetMembershipFilter(plays, T, ErrorBound(0.0, 0.05), 1.0)
    truth = np.where(np.arange(SAMPLES) < 60, 60.0, 60.0 + jump)
    measurement = truth + rng.uniform(-1, 1, (20, SAMPLES))
    low, high = tuned.intervals(np.full(SAMPLES, 3.0), measurement, 60.0)
    assert ((low <= truth) & (truth <= high)).all()
    assert (high - low)[:, 62:].max() <= 2.001


def test_bound_of_the_noise_is_the_sensor_s_or_three_deviations():
    tuned = SetMembershipFilter(COLEMAN_HODGDON, T, ErrorBound(1.0, 0.1))
    assert tuned.with_sensor(Sensor(4.0)).measurement_bound == pytest.approx(6.0)
    assert tuned.with_sensor(Sensor(4.0, bound=2.5)).measurement_bound == pytest.approx(2.5)
    mixed = tuned.with_sensor(Sensor(np.array([1.0, 4.0]), bound=np.array([np.inf, 5.0]))).measurement_bound
    np.testing.assert_allclose(mixed, [3.0, 5.0])


def test_strips_that_meet_in_one_point_leave_a_set_that_goes_on():
    plays = PrandtlIshlinskii([5.0], [0.0])
    tuned = SetMembershipFilter(plays, T, ErrorBound(0.0, 0.0), 1.0)
    apart = np.concatenate([np.linspace(-1e-8, 1e-8, 41), np.arange(-40, 41) * np.spacing(60.0) - 4e-9])
    measurement = np.stack([np.full_like(apart, y) for y in (60.0, 61.0, 59.0, 60.0, 60.0)], axis=1)
    measurement[:, 2] += apart
    low, high = tuned.intervals(np.full(5, 3.0), measurement, 60.0)
    assert np.isfinite([low, high]).all()
    assert ((low < high) & (low <= 60.0) & (high >= 60.0)).all()
