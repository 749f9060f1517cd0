"""For how many independent samples a sample counts, by the innovations: known sequences, known answers."""

import numpy as np
import pytest
import torch
from scipy.signal import lfilter
from small_twins import small_step

from rl.twins.step import independence, recent

SAMPLES = 4000


def counted(innovations) -> np.ndarray:
    """Return (N, B) what samples count for, given innovations (N, B) in units of sqrt(R)."""
    innovations = torch.as_tensor(innovations, dtype=torch.float32)
    state = small_step().start(torch.ones(innovations.shape[1]))
    one, found = torch.ones(innovations.shape[1]), []
    for now in innovations:
        found.append(independence(state).numpy())
        state = state._replace(statistics=recent(state, one, now, 0.1 * one), samples=state.samples + 1)
    return np.array(found)


def autoregression(memory: float, white: np.ndarray) -> np.ndarray:
    return np.sqrt(1 - memory**2) * lfilter([1.0], [1.0, -memory], white, axis=0)


@pytest.mark.parametrize("memory", [0.5, 0.8])
@pytest.mark.parametrize("skewed", [False, True])
def test_a_sample_of_an_autoregression_counts_as_in_a_mean_of_many(memory, skewed):
    """(1 - rho) / (1 + rho), less what is put down to chance."""
    rng = np.random.default_rng(1)
    white = rng.gamma(2.0, size=(SAMPLES, 40)) - 2.0 if skewed else rng.standard_normal((SAMPLES, 40))
    late = counted(autoregression(memory, white / white.std()))[1000:]
    least, most = ((1 - rho) / (1 + rho) for rho in (memory, memory - 0.25))
    assert least - 0.05 < late.mean() < most


@pytest.mark.parametrize("kind", ["normal", "uniform", "skewed", "outliers"])
def test_an_independent_sample_counts_fully(kind):
    rng = np.random.default_rng(2)
    shape = SAMPLES, 40
    drawn = {
        "normal": lambda: rng.standard_normal(shape),
        "uniform": lambda: rng.uniform(-1.7, 1.7, shape),
        "skewed": lambda: (rng.gamma(2.0, size=shape) - 2.0) / np.sqrt(2.0),
        "outliers": lambda: 0.2 * rng.standard_normal(shape) + 4.0 * (rng.uniform(size=shape) < 0.05),
    }
    found = counted(drawn[kind]())
    assert found[0].min() == 1.0
    assert found.mean() > 0.98


def test_what_no_twin_explains_is_not_taken_for_noise():
    """A slow error of the twins makes innovations correlated, and larger than R."""
    rng = np.random.default_rng(3)
    slow = 2.0 * np.sin(np.arange(SAMPLES) / 20)[:, None]
    found = counted(slow + rng.standard_normal((SAMPLES, 40)))
    assert found[200:].mean() > 0.95
