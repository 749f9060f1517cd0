"""Balance of errors: what the loss of windows adds up to, by arithmetic of its own."""

import dataclasses

import numpy as np
import pytest
import torch
from small_twins import TINY_MEMORY, generator, small_source

from rl.twins.learning import MOST_LAST, POWER, TypicalErrors

SETTINGS = dataclasses.replace(TINY_MEMORY, episode=40, window=10, noises=("gaussian", "gamma"))


def sequences(stride=5, count=64):
    return small_source(SETTINGS.noises).draw(count, 40, generator(), stride=stride)


def test_what_is_typical_has_the_loss_one_in_each_family_over_an_episode():
    """Whatever a family's errors are, and however they fall from window to window."""
    drawn, typical = sequences(), TypicalErrors(SETTINGS)
    level = torch.where(drawn.family == 0, 0.01, 7.0) * drawn.variance**POWER
    falls = [5.0, 3.0, 1.0, 0.5]
    for _ in range(3):
        losses = [float(typical.loss(level * share, drawn, k)) for k, share in enumerate(falls)]
    assert np.mean(losses) == pytest.approx(1, rel=1e-5)
    # Each window counts as the share of the error that a whole record has in its time.
    stands_for = np.array([1, 1, 1, 60 / (10 * 0.1) - 3])
    stands_for[-1] = min(stands_for[-1], MOST_LAST)
    shares = stands_for * falls
    np.testing.assert_allclose(losses, 4 * shares / shares.sum(), rtol=1e-5)


def test_the_gradient_is_that_of_the_mean_logarithm_of_the_families_errors():
    drawn, typical = (
        sequences(),
        TypicalErrors(dataclasses.replace(TINY_MEMORY, episode=40, window=40, noises=SETTINGS.noises)),
    )
    square = (torch.rand(64, generator=torch.Generator().manual_seed(1)) + 0.1).requires_grad_()
    (found,) = torch.autograd.grad(typical.loss(square, drawn, 0), square)
    scaled = square / drawn.variance**POWER
    counts = torch.bincount(drawn.family).tolist()
    wanted = sum(
        count / 64 * torch.log(scaled[drawn.family == family].mean())
        for family, count in enumerate(counts)
        if count
    )
    (gradient,) = torch.autograd.grad(wanted, square)
    np.testing.assert_allclose(found, gradient, rtol=1e-4)
