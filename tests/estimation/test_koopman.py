"""The Koopman filter: the fit on Coleman and Hodgdon's own data, the filter against filterpy."""

import dataclasses
import itertools

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.estimation.estimator import Sensor
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


@pytest.mark.parametrize(("delays", "symmetric"), [(0, True), (1, True), (2, True), (0, False), (2, False)])
def test_fit_recovers_coleman_and_hodgdons_coefficients_from_their_own_data(delays, symmetric):
    found = fit_koopman(own_records(), delays, ridge=0.0, symmetric=symmetric)
    gates, drives = np.zeros_like(found.gates), np.zeros_like(found.drives)
    gates[0, 0], gates[1, 0] = 1, -A
    drives[0, 0], drives[1, 0] = C, A * B
    np.testing.assert_allclose(found.gates, gates, atol=1e-6)
    np.testing.assert_allclose(found.drives, drives, atol=1e-5)
    assert found.process_variance < 1e-18
    assert (found.delays, found.symmetric) == (delays, symmetric)


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


def test_fit_agrees_with_the_normal_equations_of_a_penalised_regression():
    rng = np.random.default_rng(5)
    records = [(pull, bend + 0.1 * rng.normal(size=bend.shape)) for pull, bend in own_records()]
    rows = [
        (abs(n - b) * y, n - b, abs(n - b) * n, z - y)
        for pull, bend in records
        for (b, n), (y, z) in zip(itertools.pairwise(pull), itertools.pairwise(bend), strict=True)
    ]
    X, y = np.array(rows)[:, :3], np.array(rows)[:, 3]
    penalty = 0.01 * len(X) * np.diag(np.mean(X**2, axis=0))
    minus_a, c, ab = np.linalg.solve(X.T @ X + penalty, X.T @ y)
    found = fit_koopman(records, delays=0, ridge=0.01)
    np.testing.assert_allclose(found.gates[:, 0], [1, minus_a], rtol=1e-8)
    np.testing.assert_allclose(found.drives[:, 0], [c, ab], rtol=1e-8)
    assert found.process_variance == pytest.approx(np.mean((y - X @ [minus_a, c, ab]) ** 2))


def lifted_system(filter_: KoopmanFilter, pulls: list[float]) -> tuple[np.ndarray, float]:
    """F and the drive of the newest angle, from pulls newest first, by writing the equation out by hand."""
    size = filter_.delays + 1
    move = pulls[0] - pulls[1]
    F = np.eye(size, k=-1)
    F[0] = sum(gate * row for gate, row in zip((1, abs(move), move), filter_.gates, strict=False))
    drive = 0.0
    for i in range(size):
        moved = pulls[i] - pulls[i + 1]
        features = (moved, abs(moved) * pulls[i], abs(moved), moved * pulls[i])
        drive += sum(h * feature for h, feature in zip(filter_.drives[:, i], features, strict=False))
    return F, drive


@settings(max_examples=15)
@given(
    delays=st.integers(0, 3),
    symmetric=st.booleans(),
    variances=st.tuples(*[st.floats(1e-3, 1e2)] * 3),
    seed=st.integers(0, 99),
)
def test_filter_equals_filterpy_on_the_same_matrices(delays, symmetric, variances, seed):
    rng = np.random.default_rng(seed)
    gates = 0.3 * rng.normal(size=(2 if symmetric else 3, delays + 1))
    drives = rng.normal(size=(2 if symmetric else 4, delays + 1))
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


def test_response_is_what_the_filter_predicts_without_measurements():
    filter_ = fit_koopman([delayed_record(seed) for seed in range(2)], delays=2)
    pulls = np.stack([delayed_record(seed)[0] for seed in (7, 8)])
    blind = filter_.estimate(pulls, np.full(pulls.shape, np.nan), [50.0, 60.0])
    np.testing.assert_allclose(filter_.response(pulls, [50.0, 60.0]), blind, rtol=1e-12)


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("centre", [-3.0, 0.0, 20.0])
def test_prediction_forgets_its_first_angle_about_any_pull(symmetric, centre):
    filter_ = fit_koopman([delayed_record(seed) for seed in range(3)], symmetric=symmetric)
    pull = np.tile(command(np.random.default_rng(9), centre), 20)
    far, near = filter_.response(np.stack([pull, pull]), [1000.0, 0.0])
    assert abs(far[-1] - near[-1]) < 1e-3
    assert np.abs(far[len(TIME) :]).max() < 3000


def test_symmetric_model_bends_the_other_way_along_the_mirrored_command():
    pull, bend = delayed_record(3)
    filter_ = fit_koopman([(pull, bend)], delays=1)
    np.testing.assert_allclose(filter_.response(-pull, -60.0), -filter_.response(pull, 60.0), rtol=1e-12)


def test_model_that_does_not_forget_is_refused():
    pull, _ = delayed_record(3)
    away = [60.0]
    for before, now in itertools.pairwise(pull):  # runs away from b l
        away.append(away[-1] + 0.2 * abs(now - before) * (away[-1] - 60) + now - before)
    with pytest.raises(ValueError, match="forgets"):
        fit_koopman([(pull, np.array(away))])


def test_missing_measurement_is_prediction_alone_and_batch_equals_single_filters():
    filter_ = fit_koopman([delayed_record(seed) for seed in range(2)], delays=2).with_sensor(Sensor(0.5))
    assert filter_.measurement_variance == 0.5
    pull, bend = delayed_record(7)
    measurement = bend + np.random.default_rng(0).normal(size=(3, len(bend)))
    measurement[1, 100:150] = np.nan
    batch = filter_.estimate(pull, measurement, [50.0, 60.0, 70.0])
    for row, initial in enumerate([50.0, 60.0, 70.0]):
        np.testing.assert_allclose(
            batch[row], filter_.estimate(pull, measurement[row], initial)[0], rtol=1e-11
        )
    state = filter_.start(np.full(2, 3.0), np.array([60.0, 60.0]))
    after = filter_.step(state, np.full(2, 3.1), np.full(2, 3.0), np.array([np.nan, 65.0]))
    predicted = filter_.predict(state, np.full(2, 3.1), np.full(2, 3.0))
    np.testing.assert_array_equal(after.mean[:, 0], predicted.mean[:, 0])
    np.testing.assert_array_equal(after.covariance[..., 0], predicted.covariance[..., 0])
    assert after.mean[0, 1] > predicted.mean[0, 1] + 1


def test_covariance_stays_symmetric_and_positive():
    filter_ = fit_koopman([delayed_record(seed) for seed in range(2)], delays=2)
    filter_ = dataclasses.replace(filter_, process_variance=1e-9, initial_variance=1e6)
    pull, bend = delayed_record(7)
    state = filter_.start(pull[:1], bend[:1])
    for k in range(1, len(pull)):
        state = filter_.step(state, pull[k : k + 1], pull[k - 1 : k], bend[k : k + 1])
        covariance = state.covariance[..., 0]
        np.testing.assert_array_equal(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > -1e-12 * np.trace(covariance) - 1e-15
