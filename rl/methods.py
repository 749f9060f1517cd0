"""The methods of the tables, made from an identified model, trained policies and a trained LSTM."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from rl.agents import Agent, ReinforcementActiveModel
from rl.environment import Task, stack_records
from rl.lstm import Lstm
from rl.policy import Policy
from twin.estimation.active_model import ActiveModel, estimate_active_model
from twin.estimation.tuning import tune_active_model
from twin.evaluation import Case, Method

Array = NDArray[np.float64]
METHOD_NAMES = {"ram": "RAM", "direct": "Direct RL"}
_TUNING_DRAWS = 16  # training episodes, with their own noise, that a filter is tuned on


def coleman_hodgdon_method(active_model: ActiveModel) -> Method:
    """C-H: the model alone, from the wrong initial estimate; measurements do not touch it."""

    def estimate(case: Case) -> Array:
        return active_model.model.response(case.pull_mm, case.initial_bend_deg)

    return Method("C-H", estimate)


def active_model_method(active_model: ActiveModel, name: str = "AM") -> Method:
    """AM: the extended Kalman filter, told the variance of the noise as R."""

    def estimate(case: Case) -> Array:
        told = _told(active_model, case)
        return estimate_active_model(told, case.pull_mm, case.measurement_deg, case.initial_bend_deg)

    return Method(name, estimate)


def tuned_active_model_method(
    active_model: ActiveModel, records: Sequence[tuple[Array, Array]], seed: int
) -> Method:
    """AM-tuned: the same filter, Q and the first P by maximum likelihood on noisy training records."""
    record, measurement, initial, pull, _ = _training_draws(active_model, records, seed)
    tuned = tune_active_model(active_model, pull[record], measurement, initial)
    return active_model_method(tuned, "AM-tuned")


def constant_gain_method(
    active_model: ActiveModel, records: Sequence[tuple[Array, Array]], seed: int
) -> Method:
    """Constant gain: RAM whose policy is a constant, the one with the least RMSE on noisy training records.

    It has seen what RAM saw in training, the truth of the training records included.
    """
    record, measurement, initial, pull, bend = _training_draws(active_model, records, seed)
    truth = bend[record]

    def constant(action: Array) -> Callable[[Array], Array]:
        return lambda observation: np.broadcast_to(action, (len(observation), 2))

    def cost(action: Array) -> float:
        agent = ReinforcementActiveModel(active_model)
        estimate = _steer(agent, constant(action), pull[record], measurement, initial)
        return float(np.sqrt(np.mean((estimate - truth)[:, 1:] ** 2))) + 10 * float(
            np.maximum(np.abs(action) - 1, 0).sum()
        )

    options = {"xatol": 0.01, "fatol": 1e-4, "maxfev": 120}
    best = np.clip(minimize(cost, np.zeros(2), method="Nelder-Mead", options=options).x, -1, 1)

    def estimate(case: Case) -> Array:
        agent = ReinforcementActiveModel(_told(active_model, case))
        return _steer(agent, constant(best), case.pull_mm, case.measurement_deg, case.initial_bend_deg)

    return Method("Constant gain", estimate)


def policy_method(policy: Policy, active_model: ActiveModel) -> Method:
    """RAM or direct RL: a trained policy; the filter inside RAM is told the variance of the noise as R."""

    def estimate(case: Case) -> Array:
        agent = policy.agent(_told(active_model, case))
        return _steer(agent, policy, case.pull_mm, case.measurement_deg, case.initial_bend_deg)

    return Method(METHOD_NAMES[policy.agent_name], estimate)


def oracle_method(policy: Policy, active_model: ActiveModel) -> Method:
    """RAM with phi from the clean truth, as the paper's text reads: an oracle, which no robot can have."""

    def estimate(case: Case) -> Array:
        if case.truth_deg is None:
            raise ValueError("an oracle needs the truth")
        agent = policy.agent(_told(active_model, case))
        return _steer(
            agent, policy, case.pull_mm, case.measurement_deg, case.initial_bend_deg, case.truth_deg
        )

    return Method(f"{METHOD_NAMES[policy.agent_name]} (oracle)", estimate, oracle=True)


def lstm_method(network: Lstm) -> Method:
    """LSTM: the recurrent network; it takes no initial estimate."""
    return Method("LSTM", lambda case: network.estimate(case.pull_mm, case.measurement_deg))


def _told(active_model: ActiveModel, case: Case) -> ActiveModel:
    return dataclasses.replace(active_model, measurement_variance=case.noise_variance)


def _training_draws(
    active_model: ActiveModel, records: Sequence[tuple[Array, Array]], seed: int
) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
    pull, bend = stack_records(records)
    task = Task(pull, bend, noise_level=active_model.measurement_variance)
    return *task.draw(_TUNING_DRAWS, np.random.default_rng([seed, 1])), pull, bend


def _steer(
    agent: Agent,
    policy: Callable[[Array], Array],
    pull_mm: Array,
    measurement_deg: Array,
    initial_bend_deg: Array,
    reference_deg: Array | None = None,
) -> Array:
    """Run B agents along (N,) or (B, N) commands; returns (B, N) estimates [deg]."""
    estimate = np.empty_like(measurement_deg)
    estimate[:, 0] = initial_bend_deg
    agent.reset(initial_bend_deg)
    for k in range(1, measurement_deg.shape[1]):
        reference = None if reference_deg is None else reference_deg[k]
        observation = agent.observe(pull_mm[..., k], pull_mm[..., k - 1], measurement_deg[:, k], reference)
        estimate[:, k] = agent.act(policy(observation))
    return estimate
