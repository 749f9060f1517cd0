"""A policy that steers an agent: reinforcement learning as an estimator, run by ONNX Runtime.

An agent is a batch of B running estimators. Training, evaluation and the online form all drive the same two
calls per sample: one takes the command and the measurement, the other takes what the policy makes of them
and returns the estimate. No agent sees the true angle, but in an oracle run.
"""

import abc
import copy
import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.estimation.knowledge import Case, Knowledge
from twin.estimation.learned.trained_file import TrainedFile, check_network, read_trained_file
from twin.estimation.single import SingleForm
from twin.files.shown import shown

Array = NDArray[np.float64]
POLICY_FILE = "policy.onnx"


class Agent(abc.ABC):
    """A batch of estimators that a policy steers.

    Its two halves are what the deployed graph takes and returns, `sense` and `apply`, in physical quantities,
    and what the network inside of that graph sees and says, `observe` and `act`, on scales that it can learn.

    Attributes:
        sensed: what the graph takes, name and unit of each number.
        applied: what the graph returns, likewise.
    """

    sensed: ClassVar[Mapping[str, str]]
    applied: ClassVar[Mapping[str, str]]

    @abc.abstractmethod
    def __init__(self, active_model: ActiveModel):
        """Make an agent of a filter, where it has one inside."""

    @property
    @abc.abstractmethod
    def bend_deg(self) -> Array:
        """(B,) estimates [deg]."""

    @abc.abstractmethod
    def reset(self, pull_mm: Array, initial_bend_deg: Array, which: NDArray[np.bool_] | bool = True) -> None:
        """Start those of B estimators at the first (B,) pull [mm], at their (B,) initial estimates [deg]."""

    @abc.abstractmethod
    def sense(
        self,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        oracle_deg: Array | None = None,
    ) -> Array:
        """Take in one sample and return (B, sensed).

        `oracle_deg` replaces the measurement in the residual by the truth: only an oracle run gives it.
        """

    @staticmethod
    @abc.abstractmethod
    def scaled(sensed: Array) -> Array:
        """Return the (B, sensed) observation of the network."""

    @staticmethod
    @abc.abstractmethod
    def amounts(action: Array) -> Array:
        """Return (B, applied), what (B, applied) actions in [-1, 1] stand for; others are clipped."""

    @abc.abstractmethod
    def apply(self, amounts: Array) -> Array:
        """Apply (B, applied) and return the (B,) estimates [deg]."""

    @staticmethod
    def single(active_model: ActiveModel, policy: Callable[[Array], Array]) -> SingleForm[Any] | None:
        """Return agent and policy on one stream on plain numbers; None without such a form."""
        return None

    def observe(self, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array) -> Array:
        """Take in one sample and return what the network sees of it."""
        return self.scaled(self.sense(pull_mm, previous_pull_mm, measurement_deg))

    def act(self, action: Array) -> Array:
        """Apply what the network says and return the (B,) estimates [deg]."""
        return self.apply(self.amounts(action))


@dataclasses.dataclass(frozen=True)
class Policy:
    """A deterministic policy and the filter that it was trained beside.

    Attributes:
        network: the trained file.
    """

    network: TrainedFile

    def __call__(self, sensed: Array) -> Array:
        """Return (B, applied) of the agent for its (B, sensed)."""
        (applied,) = self.network.run(sensed=sensed)
        return applied.astype(float)

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
        if names == ["observation", "action"]:
            raise InputError("an earlier version wrote it, without its scales: train again")
        if names != ["sensed", "applied"]:
            raise InputError(f"its inputs and outputs are {shown(names)}")
        _ = policy.active_model
    except ValueError as error:
        raise InputError(f"{path} is not a policy written by `endotwin train`: {error}") from error
    return policy


@dataclasses.dataclass(frozen=True)
class PolicyEstimator(Estimator[Agent]):
    """A trained policy steers an agent; a filter inside the agent is told R.

    Attributes:
        policy: trained: what an agent senses to what it applies.
        active_model: filter inside the agent, and what else the agent is made of.
        make_agent: kind of agent that the policy steers.
    """

    policy: Callable[[Array], Array]
    active_model: ActiveModel
    make_agent: type[Agent]

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
        """Sense one sample and apply what the policy says; `oracle_deg` as in `Agent.sense`."""
        agent = copy.copy(state)  # an agent replaces its arrays and never writes into them
        agent.apply(self.policy(agent.sense(pull_mm, previous_pull_mm, measurement_deg, oracle_deg)))
        return agent

    def single(self) -> SingleForm[Any]:
        """Return the estimator on one stream; on plain numbers, where its agent has such a form."""
        form = self.make_agent.single(self.active_model, self.policy)
        return super().single() if form is None else form

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


def load_steered(path: Path, agent: str, make_agent: type[Agent]) -> PolicyEstimator:
    """Read a trained policy of an agent, beside the filter that it was trained with.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is no trained policy of this agent.
    """
    policy = load_policy(path)
    return _steered(path, policy, policy.active_model, agent, make_agent)


def build_steered(knowledge: Knowledge, agent: str, make_agent: type[Agent]) -> PolicyEstimator:
    """Return the trained policy of an agent, beside the active model of what is known."""
    active_model = ActiveModel(knowledge.reference, knowledge.sample_time)
    path = knowledge.file_of(agent)
    return _steered(path, load_policy(path), active_model, agent, make_agent)


def _steered(
    path: Path,
    policy: Policy,
    active_model: ActiveModel,
    agent: str,
    make_agent: type[Agent],
) -> PolicyEstimator:
    """Return the estimator of a policy, once it takes and returns what the agent does."""
    if policy.agent_name != agent:
        raise InputError(f"{path} holds the agent {shown(policy.agent_name)}, not {agent!r}")
    try:
        check_network(
            policy.network, {"sensed": (2, len(make_agent.sensed))}, {"applied": (2, len(make_agent.applied))}
        )
    except ValueError as error:
        raise InputError(f"{path} is not a policy of the agent {agent!r}: {error}") from error
    return PolicyEstimator(policy, active_model, make_agent)
