"""A bank of filters of twins, one for each family of noise, weighed by what they make likely."""

import numpy as np
import pytest
from twins_of_two_kinds import SAMPLES, estimates, family, last_state

from twin.estimation.ensemble import EnsembleFilter, FamilyFilter, ParticleFilter
from twin.signals.noise import draw_noise
from twin.signals.noise_density import family_densities, noise_density

VARIANCE = 1.0


def particles(members, density):
    return ParticleFilter(EnsembleFilter(members, VARIANCE, density))


def bank(members):
    return FamilyFilter(tuple(particles(members, density) for density in family_densities(VARIANCE)))


def measured(truth, kind, seed):
    return truth + draw_noise(kind, VARIANCE, truth.shape, np.random.default_rng(seed))


def rmse(filter_, seen, truth):
    return np.sqrt(np.mean((estimates(filter_, seen)[0] - truth)[:, SAMPLES // 2 :] ** 2))


@pytest.mark.parametrize("kind", ["gaussian", "laplace", "gamma"])
def test_bank_of_one_family_is_its_filter(kind):
    members, density = family(40, 1), noise_density(kind, VARIANCE)
    seen = measured(members[:3], kind, 2)
    seen[:, 10:14] = np.nan
    alone = particles(members, density)
    for found, wanted in zip(estimates(FamilyFilter((alone,)), seen), estimates(alone, seen), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-9)


@pytest.mark.parametrize("kind", ["gaussian", "uniform", "gamma"])
def test_family_is_recognised_and_its_mean_with_it(kind):
    members, truth = family(150, 1), family(60, 2)
    seen = measured(truth, kind, 3)
    filter_ = bank(members)
    weights = filter_.weights(last_state(filter_, seen))
    np.testing.assert_allclose(weights.sum(axis=0), 1)
    stated = noise_density(kind, VARIANCE)
    right = [each.ensemble.density is stated for each in filter_.filters].index(True)
    assert weights.mean(axis=1).argmax() == right
    if kind == "gamma":  # one that knows R alone keeps the mean of the noise
        assert rmse(filter_, seen, truth) < 0.6 * rmse(particles(members, None), seen, truth)
    assert rmse(filter_, seen, truth) < 2 * rmse(particles(members, stated), seen, truth)


def test_interval_is_wide_where_families_disagree():
    """Before they can be distinguished, skewed and symmetric noise place the angle differently."""
    members = family(60, 1)
    seen = measured(members[:20], "gamma", 4)
    filter_ = bank(members)
    _, half = estimates(filter_, seen)
    _, of_one = estimates(particles(members, noise_density("gamma", VARIANCE)), seen)
    assert np.median(half[:, 8]) > 1.5 * np.median(of_one[:, 8])
