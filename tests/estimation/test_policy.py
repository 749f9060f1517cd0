"""Policies as estimators: what a network does to the active model, here one that always says the same."""

import numpy as np
import pytest

from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import Case
from twin.estimation.learned.direct import DirectEstimator
from twin.estimation.learned.policy import OracleRun, PolicyEstimator
from twin.estimation.learned.ram import ReinforcementActiveModel
from twin.estimation.tuning import ConstantGain
from twin.evaluation.method import as_method
from twin.live.online import OnlineEstimator

SEEDS = 8


AGENTS = {"ram": ReinforcementActiveModel, "direct": DirectEstimator}


def steered(action, active_model, agent="ram"):
    """An estimator whose policy says one action, whatever it sees."""

    def policy(sensed):
        said = np.tile(np.float32(action), (len(sensed), 1)).astype(float)
        return AGENTS[agent].amounts(said)

    return PolicyEstimator(policy, active_model, AGENTS[agent])


@pytest.fixture
def active_model(model):
    return ActiveModel(model, 0.1)


@pytest.fixture
def case(records):
    pull, bend = records[0]
    noise = np.random.default_rng(0).standard_normal((SEEDS, len(bend)))
    pulls = np.tile(pull, (SEEDS, 1))
    return Case(pulls, bend + noise, np.full(SEEDS, bend[0] + 20), Sensor(np.full(SEEDS, 1.0)))


def test_filters_are_told_the_variance_of_the_noise(active_model, case):
    told = active_model.with_sensor(case.sensor)
    expected = told.estimate(case.pull_mm, case.measurement_deg, case.initial_bend_deg)
    np.testing.assert_array_equal(as_method("AM", active_model).estimate(case), expected)


def test_policy_that_adds_nothing_is_the_active_model(active_model, case):
    np.testing.assert_array_equal(
        as_method("RAM", steered([-1.0, -1.0], active_model)).estimate(case),
        as_method("AM", active_model).estimate(case),
    )


def test_policy_of_one_action_is_the_constant_gain(active_model, case):
    gained = ConstantGain(active_model.model, 0.1, gain=(0.25, 0.75))
    np.testing.assert_allclose(
        as_method("RAM", steered([-0.5, 0.5], active_model)).estimate(case),
        as_method("Constant gain", gained).estimate(case),
        rtol=1e-12,
    )


def test_oracle_with_full_gain_is_the_truth_and_needs_it(active_model, case, records):
    oracle = OracleRun(steered([1.0, -1.0], active_model))
    with pytest.raises(ValueError, match="needs the truth"):
        oracle(case)
    truth = np.tile(records[0][1], (SEEDS, 1))
    shown = Case(case.pull_mm, case.measurement_deg, case.initial_bend_deg, case.sensor, truth_deg=truth)
    np.testing.assert_allclose(oracle(shown)[:, 1:], truth[:, 1:], atol=1e-9)


@pytest.mark.parametrize("agent", ["ram", "direct"])
def test_a_stream_gives_what_the_batch_gives(active_model, case, agent):
    action = [0.2, -0.4] if agent == "ram" else [0.1]
    estimator = steered(action, active_model, agent)
    measurement = case.measurement_deg[0].copy()
    measurement[[5, 6, 90]] = np.nan
    batch = estimator.estimate(case.pull_mm[0], measurement, case.initial_bend_deg[0])[0]
    live = OnlineEstimator(estimator, 0.1, case.initial_bend_deg[0])
    stream = [live.push(0.1 * k, case.pull_mm[0, k], measurement[k]) for k in range(len(measurement))]
    np.testing.assert_array_equal(stream, batch)
    assert np.isfinite(batch).all()


def test_a_step_leaves_the_state_that_it_was_given(active_model):
    estimator = steered([0.5, 0.5], active_model)
    pull = np.full(3, 3.0)
    first = estimator.start(pull, np.array([50.0, 60.0, 70.0]))
    estimator.step(first, pull + 0.1, pull, np.full(3, 55.0))
    np.testing.assert_array_equal(estimator.bend_deg(first), [50.0, 60.0, 70.0])
