import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.estimation.active_model import ActiveModel
from twin.estimation.learned.direct import DirectEstimator
from twin.estimation.learned.ram import ReinforcementActiveModel
from twin.estimation.learned.scale import from_log_scale, to_log_scale


@pytest.fixture
def active_model(model):
    return ActiveModel(model, sample_time=0.1)


def run(agent, pull, measurement, initial, action):
    pulls = np.tile(pull, (len(measurement), 1))
    agent.reset(pulls[:, 0], initial)
    estimates = [np.array(initial, dtype=float)]
    for k in range(1, measurement.shape[1]):
        agent.observe(pulls[:, k], pulls[:, k - 1], measurement[:, k])
        estimates.append(agent.act(np.broadcast_to(action, (len(measurement), len(action)))))
    return np.stack(estimates, axis=1)


@pytest.fixture
def noisy(records):
    pull, bend = records[0]
    return pull, bend + np.random.default_rng(0).standard_normal((4, len(bend)))


def test_ram_without_a_second_gain_is_the_active_model(active_model, noisy):
    pull, measurement = noisy
    initial = measurement[:, 0] + 20
    ram = run(ReinforcementActiveModel(active_model), pull, measurement, initial, [-1.0, -1.0])
    np.testing.assert_array_equal(ram, active_model.estimate(pull, measurement, initial))


def test_ram_with_full_gain_is_the_measurement(active_model, noisy):
    pull, measurement = noisy
    ram = run(ReinforcementActiveModel(active_model), pull, measurement, measurement[:, 0] + 20, [1.0, -1.0])
    np.testing.assert_allclose(ram[:, 1:], measurement[:, 1:], atol=1e-9)


def test_every_ram_update_lies_between_the_active_model_and_the_measurement(active_model, noisy):
    pull, measurement = noisy
    agent = ReinforcementActiveModel(active_model)
    agent.reset(pull[:1], measurement[:, 0] + 20)
    rng = np.random.default_rng(1)
    for k in range(1, 50):
        agent.observe(pull[k], pull[k - 1], measurement[:, k])
        before = agent.belief.mean[0].copy()
        after = agent.act(rng.uniform(-3, 3, (4, 2)))  # actions beyond the bounds are clipped
        low, high = np.minimum(before, measurement[:, k]), np.maximum(before, measurement[:, k])
        assert (low - 1e-9 <= after).all()
        assert (after <= high + 1e-9).all()


def test_second_update_feeds_the_next_prediction(active_model, noisy):
    pull, measurement = noisy
    agent = ReinforcementActiveModel(active_model)
    agent.reset(pull[:1], measurement[:, 0])
    agent.observe(pull[1], pull[0], measurement[:, 1])
    agent.act(np.full((4, 2), 1.0))
    theta, error = agent.belief.mean
    agent.observe(pull[2], pull[1], measurement[:, 2])
    predicted = active_model.model.step(theta, agent.belief.memory, pull[2], pull[1])[0] + 0.1 * error
    gain = (agent.belief.mean[0] - predicted) / (measurement[:, 2] - predicted)
    assert np.ptp(gain) < 1e-9  # one Kalman gain explains all four
    assert 0 < gain[0] < 1


def test_phi_is_seen_in_units_of_the_noise_that_the_filter_is_told(active_model, noisy):
    pull, measurement = noisy
    seen = []
    for variance in (0.1, 10.0):
        agent = ReinforcementActiveModel(dataclasses.replace(active_model, measurement_variance=variance))
        agent.reset(pull[:1], measurement[:, 0] + 20)
        observation = agent.observe(pull[1], pull[0], measurement[:, 1])
        np.testing.assert_allclose(from_log_scale(observation[:, 0]) * np.sqrt(variance), agent.residual)
        seen.append(np.abs(observation).mean())
    assert seen[0] > seen[1]


def test_oracle_replaces_the_measurement_in_phi_alone(active_model, noisy):
    pull, measurement = noisy
    plain, oracle = ReinforcementActiveModel(active_model), ReinforcementActiveModel(active_model)
    for agent, truth in ((plain, None), (oracle, 55.0)):
        agent.reset(pull[:1], measurement[:, 0])
        agent.sense(pull[1], pull[0], measurement[:, 1], truth)
    np.testing.assert_array_equal(plain.belief.mean, oracle.belief.mean)
    np.testing.assert_allclose(oracle.residual, 55.0 - oracle.belief.mean[0])


def test_direct_estimator_can_follow_the_measurement_exactly():
    agent = DirectEstimator()
    agent.reset(np.ones(2), np.array([0.0, 10.0]))
    observation = agent.observe(np.ones(2), np.full(2, 0.9), np.array([20.0, -5.0]))
    np.testing.assert_allclose(observation[:, 1], 1.0)  # 0.1 mm
    estimate = agent.act(observation[:, :1] / np.log1p(25.0))
    np.testing.assert_allclose(estimate, [20.0, -5.0])


def test_direct_estimator_moves_no_further_than_its_limit():
    agent = DirectEstimator()
    agent.reset(np.zeros(1), np.zeros(1))
    agent.observe(np.zeros(1), np.zeros(1), np.array([100.0]))
    np.testing.assert_allclose(agent.act(np.array([[9.0]])), [25.0])


@given(st.floats(-1e4, 1e4))
def test_log_scale_is_inverted_and_odd(angle):
    value = to_log_scale(np.array(angle))
    np.testing.assert_allclose(from_log_scale(value), angle, rtol=1e-9, atol=1e-12)
    assert to_log_scale(np.array(-angle)) == -value


@pytest.mark.parametrize("kind", [ReinforcementActiveModel, DirectEstimator])
def test_without_a_measurement_nothing_is_corrected(active_model, kind):
    agent, pull = kind(active_model), np.full(2, 3.0)
    agent.reset(pull, np.array([50.0, 60.0]))
    observation = agent.observe(pull, pull, np.array([np.nan, 55.0]))
    assert observation[0, 0] == 0
    assert observation[1, 0] != 0
    estimate = agent.act(np.zeros((2, len(agent.applied))))
    assert estimate[0] == 50.0
    assert np.isfinite(estimate).all()
