"""The unscented filter against filterpy, against exact moments, and where the extended filter must fail."""

import dataclasses
from typing import ClassVar

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from models import BOUC_WEN

from twin.estimation.active_model import ActiveModel, UnscentedActiveModel
from twin.estimation.gaussian import Belief


@dataclasses.dataclass(frozen=True)
class Pendulum:
    """A toy that is nonlinear in the angle: it is drawn to multiples of a turn of 2 pi degrees."""

    name: ClassVar[str] = "pendulum"
    affine: ClassVar[bool] = False
    pull_to_turn: float = 1.0

    def start(self, pull_mm):
        return np.empty((0, np.size(pull_mm)))

    def step(self, bend_deg, memory, pull_mm, previous_pull_mm):
        return bend_deg + (pull_mm - previous_pull_mm) - 0.3 * np.sin(bend_deg), memory

    def slope(self, bend_deg, pull_mm, previous_pull_mm):
        return 1 - 0.3 * np.cos(bend_deg)


@dataclasses.dataclass(frozen=True)
class Square(Pendulum):
    """The next angle is the square of the last."""

    def step(self, bend_deg, memory, pull_mm, previous_pull_mm):
        return bend_deg**2, memory

    def slope(self, bend_deg, pull_mm, previous_pull_mm):
        return 2 * bend_deg


spreads = st.tuples(st.floats(0.01, 1), st.floats(0, 3), st.floats(-1, 3))


def matrix(first: float, second: float, correlation: float) -> np.ndarray:
    return np.array([[first**2, correlation * first * second], [correlation * first * second, second**2]])


@pytest.mark.parametrize("model", [Pendulum(), BOUC_WEN], ids=["pendulum", "Bouc-Wen"])
@settings(max_examples=20)
@given(spread=spreads, r=st.floats(0.05, 10), seed=st.integers(0, 10_000))
def test_filter_equals_filterpy_on_nonlinear_models(model, spread, r, seed):
    alpha, beta, kappa = 0.2 + 0.8 * spread[0], *spread[1:]
    rng = np.random.default_rng(seed)
    pull = 3 + np.cumsum(rng.normal(0, 0.05, 60))
    measurement = 60 + np.cumsum(rng.normal(size=60))
    tuned = UnscentedActiveModel(model, 0.1, (0.5, 0.1), r, (4.0, 0.5), alpha, beta, kappa)

    def transition(x, dt, now, before):
        bend, _ = model.step(x[:1], np.empty((0, 1)), now, before)
        return np.array([bend[0] + dt * x[1], x[1]])

    points = MerweScaledSigmaPoints(2, alpha, beta, kappa)
    peer = UnscentedKalmanFilter(2, 1, 0.1, lambda x: x[:1], transition, points)
    peer.x, peer.P = np.array([60.0, 0.0]), np.diag(tuned.initial_variance)
    peer.Q, peer.R = np.diag(tuned.process_variance), np.array([[r]])
    belief = tuned.start(pull[:1], np.array([60.0]))
    for k in range(1, 60):
        belief = tuned.step(belief, pull[k : k + 1], pull[k - 1 : k], measurement[k : k + 1])
        peer.predict(now=pull[k], before=pull[k - 1])
        peer.update(measurement[k])
        np.testing.assert_allclose(belief.mean[:, 0], peer.x, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(belief.covariance[..., 0], peer.P, rtol=1e-6, atol=1e-8)


@given(mean=st.floats(-3, 3), variance=st.floats(0.01, 4))
def test_mean_and_variance_of_a_squared_angle_are_exact(mean, variance):
    """E x^2 = m^2 + v and var x^2 = 4 m^2 v + 2 v^2 for a normal x; a slope alone gives m^2 and 4 m^2 v."""
    tuned = UnscentedActiveModel(Square(), 0.1, (0.0, 0.0))
    P = np.diag([variance, 1.0])[..., None]
    rest = np.zeros(1)
    belief = tuned.predict(Belief(np.array([[mean], [0.0]]), P, np.empty((0, 1))), rest, rest)
    assert belief.mean[0, 0] == pytest.approx(mean**2 + variance)
    assert belief.covariance[0, 0, 0] == pytest.approx(4 * mean**2 * variance + 2 * variance**2 + 0.1**2)


def test_prediction_has_the_moments_of_many_random_states():
    """On Bouc and Wen's model, close to a reversal, where an extended filter has too narrow a belief."""
    P = matrix(6.0, 1.0, 0.5)
    mean = np.array([60.0, 2.0])
    pull, before = np.array([2.7]), np.array([3.0])
    rng = np.random.default_rng(0)
    bend, error = rng.multivariate_normal(mean, P, 400_000).T
    moved = BOUC_WEN.step(bend, np.empty((0, 1)), pull, before)[0] + 0.1 * error
    expected = np.array([moved.mean(), moved.var()])
    found = {}
    for kind in (UnscentedActiveModel, ActiveModel):
        tuned = kind(BOUC_WEN, 0.1, (0.0, 0.0))
        belief = tuned.predict(Belief(mean[:, None], P[..., None], np.empty((0, 1))), pull, before)
        found[kind] = np.array([belief.mean[0, 0], belief.covariance[0, 0, 0]])
    off = {kind: np.abs(values - expected) for kind, values in found.items()}
    assert (off[UnscentedActiveModel] < off[ActiveModel] / 2).all()


@pytest.mark.parametrize(("alpha", "kappa"), [(0.0, 1.0), (-1.0, 1.0), (1.0, -2.0), (np.nan, 1.0)])
def test_points_that_cannot_be_are_refused(alpha, kappa):
    with pytest.raises(ValueError, match="valid: alpha > 0, kappa > -2"):
        UnscentedActiveModel(BOUC_WEN, 0.1, alpha=alpha, kappa=kappa)
