"""Trained policies as estimators, and as the methods of the tables."""

import copy
import dataclasses
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rl.agents import Agent
from rl.policy import Policy
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.evaluation.case import Case
from twin.evaluation.method import Method, as_method

Array = NDArray[np.float64]
METHOD_NAMES = {"ram": "RAM", "direct": "Direct RL"}


@dataclasses.dataclass(frozen=True)
class PolicyEstimator(Estimator[Agent]):
    """RAM or direct RL: a trained policy steers an agent; the filter inside RAM is told R."""

    policy: Policy
    active_model: ActiveModel

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the estimator whose filter takes the sensor's variance as R."""
        return dataclasses.replace(self, active_model=self.active_model.with_sensor(sensor))

    def start(self, pull_mm: Array, bend_deg: Array) -> Agent:
        """Return an agent at the initial estimates."""
        agent = self.policy.agent(self.active_model)
        agent.reset(pull_mm, bend_deg)
        return agent

    def step(
        self,
        state: Agent,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        oracle_deg: Array | None = None,
    ) -> Agent:
        """Observe one sample and act; `oracle_deg` as in `Agent.observe`."""
        agent = copy.copy(state)  # an agent replaces its arrays and never writes into them
        observation = agent.observe(pull_mm, previous_pull_mm, measurement_deg, oracle_deg)
        agent.act(self.policy(observation))
        return agent

    def bend_deg(self, state: Agent) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg


@dataclasses.dataclass(frozen=True)
class _Oracle:
    estimator: PolicyEstimator

    def __call__(self, case: Case) -> Array:
        if case.truth_deg is None:
            raise ValueError("an oracle needs the truth")
        told = self.estimator.with_sensor(case.sensor)
        pull, measurement, initial = time_first(case.pull_mm, case.measurement_deg, case.initial_bend_deg)
        estimate = np.empty_like(measurement)
        estimate[0] = initial
        state = told.start(pull[0], initial)
        for k in range(1, len(measurement)):
            state = told.step(state, pull[k], pull[k - 1], measurement[k], case.truth_deg[:, k])
            estimate[k] = state.bend_deg
        return estimate.T


def policy_method(policy: Policy, active_model: ActiveModel) -> Method:
    """RAM or direct RL under its name in the tables."""
    return as_method(METHOD_NAMES[policy.agent_name], PolicyEstimator(policy, active_model))


def oracle_method(policy: Policy, active_model: ActiveModel) -> Method:
    """RAM with phi from the clean truth, as the paper's text reads: an oracle, which no robot can have."""
    name = f"{METHOD_NAMES[policy.agent_name]} (oracle)"
    return Method(name, _Oracle(PolicyEstimator(policy, active_model)), oracle=True)
