"""Interacting models: equal ones are one filter, and the one that explains the measurements takes over."""

import dataclasses

import numpy as np
import pytest

from twin.estimation.active_model import ActiveModel
from twin.estimation.adaptive import InteractingModels
from twin.hysteresis import ColemanHodgdon

T, R = 0.1, 0.5
MODEL = ColemanHodgdon(1.15, 22.3, 4.9)
STIFF = ActiveModel(
    MODEL, T, process_variance=(1e-4, 1e-4), measurement_variance=R, initial_variance=(25.0, 0.1)
)
AGILE = dataclasses.replace(STIFF, process_variance=(1e-2, 5.0), initial_variance=(25.0, 5.0))
PULL = 3 + np.sin(np.linspace(0, 30, 400))


def measured(off_deg, seed=0, count=3):
    """Angles of the model, from the middle on with an error that moves, and noise on them."""
    bend = MODEL.response(PULL, 40.0) + off_deg * np.sin(np.linspace(0, 25, 400)) * (PULL > 0)
    noise = np.sqrt(R) * np.random.default_rng(seed).standard_normal((count, 400))
    return bend, bend + noise


def test_equal_filters_are_one_filter():
    _, measurement = measured(3.0)
    measurement[:, 50:60] = np.nan
    both = InteractingModels((AGILE, AGILE)).estimate_with_interval(PULL, measurement, 35.0)
    alone = AGILE.estimate_with_interval(PULL, measurement, 35.0)
    for found, wanted in zip(both, alone, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-8)


@pytest.mark.parametrize(("off_deg", "likelier"), [(0.0, 0), (40.0, 1)])
def test_the_filter_whose_variances_hold_becomes_the_likely_one(off_deg, likelier):
    bend, measurement = measured(off_deg)
    models = InteractingModels((STIFF, AGILE))
    state = models.start(PULL[:1].repeat(3), measurement[:, 0])
    probability = []
    for k in range(1, 400):
        state = models.step(state, PULL[k].repeat(3), PULL[k - 1].repeat(3), measurement[:, k])
        probability.append(state.probability[likelier])
    np.testing.assert_allclose(state.probability.sum(axis=0), 1)
    assert np.mean(probability[200:]) > 0.6

    def error(of):
        return np.sqrt(np.mean((of.estimate(PULL, measurement, 35.0) - bend)[:, 50:] ** 2))

    wrong = (AGILE, STIFF)[likelier]
    assert error(models) < error(wrong)


def test_one_step_is_that_of_the_textbook():
    """Mixing, likelihoods and probabilities of two filters of two states, written out for one record."""
    models = InteractingModels((STIFF, AGILE), stays=0.9)
    start = models.start(np.array([3.0]), np.array([40.0]))
    first = models.step(start, np.array([3.1]), np.array([3.0]), np.array([44.0]))
    second = models.step(first, np.array([3.2]), np.array([3.1]), np.array([45.0]))
    chain, mu = np.array([[0.9, 0.1], [0.1, 0.9]]), first.probability[:, 0]
    unnormed = []
    for j, filter_ in enumerate((STIFF, AGILE)):
        c = sum(chain[i, j] * mu[i] for i in range(2))
        share = [chain[i, j] * mu[i] / c for i in range(2)]
        mean = sum(share[i] * first.beliefs[i].mean[:, 0] for i in range(2))
        cov = sum(
            share[i]
            * (
                first.beliefs[i].covariance[:, :, 0]
                + np.outer(first.beliefs[i].mean[:, 0] - mean, first.beliefs[i].mean[:, 0] - mean)
            )
            for i in range(2)
        )
        slope = 1 - MODEL.a_per_mm * 0.1
        F = np.array([[slope, T], [0, 1]])
        ahead = F @ mean + [MODEL.a_per_mm * 0.1 * MODEL.b_deg_per_mm * 3.2 + MODEL.c_deg_per_mm * 0.1, 0]
        P = F @ cov @ F.T + np.diag(filter_.process_variance)
        S = P[0, 0] + R
        np.testing.assert_allclose(
            second.beliefs[j].mean[:, 0], ahead + P[:, 0] / S * (45.0 - ahead[0]), rtol=1e-9
        )
        unnormed.append(c * np.exp(-0.5 * (45.0 - ahead[0]) ** 2 / S) / np.sqrt(S))
    np.testing.assert_allclose(second.probability[:, 0], np.array(unnormed) / sum(unnormed), rtol=1e-9)
