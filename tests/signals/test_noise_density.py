"""What is made of an innovation: the score against integrals of the exact densities."""

import numpy as np
import pytest
from scipy import integrate, stats

from twin.signals.noise import BACKGROUND_DEG2, NOISES, fisher_information
from twin.signals.noise_density import family_densities, noise_density

LEVELS = {"salt-and-pepper": 0.05}


@pytest.mark.parametrize("spread", [0.05, 0.4, 3.0, 20.0])
@pytest.mark.parametrize("level", [0.1, 5.0])
def test_score_of_gaussian_noise_is_the_kalman_filters(level, spread):
    density = noise_density("gaussian", level)
    innovation = np.linspace(-3, 3, 31) * np.hypot(np.sqrt(level), spread)
    variance = level + spread**2
    np.testing.assert_allclose(density.score(innovation, spread), innovation / variance, rtol=0.02, atol=2e-3)
    assert density.information(spread) == pytest.approx(1 / variance, rel=0.01)


def convolved(kind, spread):
    """Log-density of noise plus a normal angle, by quadrature, at any innovation."""
    law = {
        "laplace": stats.laplace(scale=np.sqrt(0.5)),
        "uniform": stats.uniform(-np.sqrt(3), 2 * np.sqrt(3)),
        "gamma": stats.gamma(2, scale=np.sqrt(0.5)),
        "student-t": stats.t(3, scale=np.sqrt(1 / 3)),
    }[kind]

    def log_density(innovation):
        ends = (innovation - 9 * spread, innovation + 9 * spread)
        breaks = [x for x in (0.0, -np.sqrt(3), np.sqrt(3)) if ends[0] < x < ends[1]]
        smeared = lambda n: law.pdf(n) * stats.norm.pdf(innovation - n, scale=spread)  # noqa: E731
        return np.log(integrate.quad(smeared, *ends, points=breaks)[0])

    return log_density


@pytest.mark.parametrize("kind", ["laplace", "uniform", "gamma", "student-t"])
@pytest.mark.parametrize("spread", [0.2, 1.0])
def test_score_is_the_slope_of_the_log_density_of_the_innovation(kind, spread):
    log_density = convolved(kind, spread)
    density = noise_density(kind, 1.0)
    for innovation in (-1.5, 0.1, 0.9, 1.8):
        if log_density(innovation) < -12:  # never happens
            continue
        slope = (log_density(innovation + 1e-3) - log_density(innovation - 1e-3)) / 2e-3
        found = density.score(np.array([innovation]), spread)[0]
        assert found == pytest.approx(-slope, rel=0.03, abs=0.05)


@pytest.mark.parametrize("kind", ["laplace", "student-t", "salt-and-pepper"])
def test_information_approaches_fishers_where_the_angle_is_known(kind):
    level = LEVELS.get(kind, 1.0)
    density, limit = noise_density(kind, level), fisher_information(kind, level)
    assert density.information(0.03) == pytest.approx(limit, rel=0.1)
    assert density.information(0.5) < limit


@pytest.mark.parametrize("kind", sorted(NOISES))
@pytest.mark.parametrize("spread", [0.07, 0.5, 4.0])
def test_every_density_adds_up_to_one(kind, spread):
    innovation = np.linspace(-60, 60, 200_001)
    density = np.exp(noise_density(kind, LEVELS.get(kind, 1.0)).log_density(innovation, spread))
    assert integrate.trapezoid(density, innovation) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("variance", [0.03, 1.0, 6.0])
def test_families_have_the_variance_that_is_given(variance):
    found = family_densities(variance)
    assert len(found) == (7 if variance > BACKGROUND_DEG2 else 6)
    for density in found:
        assert density.variance == pytest.approx(variance)


def test_integer_noise_is_not_read_off_its_lattice():
    plain, dithered = noise_density("poisson", 1.0), noise_density("poisson-dithered", 1.0)
    innovation = np.linspace(-2, 4, 25)
    for spread in (0.05, 0.5):
        scores = (density.score(innovation, spread) for density in (plain, dithered))
        np.testing.assert_allclose(*scores, rtol=0.02)
