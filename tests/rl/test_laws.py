"""Laws of the noise: densities against SciPy, and what the lesson makes of known noises."""

import numpy as np
import pytest
import torch
from scipy import integrate, stats
from small_twins import generator, shorter

from rl.twins.laws import PARTS, Laws, normed
from rl.twins.laws_lesson import learn_laws
from rl.twins.noises import FAMILIES, STANDARD, count_laws, draw_noises

GRID = np.linspace(-12, 15, 5401)


def density(laws, variance, law, doubt=0.0):
    """Density on `GRID` of a law at one R, smeared by a belief."""
    with torch.no_grad():
        every = laws(torch.tensor([variance], dtype=torch.float32))
        residual = torch.as_tensor(GRID, dtype=torch.float32)[:, None, None] - every.place
        parts = every.log_parts(residual, torch.full((len(GRID),), doubt))
        return torch.exp(normed(parts)[1])[:, law].numpy() / np.sqrt(2 * np.pi), every


@pytest.fixture(scope="module")
def learned():
    """Laws of four families, after the whole lesson."""
    torch.manual_seed(1)
    families = ("gaussian", "uniform", "gamma", "poisson")
    laws = Laws(count_laws(families))
    learn_laws(laws, shorter(noises=families, laws_sequences=4096, laws_updates=700, laws_rate=3e-2))
    return laws


@pytest.mark.parametrize("doubt", [0.0, 0.3])
def test_a_law_is_a_density_whose_mean_it_tells(doubt):
    torch.manual_seed(2)
    laws = Laws(3)
    for law in range(3):
        found, every = density(laws, 2.0, law, doubt)
        assert integrate.trapezoid(found, GRID) == pytest.approx(1, abs=2e-3)
        mean = integrate.trapezoid(found * GRID, GRID)
        assert mean == pytest.approx(float(every.mean[0, law]), abs=5e-3)
    assert every.place.shape == (1, 3, PARTS)
    np.testing.assert_allclose(torch.exp(every.log_prior).sum(dim=-1), 1, rtol=1e-5)


def test_shares_and_sums_of_logarithms_are_those_of_torch():
    values = torch.randn(4, 3, 7) * 50
    share, total = normed(values)
    torch.testing.assert_close(total, torch.logsumexp(values, dim=-1))
    torch.testing.assert_close(share, torch.softmax(values, dim=-1))


@pytest.mark.parametrize("variance", [0.1, 1.0, 5.0])
def test_the_lesson_finds_the_densities_of_the_families(learned, variance):
    """Smeared by a third of R, as a filter's belief would; the distance is that of total variation."""
    smear = np.sqrt(0.3)
    laws = {
        0: stats.norm(scale=np.sqrt(1.3)).pdf(GRID),
        1: (stats.norm.cdf((GRID + 3**0.5) / smear) - stats.norm.cdf((GRID - 3**0.5) / smear)) / (2 * 3**0.5),
    }
    for law, wanted in laws.items():
        found, every = density(learned, variance, law, 0.3)
        assert integrate.trapezoid(np.abs(found - wanted), GRID) / 2 < 0.04
        assert abs(float(every.mean[0, law])) < 0.05


@pytest.mark.parametrize("variance", [0.1, 1.0, 3.0])
def test_skewed_laws_tell_the_mean_of_their_noise(learned, variance):
    """Poisson noise of variance R has the mean R; gamma noise of shape k has sqrt(k R)."""
    _, every = density(learned, variance, 0)
    *gammas, poisson = every.mean[0, 2:].tolist()
    shapes = 1.2 + 2.3 * (np.arange(5) + 0.5) / 5
    np.testing.assert_allclose(gammas, np.sqrt(shapes), atol=0.12)
    assert poisson == pytest.approx(np.sqrt(variance), abs=0.15)


def test_a_sharp_law_tells_more_of_the_angle_than_its_variance_says(learned):
    """Fisher's information of a normal law is one over its variance; that of any other is larger."""
    _, every = density(learned, 1.0, 0)
    effective = every.effective[0].tolist()
    assert effective[0] == pytest.approx(1, abs=0.12)
    assert max(effective[1:]) < 0.9


def test_what_is_met_more_often_is_more_likely_before_anything_is_measured(learned):
    _, every = density(learned, 1.0, 0)
    prior = torch.exp(every.log_prior[0])
    weights = [FAMILIES[name].weight for name in ("gaussian", "uniform", "gamma", "poisson")]
    # Of symmetric families R is drawn up to 8 deg^2, of skewed ones up to 4, by its logarithm.
    density_at_one = np.array(weights) / np.log([160, 160, 80, 80])
    wanted = density_at_one / density_at_one.sum()
    found = [float(prior[0]), float(prior[1]), float(prior[2:7].sum()), float(prior[7])]
    np.testing.assert_allclose(found, wanted, atol=0.06)


def test_families_are_divided_into_their_laws():
    families = ("laplace", "gamma", "salt-and-pepper")
    noise = draw_noises(families, 400, 5, generator(4))
    for place, (first, last) in enumerate([(0, 0), (1, 5), (6, 11)]):
        mine = noise.law[noise.family == place]
        assert set(mine) == set(range(first, last + 1))
    assert count_laws(families) == 12
    shape = (noise.mean_deg**2 / noise.variance)[noise.family == 1]
    order = np.argsort(shape)
    assert (np.diff(noise.law[noise.family == 1][order]) >= 0).all()


def test_weibull_laws_are_those_of_their_shapes_and_are_met_where_asked_for():
    """Mean over deviation falls as the law nears the exponential one; each law has a range of shapes."""
    assert set(FAMILIES) - set(STANDARD) == {"weibull"}
    noise = draw_noises(["weibull"], 200, 2000, generator(6))
    of_deviation = noise.mean_deg / np.sqrt(noise.variance)
    assert (noise.noise_deg >= 0).all()
    for law in range(count_laws(["weibull"]) - 1):
        assert of_deviation[noise.law == law].max() < of_deviation[noise.law == law + 1].min()
    for shape, row in ((1.1, np.argmin(of_deviation)), (2.6, np.argmax(of_deviation))):
        law = stats.weibull_min(shape)
        assert of_deviation[row] == pytest.approx(law.mean() / law.std(), abs=0.05)
        assert stats.skew(noise.noise_deg[row]) == pytest.approx(float(law.stats("s")), abs=0.35)


def test_contaminated_noise_has_the_moments_that_are_told_and_its_skew_is_to_the_side_of_its_mean():
    """Of two normal laws; three laws have the mean on either side, by the share of the other."""
    noise = draw_noises(["contaminated"], 300, 20000, generator(6))
    root = np.sqrt(noise.variance)
    np.testing.assert_allclose(noise.noise_deg.mean(axis=1) / root, noise.mean_deg / root, atol=0.04)
    np.testing.assert_allclose(noise.noise_deg.var(axis=1) / noise.variance, 1, atol=0.15)
    skew = stats.skew(noise.noise_deg, axis=1)
    assert (np.sign(skew) == np.sign(noise.mean_deg))[np.abs(skew) > 0.2].all()
    assert (np.sign(noise.mean_deg) == np.where(noise.law >= 3, 1, -1)).all()
    assert set(noise.law.tolist()) == set(range(count_laws(["contaminated"])))
