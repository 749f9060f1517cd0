"""The paired comparison knows better from worse, and its interval covers what it should."""

import numpy as np
import pytest

from twin.gate.paired import compare_paired


def runs(rng, units=40, draws=3, twin=1.0, noise=0.3):
    """Mean square errors that differ from twin to twin and from draw to draw."""
    level = np.exp(twin * rng.standard_normal((units, 1)))
    return level * np.exp(noise * rng.standard_normal((units, draws)))


def test_the_same_errors_do_not_differ():
    squares = runs(np.random.default_rng(0))
    found = compare_paired(squares, squares, np.random.default_rng(1))
    assert (found.difference_deg, found.low_deg, found.high_deg) == (0, 0, 0)
    assert found.rmse_deg == pytest.approx(np.sqrt(squares.mean()))


def test_pairing_sees_a_difference_that_is_far_smaller_than_that_between_twins():
    rng = np.random.default_rng(2)
    rival = runs(rng)
    found = compare_paired(0.9 * rival, rival, np.random.default_rng(1))
    assert found.high_deg < 0
    assert compare_paired(rival, 0.9 * rival, np.random.default_rng(1)).low_deg > 0
    shuffled = rng.permutation(rival)
    assert compare_paired(0.9 * shuffled, rival, np.random.default_rng(1)).high_deg > 0


def test_the_interval_covers_the_true_difference_nearly_as_often_as_it_says():
    rng, inside = np.random.default_rng(3), 0
    for _ in range(100):
        rival = runs(rng, twin=0.3)
        mine = 0.8 * rival * np.exp(0.2 * rng.standard_normal((40, 1)) - 0.02)
        found = compare_paired(mine, rival, rng)
        truth = (np.sqrt(0.8) - 1) * np.sqrt(np.exp(0.3**2 / 2 + 0.3**2 / 2))
        inside += found.low_deg <= truth <= found.high_deg
    assert 84 <= inside <= 100


def test_runs_that_do_not_belong_together_are_refused():
    with pytest.raises(ValueError, match="must be the same"):
        compare_paired(np.ones((2, 3)), np.ones((3, 2)), np.random.default_rng(0))
