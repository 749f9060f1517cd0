"""Algorithms of reinforcement learning for the estimation task, and agents of the user's own.

An agent file is a program of the user, which `train --agent-file` runs:

    def make_agent(environment, seed):    # stable_baselines3's VecEnv of the estimation task
        return SAC("MlpPolicy", environment, seed=seed)    # or a trained torch.nn.Module

    def wrap(environment):                # optional: wrappers of Gymnasium around each environment
        return TransformReward(environment, ...)

What `make_agent` returns is trained if it is an algorithm of stable-baselines3 or sb3-contrib. A module is
deployed as it is: from observations (B, n) to actions (B, m) within [-1, 1]. One with an attribute
`memory`, a tuple of sizes, takes and returns (B, size) arrays too, which are zero at the start.
"""

import hashlib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor

from rl.options import TrainingOptions
from rl.recurrent import cell_of
from twin.errors import InputError
from twin.files.program import program_error, run_program

Tensor = torch.Tensor
Wrap = Callable[[gymnasium.Env[Any, Any]], gymnasium.Env[Any, Any]]
EPOCHS = 5  # passes of PPO over the samples of an update
FIRST_LOG_STD = -1.0  # of PPO's first exploration, in actions from -1 to 1
REPLAYED = 200_000  # latest samples that SAC and TD3 learn from


def _off_policy(kind: type[SAC] | type[TD3]) -> Callable[[VecEnv, TrainingOptions], BaseAlgorithm]:
    def make(environment: VecEnv, options: TrainingOptions) -> BaseAlgorithm:
        more: dict[str, Any] = {}
        if kind is TD3:
            still = np.zeros_like(environment.action_space.sample())
            more["action_noise"] = NormalActionNoise(still, still + 0.1)
        return kind(
            "MlpPolicy",
            environment,
            learning_rate=options.learning_rate,
            buffer_size=REPLAYED,
            batch_size=options.minibatch,
            gamma=options.discount,
            seed=options.seed,
            device="cpu",
            policy_kwargs={"net_arch": list(options.network)},
            **more,
        )

    return make


def new_ppo(environment: VecEnv, training: TrainingOptions, epochs: int = EPOCHS) -> PPO:
    """Return an untrained policy with the parameters of a training.

    Its learning rate falls to zero in the second half of a training. With a constant rate the final weights
    carry the noise of the last updates, which makes direct RL worse.
    """
    widths, rate = list(training.network), training.learning_rate
    ppo = PPO(
        "MlpPolicy",
        environment,
        learning_rate=lambda left: rate * min(1.0, 2 * left),
        n_steps=training.horizon // training.environments,
        n_epochs=epochs,
        batch_size=training.minibatch,
        gamma=training.discount,
        clip_range=training.clip,
        seed=training.seed,
        device="cpu",
        policy_kwargs={
            "net_arch": {"pi": widths, "vf": widths},
            "log_std_init": FIRST_LOG_STD,
            "optimizer_kwargs": {"fused": True, "eps": 1e-5},
        },
    )
    quiet(ppo)
    return ppo


MAKERS: dict[str, Callable[[VecEnv, TrainingOptions], BaseAlgorithm]] = {
    "ppo": new_ppo,
    "sac": _off_policy(SAC),
    "td3": _off_policy(TD3),
}
"""Makers of untrained agents, by the word of `train --algorithm`, see `rl.options.ALGORITHMS`."""


class AgentFile:
    """Agent file of a user, run once."""

    def __init__(self, path: Path):
        """Run a file; raises `ValueError` where it does not exist, fails, or has no `make_agent`."""
        self.path = path
        self.module: ModuleType = run_program(path, "agent file")
        self.sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        if not callable(getattr(self.module, "make_agent", None)):
            raise InputError(f"agent file {path} defines no make_agent(environment, seed)")
        self.wrap: Wrap | None = getattr(self.module, "wrap", None)

    def make(self, environment: VecEnv, options: TrainingOptions) -> BaseAlgorithm | torch.nn.Module:
        """Return the user's agent for an environment."""
        try:
            agent = self.module.make_agent(environment, options.seed)
        except Exception as error:
            raise program_error(self.path, "agent file", error) from error
        if not isinstance(agent, BaseAlgorithm | torch.nn.Module):
            raise InputError(
                f"agent file {self.path}: make_agent returned {type(agent).__name__}: must be an algorithm "
                "of stable-baselines3 or a torch.nn.Module"
            )
        return agent


