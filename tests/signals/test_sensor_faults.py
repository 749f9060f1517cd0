"""Faults of a sensor: each does what its name says, to the level that is asked for, and no more."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.signals.noise import draw_errors, noise_variance
from twin.signals.sensor_errors import FAULTS, FINE_DEG2, GAP_S, KNOWN_DEG2, STUCK_S

T = 0.02
SLOW = 40 * np.sin(np.linspace(0, 20 * np.pi, 30_000))  # ten minutes


def draw(kind, level, bend_deg=SLOW, seed=0, sample_time=T):
    return draw_errors(kind, level, bend_deg, sample_time, np.random.default_rng(seed))


def test_a_drift_has_walked_as_far_as_its_level_after_a_minute_at_any_sample_time():
    for sample_time in (0.02, 0.1):
        samples = round(60 / sample_time) + 1
        still = np.zeros(samples)
        last = [draw("drifting-bias", 2.0, still, seed, sample_time)[-50:].mean() for seed in range(400)]
        assert np.std(last) == pytest.approx(2.0, rel=0.12)


@pytest.mark.parametrize("sample_time", [0.02, 0.1])
def test_correlated_noise_has_its_variance_and_forgets_in_its_time(sample_time):
    errors = draw("correlated", 0.5, np.zeros(200_000), sample_time=sample_time)
    assert errors.var() == pytest.approx(KNOWN_DEG2, rel=0.05)
    apart = round(0.5 / sample_time)
    assert np.corrcoef(errors[apart:], errors[:-apart])[0, 1] == pytest.approx(np.exp(-1), abs=0.03)
    white = draw("correlated", 0.0, np.zeros(20_000))
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.03


def test_a_mixture_has_the_mean_square_that_is_given_and_leans_to_one_side():
    errors = draw("mixture", 2.5, np.zeros(400_000))
    assert np.mean(errors**2) == pytest.approx(noise_variance("mixture", 2.5), rel=0.02)
    deviation = np.sqrt(2.5 / (0.8 + 0.2 * 9))
    assert errors.mean() == pytest.approx(0.2 * 3 * np.sqrt(2 / np.pi) * deviation, rel=0.03)


def test_steps_are_what_is_measured_rounded():
    errors = draw("quantised", 2.0)
    steps = (SLOW + errors) / 2.0
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    everywhere = draw("quantised", 2.0, np.linspace(0, 3000, 200_000))
    assert np.mean(everywhere**2) == pytest.approx(noise_variance("quantised", 2.0), rel=0.02)
    assert draw("quantised", 0.0).var() == pytest.approx(FINE_DEG2, rel=0.05)


def test_gaps_take_their_share_and_last_a_second_in_the_mean():
    missing = np.isnan(draw("drop-outs", 0.3, np.zeros(300_000)))
    assert missing.mean() == pytest.approx(0.3, abs=0.03)
    gaps = np.flatnonzero(np.diff(missing.astype(int)) == 1).size
    assert missing.sum() * T / gaps == pytest.approx(GAP_S, rel=0.1)
    assert not np.isnan(draw("drop-outs", 0.0)).any()


def test_a_late_sensor_measures_the_angle_of_then():
    measured = SLOW + draw("delayed", 0.2)
    apart = round(0.2 / T)
    assert (measured[apart:] - SLOW[:-apart]).var() == pytest.approx(KNOWN_DEG2, rel=0.05)
    time = np.arange(len(SLOW)) * T
    then = np.interp(time - 0.2, time, SLOW)
    np.testing.assert_allclose(draw("delayed", 0.2), draw("delayed", 0.0) + then - SLOW, atol=1e-9)


def test_a_stuck_sensor_says_the_same_for_two_seconds_and_then_the_truth_again():
    measured = SLOW + draw("stuck", 0.1)
    same = np.abs(np.diff(measured)) < 1e-12
    assert same.mean() == pytest.approx(0.1, abs=0.03)
    ends = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    lengths = (ends[1::2] - ends[::2]) * T
    assert np.median(lengths) == pytest.approx(STUCK_S, abs=2 * T)
    free = np.concatenate([[True], ~same])
    assert (measured - SLOW)[free].var() == pytest.approx(KNOWN_DEG2, rel=0.05)


@given(st.sampled_from(sorted(FAULTS)), st.floats(0, 0.9), st.integers(1, 200), st.integers(0, 99))
def test_whatever_the_level_and_length_errors_are_numbers_or_missing(kind, level, samples, seed):
    errors = draw(kind, level, np.linspace(0, 50, samples), seed)
    assert errors.shape == (samples,)
    assert np.isfinite(errors[~np.isnan(errors)]).all()
    assert kind == "drop-outs" or not np.isnan(errors).any()
    np.testing.assert_array_equal(errors, draw(kind, level, np.linspace(0, 50, samples), seed))
