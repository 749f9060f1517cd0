"""The algebra of Gaussian beliefs against matrices, the joint normal distribution and exact fractions."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.estimation.gaussian import condition, innovation_of, propagate

seeds = st.integers(0, 10_000)


def beliefs(seed: int, size: int, batch: int):
    """Random means (n, B), covariances (n, n, B) and a row (n,)."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((batch, size, size)) * np.exp(rng.uniform(-3, 3, (batch, 1, 1)))
    covariance = np.moveaxis(root @ root.transpose(0, 2, 1), 0, -1)
    return rng.standard_normal((size, batch)), covariance, rng.standard_normal(size), rng


@given(seed=seeds, size=st.integers(1, 4), shared=st.booleans())
def test_propagation_is_f_p_ft_plus_q(seed, size, shared):
    _, P, _, rng = beliefs(seed, size, 5)
    F = rng.standard_normal(P.shape)
    Q = beliefs(seed + 1, size, 5)[1]
    Q = Q[:, :, 0] if shared else Q
    found = propagate(P, F, Q)
    for b in range(5):
        expected = F[..., b] @ P[..., b] @ F[..., b].T + (Q if shared else Q[..., b])
        np.testing.assert_allclose(found[..., b], expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


@given(seed=seeds, size=st.integers(1, 4))
def test_conditioning_is_that_of_the_joint_normal_distribution(seed, size):
    x, P, h, rng = beliefs(seed, size, 5)
    y, R = rng.standard_normal(5), rng.uniform(0.1, 2, 5)
    mean, covariance = condition(x, P, h, y, R)
    for b in range(5):
        # State and measurement are jointly normal; Schur's complement gives the state, once y is known.
        joint = np.block([[P[..., b], (P[..., b] @ h)[:, None]], [h @ P[..., b], h @ P[..., b] @ h + R[b]]])
        slope = joint[:size, size:] / joint[size, size]
        expected = joint[:size, :size] - slope @ joint[size:, :size]
        np.testing.assert_allclose(mean[:, b], x[:, b] + slope[:, 0] * (y[b] - h @ x[:, b]), rtol=1e-9)
        np.testing.assert_allclose(covariance[..., b], expected, atol=1e-11 * np.abs(P[..., b]).max())
        np.testing.assert_array_equal(covariance[..., b], covariance[..., b].T)


def test_missing_measurements_change_nothing_and_leave_the_others_alone():
    x, P, h, rng = beliefs(0, 2, 4)
    y = rng.standard_normal(4)
    holed = np.where([False, True, False, True], np.nan, y)
    mean, covariance = condition(x, P, h, holed, 0.5)
    full_mean, full_covariance = condition(x, P, h, y, 0.5)
    np.testing.assert_array_equal(mean[:, 1::2], x[:, 1::2])
    np.testing.assert_allclose(covariance[..., 1::2], P[..., 1::2], rtol=1e-15)
    np.testing.assert_array_equal(mean[:, ::2], full_mean[:, ::2])
    np.testing.assert_array_equal(covariance[..., ::2], full_covariance[..., ::2])
    np.testing.assert_array_equal(np.isnan(innovation_of(x, P, h, holed)[0]), np.isnan(holed))


@pytest.mark.parametrize("scale", [1e6, 1e12])
@pytest.mark.parametrize("variance", [1e-12, 1e-6, 1.0])
def test_badly_scaled_covariances_agree_with_exact_fractions(scale, variance):
    """A prior of 1e12 and a noise of 1e-12: P - K H P as printed leaves an angle of zero variance."""
    P = np.array([[scale, 0.3 * scale], [0.3 * scale, scale]])[..., None]
    _, covariance = condition(np.zeros((2, 1)), P, np.array([1.0, 0.0]), 1.0, variance)
    p00, p01, p11 = (Fraction(float(value)) for value in (P[0, 0, 0], P[0, 1, 0], P[1, 1, 0]))
    R = Fraction(variance)
    exact = [p00 * R / (p00 + R), p01 * R / (p00 + R), p11 - p01 * p01 / (p00 + R)]
    theta, both, f = (float(value) for value in exact)
    assert covariance[0, 0, 0] == pytest.approx(theta, rel=1e-9)
    assert covariance[1, 1, 0] == pytest.approx(f, rel=1e-9)
    assert covariance[0, 1, 0] == pytest.approx(both, abs=1e-9 * np.sqrt(theta * f))
