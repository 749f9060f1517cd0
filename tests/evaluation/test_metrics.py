"""Indices of the error against numbers worked out by hand, identities, and the coverage of the interval."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.integrate import quad
from scipy.stats import norm

from twin.evaluation.metrics import confidence_interval, error_indices, interval_indices

NAMES = {"mae_deg", "rmse_deg", "md_deg", "md_printed_deg2", "var_deg2", "bias_deg"}
errors = arrays(
    float, array_shapes(min_dims=1, max_dims=3, min_side=1, max_side=8), elements=st.floats(-1e3, 1e3)
)


def test_indices_of_four_errors_worked_out_by_hand():
    indices = error_indices(np.array([1.0, -1.0, 4.0, 0.0]))  # mean 1; squares 1, 1, 16, 0
    assert {name: float(value) for name, value in indices.items()} == pytest.approx(
        {
            "mae_deg": 6 / 4,
            "rmse_deg": np.sqrt(18 / 4),
            "md_deg": (0 + 2 + 3 + 1) / 4,
            "md_printed_deg2": (0 + 0 + 15 + 1) / 4,
            "var_deg2": (0 + 4 + 9 + 1) / 4,
            "bias_deg": 1.0,
        }
    )


@given(error=errors)
def test_mean_square_is_variance_and_squared_bias(error):
    indices = error_indices(error)
    assert set(indices) == NAMES
    assert all(value.shape == error.shape[:-1] for value in indices.values())
    total = indices["var_deg2"] + indices["bias_deg"] ** 2
    np.testing.assert_allclose(indices["rmse_deg"] ** 2, total, rtol=1e-9, atol=1e-9)


def test_interval_equals_the_one_from_a_table_of_student():
    values = np.array([1.0, 2.0, 4.0, 5.0, 8.0])  # mean 4, sum of squares 30, s^2 = 7.5
    half = 2.776445 * np.sqrt(7.5 / 5)  # t(0.975, 4) from the table
    assert confidence_interval(values) == pytest.approx((4 - half, 4 + half), rel=1e-6)
    half = 2.131847 * np.sqrt(7.5 / 5)  # t(0.95, 4)
    assert confidence_interval(values, 0.9) == pytest.approx((4 - half, 4 + half), rel=1e-6)


def test_interval_over_trainings_and_seeds_covers_the_mean_of_both():
    """Two crossed random effects and a rest; the interval may be wider than it must be, never narrower."""
    rng, trials = np.random.default_rng(5), 2000
    inside = 0
    for _ in range(trials):
        trainings, seeds = rng.normal(0, 2, size=(10, 1)), rng.normal(0, 1, size=(1, 20))
        low, high = confidence_interval(7 + trainings + seeds + rng.normal(0, 1, size=(10, 20)))
        inside += low <= 7 <= high
    assert 0.94 < inside / trials < 0.985


@pytest.mark.parametrize(("scale", "coverage", "nees"), [(1.0, 0.95, 1.0), (2.0, 0.6729, 4.0)])
def test_intervals_of_normal_errors_are_as_honest_as_they_are_wide(scale, coverage, nees):
    """Errors twice the stated deviation are covered with the probability of 0.98 deviations."""
    error = scale * np.random.default_rng(1).standard_normal(200_000)
    found = interval_indices(error, np.full(200_000, 1.959964))
    assert found["coverage95"] == pytest.approx(coverage, abs=0.005)
    assert found["nees"] == pytest.approx(nees, rel=0.02)
    assert found["width95_deg"] == pytest.approx(2 * 1.959964)


@pytest.mark.parametrize(("error", "sigma"), [(0.0, 1.0), (-0.7, 0.4), (3.0, 0.5), (0.2, 5.0)])
def test_crps_is_the_integral_over_all_thresholds(error, sigma):
    """Of the squared difference between the law's distribution and that of the truth."""
    below = quad(lambda x: norm.cdf(x, error, sigma) ** 2, -np.inf, 0)[0]
    above = quad(lambda x: norm.sf(x, error, sigma) ** 2, 0, np.inf)[0]
    found = interval_indices(np.array([error]), np.array([1.959964 * sigma]))
    assert found["crps_deg"] == pytest.approx(below + above, rel=1e-5)
