"""The estimation task as environments: one for Gymnasium, and one batched over many episodes for training."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from rl.policy import AGENTS
from rl.shared_environment import SharedEnvironment
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned.policy import Agent
from twin.estimation.learned.ram import RAM
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]
_OBSERVATION_LIMIT = 10.0  # exp(10) degrees: never reached, it only bounds the space


def _observation_space(agent: Agent) -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-_OBSERVATION_LIMIT, _OBSERVATION_LIMIT, (len(agent.sensed),), np.float32)


def _action_space(agent: Agent) -> gymnasium.spaces.Box:
    return gymnasium.spaces.Box(-1.0, 1.0, (len(agent.applied),), np.float32)


class BatchEnvironment(SharedEnvironment):
    """Many episodes side by side for stable-baselines3: a step is arithmetic on arrays.

    The reward is eq. 11, minus the squared error of the estimate [deg^2], times `reward_scale`. An episode
    ends, truncated, with its record; its environment then draws the next one.

    The first episodes begin evenly spread over their records, each from an initial estimate that is off as at
    any start. So episodes end and begin one after the other, and every update of a policy contains starts in
    their true proportion: without them it forgets how to correct a wrong initial estimate.

    Attributes:
        record: (count,) record of each episode.
        first: (count,) sample at which it began.
        sample: (count,) next sample of each.
        measurement: (count, N) measured angles of the episodes [deg].
    """

    def __init__(
        self, task: TrainingTask, agent: Agent, count: int, seed: int | None = None, reward_scale: float = 1.0
    ):
        super().__init__(count, _observation_space(agent), _action_space(agent))
        self.task = task
        self.agent = agent
        self.seed(seed)
        self.reward_scale = reward_scale

    def reset(self) -> NDArray[np.float32]:
        """Begin a new episode in every environment; returns (count, sensed)."""
        count, steps = self.num_envs, self.task.pull_mm.shape[1] - 1
        self.first = np.arange(count) * steps // count
        self.record, self.measurement, initial = self.task.draw(count, self.rng, self.first)
        self.agent.reset(self.task.pull_mm[self.record, self.first], initial)
        self.sample = self.first + 1
        self.episode_return = np.zeros(count)
        return self._observe()

    def _begin_again(self, ended: NDArray[np.bool_]) -> None:
        """Begin a complete episode where one has ended."""
        initial = np.zeros(self.num_envs)
        self.record[ended], self.measurement[ended], initial[ended] = self.task.draw(ended.sum(), self.rng)
        self.agent.reset(self.task.pull_mm[self.record, 0], initial, ended)
        self.first[ended], self.sample[ended], self.episode_return[ended] = 0, 1, 0.0

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Apply them; returns observations, rewards, ends and infos, new episodes begun where one ended."""
        estimate = self.agent.act(self.actions)
        reward = -((estimate - self.task.bend_deg[self.record, self.sample]) ** 2)
        self.episode_return += reward
        self.sample += 1
        ended = self.sample == self.task.pull_mm.shape[1]
        infos = self._infos(ended, self._last_observation, self.sample - 1 - self.first)
        if ended.any():
            self._begin_again(ended)
        return self._observe(), (self.reward_scale * reward).astype(np.float32), ended, infos

    def _observe(self) -> NDArray[np.float32]:
        k, pull = self.sample, self.task.pull_mm
        observation = self.agent.observe(
            pull[self.record, k], pull[self.record, k - 1], self.measurement[np.arange(self.num_envs), k]
        )
        self._last_observation = observation.astype(np.float32)
        return self._last_observation


class EstimationEnvironment(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One episode at a time, for Gymnasium's tools; the same task and agent as the batched environment.

    `gymnasium.make("rl.registration:EndoTwin/Estimation-v0", records=[(pull_mm, bend_deg), ...], model=...)`;
    without records it makes a short one from the model itself, so that the id works by itself.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  Gymnasium's own name

    def __init__(
        self,
        records: Sequence[tuple[Array, Array]] | None = None,
        model: ColemanHodgdon | None = None,
        agent: str | None = RAM.agent,
        sample_time: float = 0.1,
        render_mode: str | None = None,
    ):
        if agent not in AGENTS:
            raise InputError(f"unknown agent {agent!r}; valid: {', '.join(map(str, AGENTS))}")
        model = model or PAPER_MODEL
        pull, bend = stack_records(records or [model_record(model, sample_time)])
        self.batch = BatchEnvironment(
            TrainingTask(pull, bend), AGENTS[agent](ActiveModel(model, sample_time)), count=1
        )
        self.observation_space = self.batch.observation_space
        self.action_space = self.batch.action_space
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Draw a record, its noise and the error of the initial estimate."""
        super().reset(seed=seed)
        if seed is not None:
            self.batch.seed(seed)
        return self.batch.reset()[0], {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Apply one action; `truncated` at the end of the record."""
        observation, reward, done, infos = self.batch.step(np.asarray(action)[None])
        ended = bool(done[0])
        seen: NDArray[np.float32] = infos[0]["terminal_observation"] if ended else np.asarray(observation)[0]
        return seen, float(reward[0]), False, ended, {}


PAPER_MODEL = ColemanHodgdon(1.15, 22.38, 5.0)  # eq. 12


def model_record(model: ColemanHodgdon, sample_time: float) -> tuple[Array, Array]:
    """One minute of the model's own loop on the paper's training stroke."""
    pull = 3 + np.sin(2 * np.pi * np.arange(round(60 / sample_time)) * sample_time / 8)
    return pull, model.response(pull, 60.0)
