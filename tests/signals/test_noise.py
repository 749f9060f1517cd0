"""Noise: its moments and its law against theory, within the standard error of large samples."""

import itertools

import numpy as np
import pytest
from scipy import integrate, stats

from twin.signals.noise import (
    BACKGROUND_DEG2,
    GAMMA_SHAPE,
    NOISES,
    OUTLIER_DEG,
    STUDENT_FREEDOM,
    draw_noise,
    fisher_information,
    noise_variance,
)

COUNT = 400_000
SIGMAS = 5  # one test in two million fails by chance; the seed is fixed anyway


def draw(kind: str, level: float, seed: int = 0) -> np.ndarray:
    return draw_noise(kind, level, (COUNT,), np.random.default_rng(seed))


def law(kind: str, level: float) -> tuple[float, float, float]:
    """Mean, variance and fourth central moment, from the theory of each law."""
    if kind == "gaussian":
        return 0.0, level, 3 * level**2
    if kind == "laplace":
        return 0.0, level, 6 * level**2
    if kind == "uniform":
        return 0.0, level, 9 / 5 * level**2
    if kind == "gamma":
        return np.sqrt(GAMMA_SHAPE * level), level, (3 + 6 / GAMMA_SHAPE) * level**2
    if kind == "salt-and-pepper":
        core, far = BACKGROUND_DEG2, level * OUTLIER_DEG**2
        return 0.0, core + far, 3 * core**2 + 6 * core * far + far * OUTLIER_DEG**2
    poisson = level + 3 * level**2
    if kind == "poisson":
        return level, level, poisson
    return level, level + 1 / 12, poisson + 6 * level / 12 + 1 / 80  # sum of independent variables


LAWS = sorted(set(NOISES) - {"student-t"})  # which has no fourth moment: its whole law is tested below


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("level", [0.1, 1.0, 5.0])
def test_mean_and_variance_are_those_of_the_law(kind, level):
    level = min(level, 0.3) if kind == "salt-and-pepper" else level
    noise = draw(kind, level)
    mean, variance, fourth = law(kind, level)
    assert noise.mean() == pytest.approx(mean, abs=SIGMAS * np.sqrt(variance / COUNT))
    assert noise.var() == pytest.approx(variance, abs=SIGMAS * np.sqrt((fourth - variance**2) / COUNT))
    assert noise_variance(kind, level) == pytest.approx(variance, rel=1e-12)


def continuous_laws(level):
    scale = np.sqrt(level / (STUDENT_FREEDOM / (STUDENT_FREEDOM - 2)))
    return {
        "laplace": stats.laplace(scale=np.sqrt(level / 2)),
        "student-t": stats.t(STUDENT_FREEDOM, scale=scale),
        "uniform": stats.uniform(-np.sqrt(3 * level), 2 * np.sqrt(3 * level)),
        "gamma": stats.gamma(GAMMA_SHAPE, scale=np.sqrt(level / GAMMA_SHAPE)),
        "gaussian": stats.norm(scale=np.sqrt(level)),
    }


@pytest.mark.parametrize("kind", continuous_laws(1.0))
@pytest.mark.parametrize("level", [0.5, 4.0])
def test_noise_has_the_distribution_of_its_name(kind, level):
    assert stats.kstest(draw(kind, level), continuous_laws(level)[kind].cdf).pvalue > 0.001
    assert continuous_laws(level)[kind].var() == pytest.approx(noise_variance(kind, level))


@pytest.mark.parametrize("kind", ["gaussian", "laplace", "student-t"])
@pytest.mark.parametrize("level", [0.5, 4.0])
def test_information_is_the_mean_square_slope_of_the_log_density(kind, level):
    density = continuous_laws(level)[kind].pdf

    def integrand(x):
        return ((density(x + 1e-5) - density(x - 1e-5)) / 2e-5) ** 2 / density(x)

    reach = {"gaussian": 8, "laplace": 20, "student-t": 100}[kind] * np.sqrt(level)
    half, _ = integrate.quad(integrand, 1e-4, reach, limit=400, points=[np.sqrt(level)])
    assert fisher_information(kind, level) == pytest.approx(2 * half, rel=2e-3)
    assert fisher_information(kind, level) >= 1 / level * (1 - 1e-12)


def test_dither_removes_the_lattice_that_leaks_the_angle():
    angle = 37.25
    leaking = angle + draw("poisson", 1.0)
    assert np.unique(leaking % 1).tolist() == [0.25]  # anyone can read the fraction of the angle
    hidden = angle + draw("poisson-dithered", 1.0)
    assert stats.kstest(hidden % 1, stats.uniform().cdf).pvalue > 0.001
    counts = np.round(hidden - angle)
    assert np.abs(hidden - angle - counts).max() <= 0.5
    assert counts.var() == pytest.approx(1.0, abs=0.02)


def test_unknown_noise_and_levels_are_refused():
    with pytest.raises(ValueError, match="unknown noise 'pink'; valid: gaussian, poisson, poisson-dithered"):
        draw_noise("pink", 1.0, (3,), np.random.default_rng(0))
    for kind, level in itertools.product(NOISES, [-1e-9, np.nan, np.inf]):
        with pytest.raises(ValueError, match=f"{kind} noise of level"):
            draw_noise(kind, level, (3,), np.random.default_rng(0))
