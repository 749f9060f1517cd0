"""Secants: exact where residuals are linear, the mean slope over a kink, and never beyond the bounds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.calibration.descent import LONGEST, SHORTEST, secants, variance_of

FREE = (np.full(3, -np.inf), np.full(3, np.inf))


@given(seed=st.integers(0, 1000), variance=st.floats(0, 10))
def test_linear_residuals_have_their_own_derivative(seed, variance):
    rng = np.random.default_rng(seed)
    slope, about = rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    points = lambda ends: np.array(ends) @ slope.T + 1.0  # noqa: E731
    found = secants(points, rng.normal(size=3), about, variance, FREE)
    np.testing.assert_allclose(found, slope, atol=1e-9)


def test_a_kink_within_what_is_told_counts_by_half_and_one_beyond_not_at_all():
    def residuals(points):
        return np.array([[abs(x) + x, 3 * y] for x, y in points])

    about = np.eye(2)
    bounds = (np.full(2, -10.0), np.full(2, 10.0))
    wide = secants(residuals, np.zeros(2), about, 0.05**2, bounds)
    np.testing.assert_allclose(wide, [[1, 0], [0, 3]], atol=1e-12)
    beyond = secants(residuals, np.array([0.06, 0.0]), about, 0.05**2, bounds)
    np.testing.assert_allclose(beyond, [[2, 0], [0, 3]], atol=1e-12)


def test_reach_is_a_standard_deviation_within_its_limits_and_the_bounds():
    seen = []

    def residuals(points):
        seen.append(np.array(points))
        return np.array(points)

    around = np.diag([1e6, 20.0, 1e-6])  # known far too well, within 0.05, and not at all
    bounds = (np.full(3, -0.1), np.full(3, 1.0))
    secants(residuals, np.zeros(3), around, 1.0, bounds)
    above, below = seen[0][:3], seen[0][3:]
    assert sorted(np.abs(above - below).max(axis=1)) == pytest.approx([2 * SHORTEST, 0.1, 0.1 + LONGEST])
    assert (below >= -0.1).all()


def test_a_parameter_that_nothing_depends_on_is_told_by_nothing():
    found = secants(
        lambda points: np.array(points)[:, :1] * 2,
        np.zeros(2),
        np.array([[2.0, 0.0]]),
        1.0,
        (-np.ones(2), np.ones(2)),
    )
    np.testing.assert_allclose(found, [[2, 0]], atol=1e-12)


def test_variance_of_noise_is_its_own_and_of_correlated_noise_counts_the_fewer_samples():
    rng = np.random.default_rng(0)
    noise = 0.3 * rng.standard_normal(100_000)
    assert variance_of(noise, 5) == pytest.approx(0.09, rel=0.05)
    r, series = 0.8, np.empty(100_000)
    series[0] = noise[0]
    for k in range(1, len(series)):
        series[k] = r * series[k - 1] + noise[k]
    assert variance_of(series, 5) == pytest.approx(np.var(series) * (1 + r) / (1 - r), rel=0.1)
    assert variance_of(np.zeros(9), 3) == 0
