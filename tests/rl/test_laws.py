"""NoiseModelParameters of the noise: densities against SciPy, and what the lesson makes of known noises."""

import numpy as np
import pytest
import torch
from scipy import integrate, stats
from small_twins import generator, shorter

from rl.twins.filter_bank import PARTS, NoiseModelParameters, normed
from rl.twins.learning import learn_noise_models
from rl.twins.noises import count_noise_models, draw_noises

GRID = np.linspace(-12, 15, 5401)


def density(noise_models, variance, noise_model, doubt=0.0):
    """Density on `GRID` of a noise model at one R, smeared by a belief."""
    with torch.no_grad():
        every = noise_models(torch.tensor([variance], dtype=torch.float32))
        residual = torch.as_tensor(GRID, dtype=torch.float32)[:, None, None] - every.place
        parts = every.log_parts(residual, torch.full((len(GRID),), doubt))
        return torch.exp(normed(parts)[1])[:, noise_model].numpy() / np.sqrt(2 * np.pi), every


@pytest.fixture(scope="module")
def learned():
    """NoiseModelParameters of four families, after the whole lesson."""
    torch.manual_seed(1)
    families = ("gaussian", "uniform", "gamma", "poisson")
    noise_models = NoiseModelParameters(count_noise_models(families))
    learn_noise_models(
        noise_models,
        shorter(noises=families, noise_model_sequences=4096, noise_model_updates=700, noise_model_rate=3e-2),
    )
    return noise_models


@pytest.mark.parametrize("doubt", [0.0, 0.3])
def test_a_law_is_a_density_whose_mean_it_tells(doubt):
    torch.manual_seed(2)
    noise_models = NoiseModelParameters(3)
    for noise_model in range(3):
        found, every = density(noise_models, 2.0, noise_model, doubt)
        assert integrate.trapezoid(found, GRID) == pytest.approx(1, abs=2e-3)
        mean = integrate.trapezoid(found * GRID, GRID)
        assert mean == pytest.approx(float(every.mean[0, noise_model]), abs=5e-3)
    assert every.place.shape == (1, 3, PARTS)
    np.testing.assert_allclose(torch.exp(every.log_prior).sum(dim=-1), 1, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("variance", [0.1, 1.0, 5.0])
def test_the_lesson_finds_the_densities_of_the_families(learned, variance):
    """Smeared by a third of R, as a filter's belief would; the distance is that of total variation."""
    smear = np.sqrt(0.3)
    noise_models = {
        0: stats.norm(scale=np.sqrt(1.3)).pdf(GRID),
        1: (stats.norm.cdf((GRID + 3**0.5) / smear) - stats.norm.cdf((GRID - 3**0.5) / smear)) / (2 * 3**0.5),
    }
    for noise_model, wanted in noise_models.items():
        found, every = density(learned, variance, noise_model, 0.3)
        assert integrate.trapezoid(np.abs(found - wanted), GRID) / 2 < 0.04
        assert abs(float(every.mean[0, noise_model])) < 0.05


@pytest.mark.slow
def test_a_sharp_law_tells_more_of_the_angle_than_its_variance_says(learned):
    """Fisher's information of a normal distribution is one over its variance; that of any other is larger."""
    _, every = density(learned, 1.0, 0)
    effective = every.effective[0].tolist()
    assert effective[0] == pytest.approx(1, abs=0.12)
    assert max(effective[1:]) < 0.9


def test_contaminated_noise_has_the_stated_moments_and_its_skew_is_to_the_side_of_its_mean():
    """Three models have the mean on either side, by the share of the second normal distribution."""
    noise = draw_noises(["contaminated"], 300, 20000, generator(6))
    root = np.sqrt(noise.variance)
    np.testing.assert_allclose(noise.noise_deg.mean(axis=1) / root, noise.mean_deg / root, atol=0.04)
    np.testing.assert_allclose(noise.noise_deg.var(axis=1) / noise.variance, 1, atol=0.15)
    skew = stats.skew(noise.noise_deg, axis=1)
    assert (np.sign(skew) == np.sign(noise.mean_deg))[np.abs(skew) > 0.2].all()
    assert (np.sign(noise.mean_deg) == np.where(noise.noise_model >= 3, 1, -1)).all()
    assert set(noise.noise_model.tolist()) == set(range(count_noise_models(["contaminated"])))
