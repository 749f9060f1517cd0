"""Learned gains on a linear system, where the Kalman filter is known to be the best there is."""

import numpy as np
import pytest
import torch

from rl.on_twins import RIVALS
from scripts.benchmarks.linear_system import (
    NARROW,
    SAMPLES,
    SHARE_WIDE,
    WIDE,
    LinearSource,
    decibels,
    kalman_filter,
    learn_gains,
    learned_estimates,
)
from scripts.studies.learned_gains import PUBLISHED


def bodies_of(two_widths, count=400):
    return LinearSource(two_widths).run(count, SAMPLES, np.random.default_rng(5))


def test_the_noise_of_two_widths_has_variance_one():
    assert pytest.approx(1) == SHARE_WIDE * WIDE**2 + (1 - SHARE_WIDE) * NARROW**2
    bodies = bodies_of(True)
    assert (bodies.measured - bodies.place).var() == pytest.approx(1, rel=0.03)
    assert np.diff(bodies.place, axis=0).mean() == pytest.approx(1, abs=0.02)


def test_the_filter_that_knows_each_width_is_better_and_equal_under_normal_noise():
    normal, two = bodies_of(False), bodies_of(True)
    np.testing.assert_array_equal(
        kalman_filter(normal, knows_width=True), kalman_filter(normal, knows_width=False)
    )
    informed, other = (decibels(kalman_filter(two, knows_width=known), two.place) for known in (True, False))
    assert informed < other - 2


def test_the_filter_is_as_good_as_its_covariance_says():
    """Its error at the end has the variance that Riccati's equation comes to, found by another way."""
    bodies = bodies_of(False, 20_000)
    error = (kalman_filter(bodies, knows_width=False) - bodies.place)[-1]
    P, F, Q = np.diag([1e6, 0.01]), np.array([[1.0, 1.0], [0.0, 1.0]]), np.diag([0.0, 1e-4])
    for _ in range(SAMPLES):
        P = F @ P @ F.T + Q
        P = np.linalg.inv(np.linalg.inv(P) + np.diag([1.0, 0.0]))
    assert error.var() == pytest.approx(P[0, 0], rel=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["KalmanNet (twins)", "Recursive KalmanNet (twins)"])
def test_a_learned_gain_comes_within_half_a_decibel_of_the_best(name):
    torch.manual_seed(1)
    step, bodies = RIVALS[name].untrained(), bodies_of(False)
    best = decibels(kalman_filter(bodies, knows_width=False), bodies.place)
    untrained = decibels(learned_estimates(step, bodies)[0], bodies.place)
    learn_gains(step, LinearSource(), updates=90)
    estimates, deviations = learned_estimates(step, bodies)
    assert best - 0.05 < decibels(estimates, bodies.place) < min(best + 0.5, untrained - 0.5)
    if name.startswith("Recursive"):
        nees = np.mean(((estimates - bodies.place) / deviations)[10:] ** 2)
        assert nees == pytest.approx(1, abs=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLISHED)
def test_with_its_authors_sizes_and_settings_a_learned_gain_comes_within_a_decibel_of_the_best(name):
    bodies = bodies_of(False)
    best = decibels(kalman_filter(bodies, knows_width=False), bodies.place)
    untrained, trained = (
        decibels(learned_estimates(step, bodies)[0], bodies.place)
        for step in (PUBLISHED[name].untrained(), PUBLISHED[name].trained(LinearSource(), updates=80))
    )
    assert best - 0.05 < trained < min(best + 1, untrained - 0.5)