class ModuleObservation(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Observations that pass through a module, which is deployed together with the policy.

    The module takes (B, n) and returns (B, k). Other observation wrappers of Gymnasium have no torch form:
    an agent that was trained through one could not be exported.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], module: torch.nn.Module):
        super().__init__(env)
        self.module = module.eval()
        low = self.observation(env.observation_space.sample())
        self.observation_space = gymnasium.spaces.Box(-float("inf"), float("inf"), low.shape, low.dtype.type)

    def observation(self, observation: Any) -> Any:
        """Return the module's output for an observation (n,)."""
        with torch.no_grad():
            return self.module(torch.as_tensor(observation)[None])[0].numpy()


def wrapped_environments(singles: Sequence[gymnasium.Env[Any, Any]], wrap: Wrap) -> VecEnv:
    """Return environments side by side, each in the wrappers of the user."""
    return VecMonitor(DummyVecEnv([partial(wrap, single) for single in singles]))


def modules_of(environment: gymnasium.Env[Any, Any]) -> list[torch.nn.Module]:
    """Return the modules that observations pass through, the first one first.

    Raises `ValueError` for a wrapper that changes observations or actions and cannot be deployed.
    """
    found = []
    while isinstance(environment, gymnasium.Wrapper):
        if isinstance(environment, ModuleObservation):
            found.append(environment.module)
        elif isinstance(environment, gymnasium.ObservationWrapper | gymnasium.ActionWrapper):
            raise InputError(
                f"the wrapper {type(environment).__name__} cannot be deployed: change observations by "
                "rl.algorithms.ModuleObservation, and actions in the policy"
            )
        environment = environment.env
    return found[::-1]


class RecurrentPolicy(torch.nn.Module):
    """Mean action of a recurrent policy of sb3-contrib, sample by sample."""

    def __init__(self, policy: Any):
        super().__init__()
        self.features, self.hidden, self.mean = (
            policy.pi_features_extractor,
            policy.mlp_extractor.policy_net,
            policy.action_net,
        )
        layers = policy.lstm_actor
        self.cells = torch.nn.ModuleList(cell_of(layers, number) for number in range(layers.num_layers))
        self.memory = (layers.hidden_size,) * (2 * layers.num_layers)

    def forward(self, observation: Tensor, *memory: Tensor) -> tuple[Tensor, ...]:
        """Return the (B, m) actions, and the memory after them."""
        seen, after = self.features(observation), []
        for cell, hidden, inner in zip(self.cells, memory[::2], memory[1::2], strict=True):
            seen, kept = cell(seen, (hidden, inner))
            after += [seen, kept]
        return self.mean(self.hidden(seen)), *after


def policy_of(agent: BaseAlgorithm | torch.nn.Module) -> torch.nn.Module:
    """Return the mean action of an agent, from (B, observations) to (B, actions)."""
    if isinstance(agent, torch.nn.Module):
        return agent
    policy: Any = agent.policy
    if hasattr(policy, "lstm_actor"):
        return RecurrentPolicy(policy)
    if hasattr(policy, "actor"):
        actor = policy.actor
        if hasattr(actor, "latent_pi"):  # SAC and similar squash a normal distribution
            return torch.nn.Sequential(actor.features_extractor, actor.latent_pi, actor.mu, torch.nn.Tanh())
        return torch.nn.Sequential(actor.features_extractor, actor.mu)
    return torch.nn.Sequential(
        policy.pi_features_extractor, policy.mlp_extractor.policy_net, policy.action_net
    )


def quiet(agent: BaseAlgorithm) -> None:
    """Keep the figures of an agent to callbacks; its own logger makes a folder elsewhere."""
    agent.set_logger(Logger(folder=None, output_formats=[]))
