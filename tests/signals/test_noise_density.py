"""What is made of an innovation: the score against integrals of the exact densities."""

import numpy as np
import pytest
from scipy import integrate, stats

from twin.signals.noise import BACKGROUND_DEG2, NOISES, draw_noise, fisher_information
from twin.signals.noise_density import family_densities, noise_density

LEVELS = {"salt-and-pepper": 0.05}


@pytest.mark.parametrize("spread", [0.05, 0.4, 3.0, 20.0])
@pytest.mark.parametrize("level", [0.1, 5.0])
def test_score_of_gaussian_noise_is_the_kalman_filters(level, spread):
    density, innovation = (
        noise_density("gaussian", level),
        np.linspace(-3, 3, 31) * np.hypot(np.sqrt(level), spread),
    )
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
        return np.log(
            integrate.quad(
                lambda n: law.pdf(n) * stats.norm.pdf(innovation - n, scale=spread), *ends, points=breaks
            )[0]
        )

    return log_density


@pytest.mark.parametrize("kind", ["laplace", "uniform", "gamma", "student-t"])
@pytest.mark.parametrize("spread", [0.2, 1.0])
def test_score_is_the_slope_of_the_log_density_of_the_innovation(kind, spread):
    log_density = convolved(kind, spread)
    density = noise_density(kind, 1.0)
    for innovation in (-1.5, 0.1, 0.9, 1.8):
        if log_density(innovation) < -12:
            continue  # never happens
        slope = (log_density(innovation + 1e-3) - log_density(innovation - 1e-3)) / 2e-3
        found = density.score(np.array([innovation]), spread)[0]
        assert found == pytest.approx(-slope, rel=0.03, abs=0.05)


@pytest.mark.parametrize("kind", sorted(NOISES))
@pytest.mark.parametrize("spread", [0.1, 1.0])
def test_score_is_zero_in_the_mean_and_its_square_is_the_information(kind, spread):
    rng = np.random.default_rng(0)
    level, count = LEVELS.get(kind, 1.0), 200_000
    if kind == "poisson":
        kind = "poisson-dithered"  # whose density it is given
    innovation = draw_noise(kind, level, (count,), rng) + spread * rng.standard_normal(count)
    score = noise_density(kind, level).score(innovation, spread)
    information = noise_density(kind, level).information(spread)
    assert score.mean() == pytest.approx(0, abs=6 * np.sqrt(information / count))
    assert (score**2).mean() == pytest.approx(information, rel=0.04)


@pytest.mark.parametrize("kind", ["laplace", "student-t", "salt-and-pepper"])
def test_information_approaches_fishers_where_the_angle_is_known(kind):
    level = LEVELS.get(kind, 1.0)
    assert noise_density(kind, level).information(0.03) == pytest.approx(
        fisher_information(kind, level), rel=0.1
    )
    assert noise_density(kind, level).information(0.5) < fisher_information(kind, level)


def test_an_outlier_moves_the_belief_less_than_a_near_sample():
    density = noise_density("salt-and-pepper", 0.05)
    near, far = np.abs(density.score(np.array([0.6, 10.1]), 0.3))
    assert far < near / 2


def test_scores_are_finite_however_far_the_innovation():
    for kind in sorted(NOISES):
        density = noise_density(kind, LEVELS.get(kind, 1.0))
        for spread in (0.0, 0.01, 1.0, 1e3):
            assert np.isfinite(density.score(np.array([-1e6, -20.0, 0.0, 20.0, 1e6]), spread)).all()
            assert density.information(spread) > 0


@pytest.mark.parametrize("kind", sorted(NOISES))
@pytest.mark.parametrize("spread", [0.07, 0.5, 4.0])
def test_every_density_adds_up_to_one(kind, spread):
    innovation = np.linspace(-60, 60, 200_001)
    density = np.exp(noise_density(kind, LEVELS.get(kind, 1.0)).log_density(innovation, spread))
    assert integrate.trapezoid(density, innovation) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("variance", [0.03, 1.0, 6.0])
def test_families_have_the_variance_that_is_told(variance):
    found = family_densities(variance)
    assert len(found) == (7 if variance > BACKGROUND_DEG2 else 6)
    for density in found:
        assert density.variance == pytest.approx(variance)


def test_a_density_is_rough_where_the_dither_counts_or_errors_depend_on_the_angle():
    rough = [("poisson", 0.1), ("stereo-vision", 1.0)]
    exact = [("poisson", 1.0), ("poisson-dithered", 0.1), ("gaussian", 0.01), ("gamma", 1.0)]
    assert [noise_density(*noise).rough for noise in rough + exact] == [True] * 2 + [False] * 4


def test_integer_noise_is_not_read_off_its_lattice():
    plain, dithered = noise_density("poisson", 1.0), noise_density("poisson-dithered", 1.0)
    innovation = np.linspace(-2, 4, 25)
    for spread in (0.05, 0.5):
        np.testing.assert_allclose(
            plain.score(innovation, spread), dithered.score(innovation, spread), rtol=0.02
        )
