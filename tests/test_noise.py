"""Noise: its moments and its law against theory, within the standard error of large samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from twin.noise import NOISES, draw_noise, noise_variance

COUNT = 400_000
SIGMAS = 5  # one test in two million fails by chance; the seed is fixed anyway


def draw(kind: str, level: float, seed: int = 0) -> np.ndarray:
    return draw_noise(kind, level, (COUNT,), np.random.default_rng(seed))


def law(kind: str, level: float) -> tuple[float, float, float]:
    """Mean, variance and fourth central moment, from the theory of each law."""
    if kind == "gaussian":
        return 0.0, level, 3 * level**2
    poisson = level + 3 * level**2
    if kind == "poisson":
        return level, level, poisson
    return level, level + 1 / 12, poisson + 6 * level / 12 + 1 / 80  # sum of independent variables


@pytest.mark.parametrize("kind", sorted(NOISES))
@pytest.mark.parametrize("level", [0.1, 1.0, 5.0])
def test_mean_and_variance_are_those_of_the_law(kind, level):
    noise = draw(kind, level)
    mean, variance, fourth = law(kind, level)
    assert noise.mean() == pytest.approx(mean, abs=SIGMAS * np.sqrt(variance / COUNT))
    assert noise.var() == pytest.approx(variance, abs=SIGMAS * np.sqrt((fourth - variance**2) / COUNT))
    assert noise_variance(kind, level) == pytest.approx(variance, rel=1e-12)


def test_gaussian_noise_has_a_gaussian_distribution():
    assert stats.kstest(draw("gaussian", 4.0), stats.norm(scale=2.0).cdf).pvalue > 0.001


@pytest.mark.parametrize("level", [0.1, 2.0])
def test_poisson_noise_counts_with_poisson_probabilities(level):
    noise = draw("poisson", level)
    for count in range(4):
        probability = stats.poisson(level).pmf(count)
        error = SIGMAS * np.sqrt(probability * (1 - probability) / COUNT)
        assert np.mean(noise == count) == pytest.approx(probability, abs=error)
    assert (noise >= 0).all()


def test_dither_removes_the_lattice_that_leaks_the_angle():
    angle = 37.25
    leaking = angle + draw("poisson", 1.0)
    assert np.unique(leaking % 1).tolist() == [0.25]  # anyone can read the fraction of the angle
    hidden = angle + draw("poisson-dithered", 1.0)
    assert stats.kstest(hidden % 1, stats.uniform().cdf).pvalue > 0.001
    counts = np.round(hidden - angle)
    assert np.abs(hidden - angle - counts).max() <= 0.5
    assert counts.var() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("kind", sorted(NOISES))
def test_samples_are_independent_and_repeat_with_their_seed(kind):
    noise = draw(kind, 1.0)
    centred = (noise - noise.mean()) / noise.std()
    for lag in (1, 2, 10):
        assert abs(np.mean(centred[lag:] * centred[:-lag])) < SIGMAS / np.sqrt(COUNT)
    assert np.array_equal(noise, draw(kind, 1.0))
    assert not np.array_equal(noise, draw(kind, 1.0, seed=1))


@given(kind=st.sampled_from(sorted(NOISES)), shape=st.tuples(st.integers(0, 4), st.integers(0, 4)))
def test_noise_has_the_shape_asked_for_and_level_zero_only_dithers(kind, shape):
    noise = draw_noise(kind, 0.0, shape, np.random.default_rng(0))
    assert noise.shape == shape
    assert noise.dtype == float
    assert (np.abs(noise) <= (0.5 if kind == "poisson-dithered" else 0)).all()


@pytest.mark.parametrize("level", [-1e-9, np.nan, np.inf])
def test_level_that_no_noise_has_is_refused(level):
    for kind in NOISES:
        with pytest.raises(ValueError, match=f"{kind} noise of level"):
            draw_noise(kind, level, (3,), np.random.default_rng(0))


def test_unknown_noise_is_refused_with_the_valid_ones():
    expected = "unknown noise 'pink'; valid: gaussian, poisson, poisson-dithered"
    with pytest.raises(ValueError, match=expected):
        draw_noise("pink", 1.0, (3,), np.random.default_rng(0))
    with pytest.raises(ValueError, match=expected):
        noise_variance("pink", 1.0)
