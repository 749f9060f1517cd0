"""Soundness of a state: one number that cannot be is found, wherever it is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.estimation.gaussian import Belief
from twin.estimation.soundness import is_sound


def belief(matrix) -> Belief:
    covariance = np.asarray(matrix, dtype=float)[:, :, None]
    return Belief(np.zeros((len(covariance), 1)), covariance, np.empty((0, 1)))


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e13, -1e300])
@pytest.mark.parametrize("size", [1, 5, 100])
def test_one_wrong_number_is_found_anywhere(wrong, size):
    array = np.zeros((2, size))
    array[-1, -1] = wrong
    for state in (array, ("x", (1, array)), {"a": [array]}, float(wrong)):
        assert not is_sound(state)


@given(st.integers(1, 6), st.randoms(use_true_random=False), st.booleans())
def test_covariance_is_positive_exactly_where_its_eigenvalues_are(size, random, indefinite):
    rng = np.random.default_rng(random.getrandbits(32))
    axes = np.linalg.qr(rng.standard_normal((size, size)))[0]
    values = rng.uniform(0.1, 10, size)
    if indefinite:
        values[0] = -values[0]
    assert is_sound(belief((axes * values) @ axes.T)) is not indefinite


def test_first_belief_of_a_lifted_model_is_sound_and_a_lost_variance_is_not():
    assert is_sound(belief(np.full((3, 3), 114.5)))
    assert not is_sound(belief(np.zeros((2, 2))))
    assert not is_sound(belief(-np.eye(2)))
