"""The Kalman family on models that are affine in the angle: one filter, written in three ways."""

import dataclasses
import functools
import itertools

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.active_model import ActiveModel, KalmanActiveModel, UnscentedActiveModel
from twin.estimation.adaptive import RobustActiveModel
from twin.estimation.tuning import ConstantGain
from twin.hysteresis import ColemanHodgdon
from twin.hysteresis.bouc_wen import BoucWen
from twin.hysteresis.prandtl_ishlinskii import PrandtlIshlinskii

FAMILY = [KalmanActiveModel, ActiveModel, UnscentedActiveModel]
# Filters that do more, with what they do more turned off: these are linear too.
LINEAR = [
    functools.partial(RobustActiveModel, threshold=np.inf),
    functools.partial(ConstantGain, gain=(0.0, 0.0)),
]
variances = st.floats(1e-6, 1e3)
parameters = st.tuples(st.floats(0.05, 3), st.floats(1, 40), st.floats(-10, 20))


def command(rng: np.random.Generator, samples: int) -> np.ndarray:
    """A random walk with rests, as rough as a|dl| = 1 and smoother [mm]."""
    moves = rng.normal(0, rng.choice([0.01, 0.1, 0.3]), samples) * (rng.random(samples) < 0.8)
    return 3 + np.cumsum(np.clip(moves, -0.33, 0.33))


def run(active_model: ActiveModel, pull: np.ndarray, measurement: np.ndarray, initial: float):
    """Means (N, 2) and covariances (N, 2, 2) of one filter."""
    belief = active_model.start(pull[:1], np.array([initial]))
    beliefs = [belief]
    for k in range(1, len(pull)):
        belief = active_model.step(belief, pull[k : k + 1], pull[k - 1 : k], measurement[k : k + 1])
        beliefs.append(belief)
    return np.array([b.mean[:, 0] for b in beliefs]), np.array([b.covariance[..., 0] for b in beliefs])


def filterpy_run(active_model: ActiveModel, pull: np.ndarray, measurement: np.ndarray, initial: float):
    """The same by filterpy, with F and u of eq. 4 written out by hand."""
    a, b, c = dataclasses.astuple(active_model.model)
    peer = KalmanFilter(dim_x=2, dim_z=1, dim_u=2)
    peer.x, peer.P = np.array([initial, 0.0]), np.diag(active_model.initial_variance)
    peer.Q, peer.H = np.diag(active_model.process_variance), np.array([[1.0, 0.0]])
    peer.R = np.array([[active_model.measurement_variance]])
    means, covariance = [peer.x], [peer.P]
    for k in range(1, len(pull)):
        move = pull[k] - pull[k - 1]
        F = np.array([[1 - a * abs(move), active_model.sample_time], [0.0, 1.0]])
        peer.predict(u=np.array([a * abs(move) * b * pull[k] + c * move, 0.0]), B=np.eye(2), F=F)
        if not np.isnan(measurement[k]):
            peer.update(measurement[k])
        means.append(peer.x)
        covariance.append(peer.P)
    return np.array(means), np.array(covariance)


@pytest.mark.parametrize("filter_type", [*FAMILY, *LINEAR])
@settings(max_examples=40)
@given(
    parameters=parameters,
    T=st.floats(0.005, 0.5),
    q=st.tuples(variances, variances),
    r=variances,
    p=st.tuples(variances, variances),
    seed=st.integers(0, 10_000),
)
def test_filter_equals_filterpy_on_random_systems(filter_type, parameters, T, q, r, p, seed):
    rng = np.random.default_rng(seed)
    pull = command(rng, 80)
    model = ColemanHodgdon(*parameters)
    measurement = model.response(pull, 60.0) + rng.normal(size=80) * np.sqrt(r)
    measurement[rng.random(80) < 0.1] = np.nan
    tuned = filter_type(model, T, q, r, p)
    means, covariance = run(tuned, pull, measurement, 50.0)
    expected_means, expected = filterpy_run(tuned, pull, measurement, 50.0)
    scale = max(np.abs(expected_means).max(), 1)
    np.testing.assert_allclose(means, expected_means, rtol=1e-7, atol=1e-9 * scale)
    np.testing.assert_allclose(covariance, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("kind", [ActiveModel, UnscentedActiveModel])
def test_a_model_with_memory_is_filtered_alike(kind):
    """Plays remember the command; the angle is moved by their increments, which is affine."""
    model = PrandtlIshlinskii([2.0, 5.0, 9.0], [0.0, 0.2, 0.6])
    rng = np.random.default_rng(0)
    pull = command(rng, 200)
    measurement = model.response(pull, 20.0) + rng.normal(size=200)
    plain, P = run(KalmanActiveModel(model, 0.1), pull, measurement, 30.0)
    means, covariance = run(kind(model, 0.1), pull, measurement, 30.0)
    np.testing.assert_allclose(means, plain, atol=1e-10)
    np.testing.assert_allclose(covariance, P, atol=1e-12)


def test_filters_of_a_batch_may_have_models_of_their_own():
    a, b, c = np.array([0.5, 1.0, 2.0]), np.array([10.0, 20.0, 30.0]), np.array([4.0, 5.0, 6.0])
    pull = command(np.random.default_rng(1), 50)
    measurement = 60 + np.random.default_rng(2).normal(size=(3, 50))
    for kind in FAMILY:
        batch = kind(ColemanHodgdon(a, b, c), 0.1).estimate(pull, measurement, 60.0)
        for row in range(3):
            one = kind(ColemanHodgdon(a[row], b[row], c[row]), 0.1).estimate(pull, measurement[row], 60.0)
            np.testing.assert_allclose(batch[row], one[0], rtol=1e-12)


def test_a_model_that_is_not_affine_is_refused():
    with pytest.raises(ValueError, match=r"'bouc-wen' is not affine.*EKF.*UKF"):
        KalmanActiveModel(BoucWen(22.0, -15.0, 1.2, 1.5, 2.0), 0.1)


@pytest.mark.parametrize("filter_type", [KalmanActiveModel, UnscentedActiveModel])
def test_covariances_stay_valid_over_thousands_of_samples_at_extreme_scales(filter_type):
    # Q, R and P may be scaled by one factor without changing the gain: at one Q, R and P span all ratios.
    variance, initial = np.array(list(itertools.product((1e-12, 1.0, 1e12), (1e-12, 1e12)))).T
    active_model = filter_type(ColemanHodgdon(1.15, 22.38, 5.0), 0.1, measurement_variance=variance)
    phase = 2 * np.pi * np.arange(1000) / 1000
    pull = 3 + np.sin(phase) + 0.3 * np.sin(7 * phase)
    pull[300:400] = pull[300]  # the command rests
    pulls = np.repeat(pull[:, None], len(variance), axis=1)
    measurements = 60 + np.random.default_rng(0).standard_normal(pulls.shape)
    belief = active_model.start(pulls[0], np.full(len(variance), 60.0))
    belief = belief._replace(covariance=np.eye(2)[:, :, None] * initial)
    for k in range(1, 20_001):
        belief = active_model.step(belief, pulls[k % 1000], pulls[(k - 1) % 1000], measurements[k % 1000])
        (place, across), (other, rate) = belief.covariance
        assert (across == other).all()
        assert (place > 0).all()
        assert (1 - across / place * across / rate > 1e-9).all()
