import numpy as np
import pytest

from rl.methods import (
    active_model_method,
    coleman_hodgdon_method,
    constant_gain_method,
    oracle_method,
    policy_method,
    tuned_active_model_method,
)
from rl.policy import Policy
from twin.estimation.active_model import ActiveModel, estimate_active_model
from twin.evaluation import Case

SEEDS = 8


class FixedSession:
    """Stands for a trained network: one action whatever is seen."""

    def __init__(self, action):
        self.action = action

    def run(self, _, feed):
        return [np.tile(np.float32(self.action), (len(feed["observation"]), 1))]


@pytest.fixture
def active_model(model):
    return ActiveModel(model, 0.1)


@pytest.fixture
def case(records):
    pull, bend = records[0]
    noise = np.random.default_rng(0).standard_normal((SEEDS, len(bend)))
    return Case(pull, bend + noise, np.full(SEEDS, bend[0] + 20), noise_variance=1.0)


def rmse(estimate, truth):
    return np.sqrt(((estimate - truth)[:, 1:] ** 2).mean())


def test_coleman_hodgdon_ignores_the_measurements(active_model, case, model):
    estimate = coleman_hodgdon_method(active_model).estimate(case)
    np.testing.assert_array_equal(
        estimate, np.tile(model.response(case.pull_mm, case.initial_bend_deg[0]), (SEEDS, 1))
    )


def test_filters_are_told_the_variance_of_the_noise(active_model, case, model):
    told = ActiveModel(model, 0.1, measurement_variance=1.0)
    expected = estimate_active_model(told, case.pull_mm, case.measurement_deg, case.initial_bend_deg)
    np.testing.assert_array_equal(active_model_method(active_model).estimate(case), expected)


def test_policy_that_adds_nothing_is_the_active_model(active_model, case):
    policy = Policy(FixedSession([-1.0, -1.0]), "ram", {})
    np.testing.assert_array_equal(
        policy_method(policy, active_model).estimate(case), active_model_method(active_model).estimate(case)
    )


def test_oracle_with_full_gain_is_the_truth_and_needs_it(active_model, case, records):
    method = oracle_method(Policy(FixedSession([1.0, -1.0]), "ram", {}), active_model)
    assert method.oracle
    with pytest.raises(ValueError, match="needs the truth"):
        method.estimate(case)
    pull, bend = records[0]
    shown = Case(pull, case.measurement_deg, case.initial_bend_deg, 1.0, truth_deg=bend)
    np.testing.assert_allclose(method.estimate(shown)[:, 1:], np.tile(bend[1:], (SEEDS, 1)), atol=1e-9)


def test_yardsticks_beat_the_untuned_filter_and_tuning_sees_no_test_data(active_model, case, records):
    truth = records[0][1]
    plain = rmse(active_model_method(active_model).estimate(case), truth)
    for make in (tuned_active_model_method, constant_gain_method):
        first, second = (make(active_model, records[1:], seed=3).estimate(case) for _ in range(2))
        np.testing.assert_array_equal(first, second)
        assert rmse(first, truth) < 0.5 * plain
