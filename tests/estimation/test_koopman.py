"""The Koopman filter: the fit on Coleman and Hodgdon's own data, the filter against filterpy."""

import itertools

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.koopman import KoopmanFilter, fit_koopman
from twin.hysteresis import ColemanHodgdon

A, B, C = 1.15, 22.38, 5.0
MODEL = ColemanHodgdon(A, B, C)
TIME = np.arange(400) * 0.1


def command(rng: np.random.Generator, centre: float = 3.0) -> np.ndarray:
    """Four sines of random periods: movements of every size."""
    period, phase = rng.uniform(2, 15, (4, 1)), rng.uniform(0, 2 * np.pi, (4, 1))
    return centre + 0.4 * np.sin(2 * np.pi * TIME / period + phase).sum(axis=0)


def own_records(count: int = 3, seed: int = 0) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    pulls = [command(rng) for _ in range(count)]
    return [(pull, MODEL.response(pull, 55.0 + 3 * k)) for k, pull in enumerate(pulls)]


def delayed_record(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A record that Coleman and Hodgdon's model does not hold: 60 % of the last increment comes again."""
    pull = command(np.random.default_rng(seed))
    bend = [60.0, 60.0]
    for k in range(2, len(pull)):
        move = pull[k] - pull[k - 1]
        drive = 0.4 * (A * abs(move) * (B * pull[k] - bend[-1]) + C * move)
        bend.append(bend[-1] + drive + 0.6 * (bend[-1] - bend[-2]))
    return pull, np.array(bend)


@pytest.mark.parametrize("delays", [0, 1, 2])
def test_fit_recovers_coleman_and_hodgdons_coefficients_from_their_own_data(delays):
    found = fit_koopman(own_records(), delays, ridge=0.0)
    gates, drives = np.zeros_like(found.gates), np.zeros_like(found.drives)
    gates[0, 0], gates[1, 0] = 1, -A
    drives[0, 0], drives[1, 0] = C, A * B
    np.testing.assert_allclose(found.gates, gates, atol=1e-6)
    np.testing.assert_allclose(found.drives, drives, atol=1e-5)
    assert found.process_variance < 1e-18
    assert found.delays == delays


def test_fit_recovers_a_model_with_delays_and_finds_that_it_needs_them():
    records = [delayed_record(seed) for seed in range(3)]
    found = fit_koopman(records, delays=1, ridge=0.0)
    np.testing.assert_allclose(found.gates, [[1.6, -0.6], [-0.4 * A, 0]], atol=1e-6)
    np.testing.assert_allclose(found.drives, [[0.4 * C, 0], [0.4 * A * B, 0]], atol=1e-5)
    chosen = fit_koopman(records)
    assert chosen.delays >= 1
    pull, bend = delayed_record(99)
    assert np.abs(chosen.response(pull, 60.0)[0] - bend).max() < 0.5
    assert np.abs(fit_koopman(records, delays=0).response(pull, 60.0)[0] - bend).max() > 0.5


def lifted_system(filter_: KoopmanFilter, pulls: list[float]) -> tuple[np.ndarray, float]:
    """F and the drive of the newest angle, from pulls newest first, by writing the equation out by hand."""
    size = filter_.delays + 1
    move = pulls[0] - pulls[1]
    F = np.eye(size, k=-1)
    F[0] = filter_.gates[0] + abs(move) * filter_.gates[1]
    drive = 0.0
    for i in range(size):
        moved = pulls[i] - pulls[i + 1]
        drive += filter_.drives[0, i] * moved + filter_.drives[1, i] * abs(moved) * pulls[i]
    return F, drive


@settings(max_examples=15)
@given(delays=st.integers(0, 3), variances=st.tuples(*[st.floats(1e-3, 1e2)] * 3), seed=st.integers(0, 99))
def test_filter_equals_filterpy_on_the_same_matrices(delays, variances, seed):
    rng = np.random.default_rng(seed)
    gates, drives = 0.3 * rng.normal(size=(2, delays + 1)), rng.normal(size=(2, delays + 1))
    filter_ = KoopmanFilter(gates, drives, *variances)
    pull = command(rng)[:120]
    measurement = 10 * rng.normal(size=120)
    size = delays + 1
    peer = KalmanFilter(dim_x=size, dim_z=1, dim_u=size)
    peer.x, peer.P = np.full(size, 7.0), np.full((size, size), variances[2])
    peer.Q, peer.H = np.diag([variances[0], *[0.0] * delays]), np.eye(size)[:1]
    peer.R = np.array([[variances[1]]])
    expected = [7.0]
    for k in range(1, 120):
        F, drive = lifted_system(filter_, [pull[max(k - i, 0)] for i in range(delays + 2)])
        peer.predict(u=np.array([drive, *[0.0] * delays]), B=np.eye(size), F=F)
        peer.update(measurement[k])
        expected.append(peer.x[0])
    np.testing.assert_allclose(filter_.estimate(pull, measurement, 7.0)[0], expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("centre", [-3.0, 0.0, 20.0])
def test_prediction_forgets_its_first_angle_about_any_pull(centre):
    filter_ = fit_koopman([delayed_record(seed) for seed in range(3)])
    pull = np.tile(command(np.random.default_rng(9), centre), 20)
    far, near = filter_.response(np.stack([pull, pull]), [1000.0, 0.0])
    assert abs(far[-1] - near[-1]) < 1e-3
    assert np.abs(far[len(TIME) :]).max() < 3000


def test_model_that_does_not_forget_is_refused():
    pull, _ = delayed_record(3)
    away = [60.0]
    for before, now in itertools.pairwise(pull):  # runs away from b l
        away.append(away[-1] + 0.2 * abs(now - before) * (away[-1] - 60) + now - before)
    with pytest.raises(ValueError, match="forgets"):
        fit_koopman([(pull, np.array(away))])
