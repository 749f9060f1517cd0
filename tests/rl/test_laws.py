"""NoiseModelParameters of the noise: densities against SciPy, and what the lesson makes of known noises."""

import numpy as np
import pytest
import torch
from scipy import integrate, stats
from small_twins import generator, shorter

from rl.twins.filter_bank import PARTS, NoiseModelParameters, normed
from rl.twins.learning import learn_noise_models
from rl.twins.noises import FAMILIES, ModelOf, draw_noises
from rl.twins.noises import noise_models as models_of

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
    noise_models = NoiseModelParameters(models_of(families))
    learn_noise_models(
        noise_models,
        shorter(noises=families, noise_model_sequences=4096, noise_model_updates=700, noise_model_rate=3e-2),
    )
    return noise_models


@pytest.mark.parametrize("doubt", [0.0, 0.3])
def test_a_model_is_a_density_of_mean_zero_and_its_mirror_image_too(doubt):
    torch.manual_seed(2)
    noise_models = NoiseModelParameters([ModelOf(0, 1.0), ModelOf(1, 1.0), ModelOf(1, -1.0)])
    for noise_model in range(3):
        found, every = density(noise_models, 2.0, noise_model, doubt)
        assert integrate.trapezoid(found, GRID) == pytest.approx(1, abs=2e-3)
        assert integrate.trapezoid(found * GRID, GRID) == pytest.approx(0, abs=5e-3)
    one, mirrored = (density(noise_models, 2.0, of, doubt)[0] for of in (1, 2))
    np.testing.assert_allclose(np.interp(-GRID, GRID, one), mirrored, atol=1e-3)
    assert every.place.shape == (1, 3, PARTS)
    prior = torch.exp(every.log_prior[0])
    np.testing.assert_allclose([prior.sum(), prior[1] - prior[2]], [1, 0], atol=1e-5)


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
        found, _ = density(learned, variance, noise_model, 0.3)
        assert integrate.trapezoid(np.abs(found - wanted), GRID) / 2 < 0.04


@pytest.mark.slow
def test_a_sharp_law_tells_more_of_the_angle_than_its_variance_says(learned):
    """Fisher's information of a normal distribution is one over its variance; that of any other is larger."""
    _, every = density(learned, 1.0, 0)
    effective = every.effective[0].tolist()
    assert effective[0] == pytest.approx(1, abs=0.12)
    assert max(effective[1:]) < 0.9


@pytest.mark.parametrize(
    "family", [name for name, of in FAMILIES.items() if of.skewed and of.shapes and name != "two-modes"]
)
def test_a_skewed_noise_is_drawn_to_either_side_and_its_model_says_to_which(family):
    noise = draw_noises([family], 300, 5000, generator(6))
    side = np.array([of.side for of in models_of([family])])[noise.noise_model]
    skew = stats.skew(noise.noise_deg, axis=1)
    assert (np.sign(skew) == side)[np.abs(skew) > 0.3].all()
    assert set(noise.noise_model.tolist()) == set(range(len(models_of([family]))))
