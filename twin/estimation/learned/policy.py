"""A policy that steers an agent: reinforcement learning as an estimator, run by ONNX Runtime.

An agent is a batch of B running estimators. Training, evaluation and the online form all drive the same two
calls per sample: `observe` takes the command and the measurement and returns what the policy sees, `act`
takes what the policy says and returns the estimate. No agent sees the true angle, but in an oracle run.
"""

import copy
import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.case import Case
from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.estimation.knowledge import Knowledge
from twin.estimation.learned.trained_file import TrainedFile, check_network, read_trained_file
from twin.files.shown import shown

Array = NDArray[np.float64]
POLICY_FILE = "policy.onnx"


class Agent(Protocol):
    """A batch of estimators that a policy steers."""

    observation_size: int
    action_size: int

    @property
    def bend_deg(self) -> Array:
        """(B,) estimates [deg]."""

    def reset(self, pull_mm: Array, initial_bend_deg: Array) -> None:
        """Start B estimators at the first (B,) pull [mm], at their (B,) initial estimates [deg]."""

    def observe(
        self,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        oracle_deg: Array | None = None,
    ) -> Array:
        """Take in one sample and return the (B, observation_size) observation.

        `oracle_deg` replaces the measurement in the residual by the truth: only an oracle run gives it.
        """

    def act(self, action: Array) -> Array:
        """Apply (B, action_size) actions in [-1, 1] and return the (B,) estimates [deg]."""


@dataclasses.dataclass(frozen=True)
class Policy:
    """A deterministic policy and the filter that it was trained beside.

    Attributes:
        network: the trained file.
    """

    network: TrainedFile

    def __call__(self, observation: Array) -> Array:
        """Return (B, action_size) actions in [-1, 1] for (B, observation_size) observations."""
        (action,) = self.network.run(observation=observation)
        return action.astype(float)

    @property
    def agent_name(self) -> str:
        """Word that the policy was trained under."""
        return self.network.agent

    @property
    def active_model(self) -> ActiveModel:
        """The filter that the policy was trained beside."""
        return ActiveModel.from_dict(self.network.description.get("active_model"))


def load_policy(path: Path) -> Policy:
    """Read a policy.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is no trained policy.
    """
    network = read_trained_file(path)
    policy = Policy(network)
    try:
        names = [part.name for part in (*network.session.get_inputs(), *network.session.get_outputs())]
        if names != ["observation", "action"]:
            raise InputError(f"its inputs and outputs are {shown(names)}")
        _ = policy.active_model
    except ValueError as error:
        raise InputError(f"{path} is not a policy written by `endotwin train`: {error}") from error
    return policy


@dataclasses.dataclass(frozen=True)
class PolicyEstimator(Estimator[Agent]):
    """A trained policy steers an agent; a filter inside the agent is told R.

    Attributes:
        policy: trained.
        active_model: filter inside the agent, and what else the agent is made of.
        make_agent: returns an agent of the kind that the policy steers.
    """

    policy: Callable[[Array], Array]
    active_model: ActiveModel
    make_agent: Callable[[ActiveModel], Agent]

    @property
    def sample_time(self) -> float:
        """T [s]."""
        return self.active_model.sample_time

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the estimator whose filter takes the sensor's variance as R."""
        return dataclasses.replace(self, active_model=self.active_model.with_sensor(sensor))

    def start(self, pull_mm: Array, bend_deg: Array) -> Agent:
        """Return an agent at the initial estimates."""
        agent = self.make_agent(self.active_model)
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
class OracleRun:
    """A policy estimator whose residual is taken from the clean truth: an oracle, which no robot can have.

    Attributes:
        estimator: that is shown the truth.
    """

    estimator: PolicyEstimator

    def __call__(self, case: Case) -> Array:
        """Return (B, N) estimated angles [deg].

        Raises:
            ValueError: the case has no truth.
        """
        if case.truth_deg is None:
            raise InputError("an oracle needs the truth")
        estimator = self.estimator.with_sensor(case.sensor)
        pull, measurement, initial = time_first(case.pull_mm, case.measurement_deg, case.initial_bend_deg)
        estimate = np.empty_like(measurement)
        estimate[0] = initial
        state = estimator.start(pull[0], initial)
        for k in range(1, len(measurement)):
            state = estimator.step(state, pull[k], pull[k - 1], measurement[k], case.truth_deg[:, k])
            estimate[k] = state.bend_deg
        return estimate.T


def load_steered(path: Path, agent: str, make_agent: Callable[[ActiveModel], Agent]) -> PolicyEstimator:
    """Read a trained policy of an agent, beside the filter that it was trained with.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is no trained policy of this agent.
    """
    policy = load_policy(path)
    return _steered(path, policy, policy.active_model, agent, make_agent)


def build_steered(
    knowledge: Knowledge, agent: str, make_agent: Callable[[ActiveModel], Agent]
) -> PolicyEstimator:
    """Return the trained policy of an agent, beside the active model of what is known."""
    active_model = ActiveModel(knowledge.reference, knowledge.sample_time)
    path = knowledge.file_of(agent)
    return _steered(path, load_policy(path), active_model, agent, make_agent)


def _steered(
    path: Path,
    policy: Policy,
    active_model: ActiveModel,
    agent: str,
    make_agent: Callable[[ActiveModel], Agent],
) -> PolicyEstimator:
    """Return the estimator of a policy, once it takes and returns what the agent does."""
    if policy.agent_name != agent:
        raise InputError(f"{path} holds the agent {shown(policy.agent_name)}, not {agent!r}")
    kind = make_agent(active_model)
    try:
        check_network(
            policy.network, {"observation": (2, kind.observation_size)}, {"action": (2, kind.action_size)}
        )
    except ValueError as error:
        raise InputError(f"{path} is not a policy of the agent {agent!r}: {error}") from error
    return PolicyEstimator(policy, active_model, make_agent)
