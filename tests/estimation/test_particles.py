"""Particles that are twins: against the exact posterior of a mixture, and against the linear filter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from twins_of_two_kinds import SAMPLES, estimates, family, last_state

from twin.estimation.ensemble import EnsembleFilter, ParticleFilter
from twin.signals.noise import draw_noise
from twin.signals.noise_density import noise_density


@given(st.integers(3, 7), st.floats(0.05, 0.95), st.integers(0, 99))
def test_estimate_is_the_exact_mean_of_the_mixture(count, bandwidth, seed):
    """Under Gaussian noise each law is conditioned on all measurements at once, and weighed by them."""
    members, variance = family(count, seed)[:, :8], 0.7
    rng = np.random.default_rng(seed + 1)
    measured = members[:1] + np.sqrt(variance) * rng.standard_normal((1, 8))
    mean = members.mean(axis=0)
    anomalies = members - mean
    covariance = bandwidth**2 * anomalies.T @ anomalies / (count - 1)
    of_noise = covariance[1:, 1:] + variance * np.eye(7)  # the first sample is not measured
    gain = covariance[-1, 1:] @ np.linalg.inv(of_noise)
    places = mean + np.sqrt(1 - bandwidth**2) * anomalies
    logs = np.array([stats.multivariate_normal.logpdf(measured[0, 1:], of[1:], of_noise) for of in places])
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    each = places[:, -1] + (measured[0, 1:] - places[:, 1:]) @ gain
    found, half = estimates(ParticleFilter(EnsembleFilter(members, variance), bandwidth), measured)
    assert found[0, -1] == pytest.approx(weights @ each, abs=1e-7)
    state = last_state(ParticleFilter(EnsembleFilter(members, variance), bandwidth), measured)
    assert state.log_evidence[0] == pytest.approx(np.logaddexp.reduce(logs) - np.log(count), abs=1e-6)
    left = covariance[-1, -1] - gain @ covariance[1:, -1]
    spread = left + weights @ each**2 - (weights @ each) ** 2
    assert half[0, -1] == pytest.approx(1.96 * np.sqrt(max(spread, 0)), rel=1e-3, abs=1e-5)


@pytest.mark.parametrize("noise", [None, ("laplace", 1.0), ("salt-and-pepper", 0.05), ("gamma", 1.0)])
def test_laws_as_wide_as_the_ensemble_are_the_linear_filter(noise):
    members = family(30, 3)
    density = noise_density(*noise) if noise else None
    kind = noise or ("gaussian", 1.0)
    measured = members[:4] + draw_noise(*kind, (4, SAMPLES), np.random.default_rng(2))
    measured[:, 20:25] = np.nan
    linear = EnsembleFilter(members, 1.0, density)
    for found, wanted in zip(
        estimates(ParticleFilter(linear, 1.0), measured), estimates(linear, measured), strict=True
    ):
        np.testing.assert_allclose(found, wanted, atol=1e-8)


@pytest.mark.parametrize("noise", [("gaussian", 1.0), ("laplace", 1.0), ("poisson", 1.0), ("gamma", 1.0)])
def test_twins_that_are_not_normal_are_known_better_than_by_the_linear_filter(noise):
    members, truth = family(200, 1), family(200, 2)
    measured = truth + draw_noise(*noise, truth.shape, np.random.default_rng(5))
    linear = EnsembleFilter(members, 1.0, noise_density(*noise))
    errors = [
        np.sqrt(np.mean((estimates(of, measured)[0] - truth)[:, 1:] ** 2))
        for of in (ParticleFilter(linear), linear)
    ]
    assert errors[0] < 0.99 * errors[1]


def test_the_interval_holds_the_truth_as_often_as_it_says():
    members, truth = family(200, 1), family(400, 4)
    measured = truth + draw_noise("gaussian", 1.0, truth.shape, np.random.default_rng(6))
    found, half = estimates(ParticleFilter(EnsembleFilter(members, 1.0)), measured)
    assert np.mean(np.abs(found - truth) <= half) == pytest.approx(0.95, abs=0.02)
