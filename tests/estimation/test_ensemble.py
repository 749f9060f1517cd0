"""The ensemble filter against the textbook: Bayesian linear regression and normal laws."""

import numpy as np
import pytest

from twin.estimation.ensemble import EnsembleFilter, posterior_bound
from twin.signals.noise_density import noise_density

MEMBERS, SAMPLES = 40, 120


@pytest.fixture
def members():
    rng = np.random.default_rng(0)
    time = np.linspace(0, 6, SAMPLES)
    size, phase, drift = (
        rng.normal(10, 2, (MEMBERS, 1)),
        rng.normal(0, 0.2, (MEMBERS, 1)),
        rng.normal(0, 1, (MEMBERS, 1)),
    )
    return size * np.sin(time + phase) + drift * time


def conditional_mean(members, measurement, variance, until):
    """Mean of the angle at `until` given the measurements 1 ... until, all jointly normal: the textbook's."""
    mean, covariance = members.mean(axis=0), np.cov(members.T)
    seen = np.flatnonzero(~np.isnan(measurement[: until + 1]))
    seen = seen[seen > 0]
    gram = covariance[np.ix_(seen, seen)] + variance * np.eye(len(seen))
    weights = np.linalg.solve(gram, covariance[seen, until])
    error = covariance[until, until] - covariance[seen, until] @ weights
    return mean[until] + weights @ (measurement[seen] - mean[seen]), error


@pytest.mark.parametrize("variance", [0.1, 5.0])
def test_estimate_is_the_conditional_mean_of_the_joint_normal_law(members, variance):
    measurement = members[3] + np.random.default_rng(1).normal(0, np.sqrt(variance), SAMPLES)
    measurement[[20, 21, 60]] = np.nan
    estimate = EnsembleFilter(members, variance).estimate(np.zeros(SAMPLES), measurement, 0.0)[0]
    for k in (1, 20, 21, 22, 77, 119):
        assert estimate[k] == pytest.approx(conditional_mean(members, measurement, variance, k)[0], abs=1e-6)


def test_bound_is_the_conditional_variance_of_the_joint_normal_law(members):
    bound = posterior_bound(members, 1 / 0.5)
    for k in (1, 50, 119):
        assert bound[k] ** 2 == pytest.approx(
            conditional_mean(members, np.zeros(SAMPLES), 0.5, k)[1], abs=1e-6
        )


def test_error_over_twins_of_the_ensemble_reaches_the_bound_and_no_less():
    rng = np.random.default_rng(2)
    basis = rng.standard_normal((6, SAMPLES)).cumsum(axis=1)  # smooth random shapes: all twins are normal
    members, twins = (rng.standard_normal((count, 6)) @ basis for count in (4000, 300))
    filters = EnsembleFilter(members[:400], 1.0)
    estimate = filters.estimate(np.zeros(SAMPLES), twins + rng.standard_normal(twins.shape), 0.0)
    found = np.sqrt(((estimate - twins)[:, 30:] ** 2).mean())
    bound = np.sqrt((posterior_bound(members[:400], 1.0)[30:] ** 2).mean())
    assert found == pytest.approx(bound, rel=0.1)


def test_knowing_the_density_helps_and_for_gaussian_noise_changes_nothing(members):
    rng = np.random.default_rng(3)
    pull, truth = np.zeros(SAMPLES), members[5]

    def rmse(noise, density, variance=1.0):
        estimate = EnsembleFilter(members, variance, density).estimate(pull, truth + noise, 0.0)
        return np.sqrt(((estimate - truth)[:, 1:] ** 2).mean())

    gaussian = rng.standard_normal((50, SAMPLES))
    assert rmse(gaussian, noise_density("gaussian", 1.0)) == pytest.approx(rmse(gaussian, None), rel=0.02)
    outliers = rng.normal(0, np.sqrt(0.1), (50, SAMPLES)) + 10 * (rng.uniform(size=(50, SAMPLES)) < 0.025)
    outliers -= 10 * (rng.uniform(size=(50, SAMPLES)) < 0.025)
    assert rmse(outliers, noise_density("salt-and-pepper", 0.05)) < 0.6 * rmse(outliers, None, 5.1)
    skewed = rng.poisson(2.0, (50, SAMPLES)).astype(float)
    assert rmse(skewed, noise_density("poisson", 2.0)) < 0.4 * rmse(skewed, None, 2.0)  # it knows the mean


def test_with_a_bias_it_is_the_conditional_mean_of_angle_and_bias_together(members):
    """The bias is one more normal unknown, which every measurement sees in full and the angle not at all."""
    variance, deviation = 0.8, 1.5
    rng = np.random.default_rng(3)
    measurement = members[0] + 2.0 + np.sqrt(variance) * rng.standard_normal(SAMPLES)
    mean, covariance = members.mean(axis=0), np.cov(members.T)
    seen = covariance[1:, 1:] + deviation**2 + variance * np.eye(SAMPLES - 1)
    gain = covariance[-1, 1:] @ np.linalg.inv(seen)
    filter_ = EnsembleFilter(members, variance, zero_deviation_deg=deviation)
    found, half = filter_.estimate_with_interval(np.zeros(SAMPLES), measurement, 0.0)
    assert found[0, -1] == pytest.approx(mean[-1] + gain @ (measurement - mean)[1:], rel=1e-6)
    left = covariance[-1, -1] - gain @ covariance[1:, -1]
    assert half[0, -1] == pytest.approx(1.96 * np.sqrt(left), rel=1e-3)
