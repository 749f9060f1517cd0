"""Checkpoint of a training by PPO: weights, moments of Adam, curve and the actions of the running episodes.

Random streams are not kept: at each checkpoint, in an undisturbed training too, they begin anew from the seed
and the number of samples. The environment is brought back by the actions that its episodes have had so far.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.utils import set_random_seed

from rl.adam_state import adam_state, begin_moments, fits, set_tensors
from rl.environment import BatchEnvironment
from rl.run import action_columns
from twin.errors import DivergedError
from twin.estimation.learned.policy import Agent
from twin.estimation.task import TrainingTask
from twin.files.state_file import damaged_state, read_state, write_state

Array = NDArray[np.float64]
Curve = list[tuple[float, ...]]
"""Rows of `progress.csv`: samples done, the mean reward per sample [deg^2] of the episodes that ended there,
the figures of the latest update (`UPDATE`), and of each action its mean and its deviation over them."""
UPDATE = {
    "policy_loss": "train/policy_gradient_loss",
    "value_loss": "train/value_loss",
    "entropy_loss": "train/entropy_loss",
    "kl": "train/approx_kl",
    "clip_fraction": "train/clip_fraction",
    "exploration": "train/std",
}
"""Figures of an update of PPO, each with its name in stable-baselines3: losses, minus the entropy of the
actions, the divergence of Kullback and Leibler from the policy before, the share of samples clipped, and the
deviation of exploration."""

CHECKPOINT = "training checkpoint"
"""Kind of its state."""


class ReplayedEnvironment(BatchEnvironment):
    """Batched environment that can be brought back to where it was by what was done in it.

    Attributes:
        rounds: how many times all episodes have begun.
        actions_so_far: of the running episodes, each (count, action_size).
        acted: mean and standard deviation of each action, one after the other, in the episodes before.
    """

    def __init__(self, task: TrainingTask, agent: Agent, count: int, seed: int, reward_scale: float):
        super().__init__(task, agent, count, seed, reward_scale)
        self._seed = seed
        self.rounds = 0
        self.actions_so_far: list[NDArray[np.float32]] = []
        self.acted: list[float] = []

    def reset(self) -> NDArray[np.float32]:
        """Begin a new episode in every environment, from the random numbers of this round."""
        self.rng = np.random.default_rng([self._seed, self.rounds])
        self.rounds += 1
        if self.actions_so_far:
            actions = np.concatenate(self.actions_so_far)
            self.acted = np.stack([actions.mean(axis=0), actions.std(axis=0)], axis=1).ravel().tolist()
        self.actions_so_far = []
        return super().reset()

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Take (count, action_size) actions and note them."""
        self.actions_so_far.append(np.array(actions, dtype=np.float32))
        super().step_async(actions)

    def replay(self, rounds: int, actions: Array) -> NDArray[np.float32]:
        """Begin a round again and act as it did; returns the last observation."""
        self.rounds = rounds - 1
        observation = self.reset()
        for action in actions.astype(np.float32):
            observation = self.step(action)[0]  # type: ignore[assignment]
        return observation


def reseed(seed: int, samples: int) -> None:
    """Begin the random numbers of torch, and of NumPy's shared stream, which shuffles minibatches, anew."""
    set_random_seed(int(np.random.SeedSequence([seed, samples]).generate_state(1)[0]))


def curve_columns(environment: ReplayedEnvironment) -> list[str]:
    """Return the names of what a row of the curve holds."""
    return ["samples", "mean_reward", *UPDATE, *action_columns(len(environment.agent.applied))]


def save_checkpoint(
    path: Path,
    key: str,
    ppo: PPO,
    environment: ReplayedEnvironment,
    curve: Curve,
    update: Sequence[float],
) -> None:
    """Write the state of a training between an update and the next rollout.

    Args:
        path: of the file.
        key: of the training.
        ppo: the policy, and Adam.
        environment: and what was done in it.
        curve: so far.
        update: figures of the latest update.

    Raises:
        FloatingPointError: the training has diverged.
    """
    check_finite(ppo)
    actions = np.array(environment.actions_so_far, dtype=np.float64)
    counters = [ppo.num_timesteps, ppo._n_updates, environment.rounds]
    arrays = {
        "counters": np.array(counters, dtype=np.float64),
        **_finite("curve", np.array(curve, dtype=np.float64).reshape(-1, len(curve_columns(environment)))),
        **_finite("update", np.array(update, dtype=np.float64)),
        "actions": actions.reshape(-1, environment.num_envs, len(environment.agent.applied)),
    }
    learned = adam_state(ppo.policy, ppo.policy.optimizer)
    write_state(path, CHECKPOINT, key, arrays | {name: of.numpy() for name, of in learned.items()})


def _finite(name: str, values: Array) -> dict[str, Array]:
    """Return an array as two, as a state holds no NaN: its numbers, and 1 where they are known."""
    return {name: np.nan_to_num(values), f"{name} known": np.isfinite(values).astype(float)}


def _with_unknown(saved: dict[str, Array], name: str) -> Array:
    """Return the array that `_finite` was given; one of no size, if its parts do not fit."""
    if saved[name].shape != saved[f"{name} known"].shape:
        return np.zeros(0)
    return np.where(saved[f"{name} known"] == 1, saved[name], np.nan)


def load_checkpoint(
    path: Path, key: str, ppo: PPO, environment: ReplayedEnvironment
) -> tuple[Curve, list[float]]:
    """Bring a fresh training to the state of a checkpoint, if there is one of this training.

    Returns:
        The learning curve so far and the figures of the latest update; without a checkpoint there is no row
        and no figure, and nothing is changed.

    Raises:
        ValueError: the file is foreign or damaged.
    """
    saved = read_state(path, CHECKPOINT, key)
    if saved is None:
        return [], [np.nan] * len(UPDATE)
    damaged = damaged_state(path)
    begin_moments(ppo.policy, ppo.policy.optimizer)
    expected = adam_state(ppo.policy, ppo.policy.optimizer)
    named = {"counters", "actions", "curve", "curve known", "update", "update known"}
    if named - set(saved) or not fits(saved, expected):
        raise damaged
    counters, actions = saved["counters"], saved["actions"]
    curve, latest = (_with_unknown(saved, name) for name in ("curve", "update"))
    each = (environment.num_envs, len(environment.agent.applied))
    shapes = counters.shape, curve.shape[1:], actions.shape[1:], latest.shape
    if shapes != ((3,), (len(curve_columns(environment)),), each, (len(UPDATE),)):
        raise damaged
    samples = environment.task.pull_mm.shape[1] - 1  # of a round: a whole one would have begun another
    if (counters < [0, 0, 1]).any() or (counters > 2**52).any() or len(actions) >= samples:
        raise damaged
    set_tensors(expected, saved)
    ppo.num_timesteps, ppo._n_updates, rounds = (int(count) for count in counters)
    ppo._last_obs = environment.replay(rounds, actions)
    ppo._last_episode_starts = np.full(environment.num_envs, not len(actions))
    return [tuple(row) for row in curve.tolist()], latest.tolist()


def check_finite(ppo: PPO) -> None:
    """Refuse weights that are no numbers.

    Raises:
        FloatingPointError: so they are.
    """
    learned = adam_state(ppo.policy, ppo.policy.optimizer)
    if not all(torch.isfinite(tensor).all() for tensor in learned.values()):
        raise DivergedError(
            f"the training has diverged after {ppo.num_timesteps} samples: lower `learning_rate`"
        )
