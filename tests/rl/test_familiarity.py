"""OodDetector of a noise: of histograms as they were in training, and of others."""

import numpy as np
import pytest
import torch
from scipy import stats
from small_twins import LAWS, generator

from rl.twins.ood_detector import BINS, FAMILIAR, LEVELS, Histograms, OodDetector


def test_divergence_is_that_of_kullback_and_leibler():
    rng = generator(1)
    noise_models = rng.dirichlet(np.ones(BINS), size=LAWS)
    weights, counts = rng.dirichlet(np.ones(LAWS), size=6), 50 * rng.dirichlet(np.ones(BINS), size=6)
    ood_detector = OodDetector(LAWS)
    ood_detector.histograms.copy_(torch.as_tensor(np.log(noise_models))[:, None, :].expand(-1, LEVELS[2], -1))
    given = (
        torch.as_tensor(of, dtype=torch.float32) for of in (weights, counts, np.log([0.1, 0.5, 1, 2, 4, 8]))
    )
    found = ood_detector.divergence(*given)
    expected = stats.entropy(counts / 50, weights @ noise_models, axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.fixture(scope="module")
def learned():
    """Two noise models that the classifier knows, and histograms of 20 to 400 samples of them."""
    rng = generator(2)
    centres = np.linspace(-3.9, 3.9, BINS)
    noise_models = np.array([np.exp(-0.5 * centres**2), np.exp(-np.abs(centres - 1))])
    noise_models /= noise_models.sum(axis=1, keepdims=True)

    def draw(noise_model, count, least=20):
        sizes = rng.integers(least, 400, count)
        return torch.tensor(
            np.array([rng.multinomial(size, noise_model) for size in sizes]), dtype=torch.float32
        )

    which = np.repeat([0, 1], 3000)
    weights = torch.zeros(6000, LAWS)
    weights[range(6000), which] = 1
    ood_detector = OodDetector(LAWS)
    rows = generator(3)
    parts = [
        Histograms(
            weights, torch.cat([draw(noise_model, 3000) for noise_model in noise_models]), torch.zeros(6000)
        )
        for _ in range(2)
    ]
    ood_detector.learn(*parts, lambda n: torch.as_tensor(rows.integers(6000, size=n)))
    return ood_detector, noise_models, draw


def test_histograms_of_the_training_are_familiar(learned):
    ood_detector, noise_models, draw = learned
    for place, noise_model in enumerate(noise_models):
        weights = torch.zeros(2000, LAWS)
        weights[:, place] = 1
        known = ood_detector(weights, draw(noise_model, 2000), torch.zeros(2000))
        assert (known == 1).float().mean() > 3 * FAMILIAR - 2
        found = torch.softmax(ood_detector.histograms[place], dim=-1)[[6, 7]].mean(dim=0)  # about R = 1
        np.testing.assert_allclose(found, noise_model, atol=0.01)


def test_of_a_foreign_noise_nothing_is_said(learned):
    """Two bells, and the right histogram under the wrong belief."""
    ood_detector, noise_models, draw = learned
    centres = np.linspace(-3.9, 3.9, BINS)
    bells = np.exp(-8 * (np.abs(centres) - 2) ** 2)
    weights = torch.zeros(500, LAWS)
    weights[:, 0] = 1
    for foreign in (bells / bells.sum(), noise_models[1]):
        known = ood_detector(weights, draw(foreign, 500, 100), torch.zeros(500))
        assert (known == 0).float().mean() > 0.95
