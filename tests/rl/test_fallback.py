"""Fallback under strange noise: what histograms tell of tails, and the filter on it."""

import numpy as np
import pytest
import torch
from small_twins import generator, small_source, small_step

from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences
from rl.twins.ood_detector import BOUND, HEAVY, Fallback, ResidualHistogram, Verdict
from twin.signals.noise import draw_noise, noise_variance

LEVELS = {
    "gaussian": 1.0,
    "uniform": 1.0,
    "laplace": 1.0,
    "student-t": 1.0,
    "salt-and-pepper": 0.05,
}


def histograms(kind, samples, count=300):
    """Histograms of noises without their mean, in units of their standard deviation."""
    noise = draw_noise(kind, LEVELS[kind], (count, samples), generator(3))
    noise -= noise.mean(axis=1, keepdims=True)
    residual = torch.as_tensor(noise / np.sqrt(noise_variance(kind, LEVELS[kind])), dtype=torch.float32)
    return ResidualHistogram()(residual, torch.zeros_like(residual)).sum(dim=1)


@pytest.mark.parametrize(
    ("kind", "low", "high"),
    [
        ("gaussian", 1.0, 1.0),
        ("uniform", 1.0, 1.0),
        # Of a Laplace noise model of variance 1, exp(2 E[log |x|]) is exp(-2 * 0.5772) / 2; of a normal one
        # exp(-1.2704). Bins of a width make the peak a little wider.
        ("laplace", 0.5615 / HEAVY - 0.05, 0.5615 / HEAVY + 0.1),
        ("salt-and-pepper", 0.02, 0.08),
    ],
)
def test_the_variance_of_the_middle_is_that_of_the_law(kind, low, high):
    found = Fallback().narrower(histograms(kind, 2000)).mean()
    assert low - 0.02 <= found <= high


def test_an_innovation_moves_by_its_bound_at_most():
    innovation = torch.tensor([-10.0, -1.0, 0.0, 2.9, 3.1, 1e6])
    one = torch.ones(6)
    moved = innovation * Verdict(one, one).bound(innovation, 4.0 * one)
    np.testing.assert_allclose(moved, innovation.clamp(-2 * BOUND, 2 * BOUND), rtol=1e-5)
    heard = Verdict(0 * one, one).bound(innovation, 4.0 * one)
    assert (heard == 1).all()


def errors_of(step, drawn):
    with torch.no_grad():
        found = [output.bend_deg for output, _ in filter_sequences(step, drawn, ALL)]
    return (torch.stack(found) - drawn.truth_deg)[20:]


def test_under_strange_outliers_the_robust_filter_is_ahead():
    step = small_step()
    drawn = small_source(["salt-and-pepper"]).draw(64, 190, generator(5), 5)
    alone = errors_of(step, drawn).abs().median()  # six members do not reach a few of the twins
    step.guarded = True
    step.ood_detector.level.fill_(1e-9)  # everything is strange
    assert errors_of(step, drawn).abs().median() < 0.75 * alone
