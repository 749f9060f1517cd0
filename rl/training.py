"""Training of a policy by PPO (Schulman et al. 2017) with the paper's Table I, into one run folder."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnv

from rl.environment import BatchEnvironment
from rl.export import export_step
from rl.options import TrainingOptions, check_memory
from rl.policies import POLICY_STEPS
from rl.run import (
    action_columns,
    load_checkpoint,
    run_configuration,
    save_checkpoint,
    unusable,
    with_deployment,
    write_curve,
)
from rl.trainers import OnProgress, Trainer, register_trainer
from twin import __version__
from twin.errors import DivergedError, InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned.methods import DIRECT, POLICY_FILE, RAM
from twin.estimation.learned.step import START
from twin.files.run_folder import CHECKPOINT_FILE, counted_cost, open_run, write_configuration
from twin.files.state_file import state_key

Array = NDArray[np.float64]
CHECKPOINTS = 10  # over a whole training
PPO_WIDTHS = (64, 64)
"""Units of each layer of a policy, as Stable-Baselines3 has them."""
UPDATE = {
    "policy_loss": "train/policy_gradient_loss",
    "value_loss": "train/value_loss",
    "entropy_loss": "train/entropy_loss",
    "kl": "train/approx_kl",
    "clip_fraction": "train/clip_fraction",
    "exploration": "train/std",
}
"""Columns of the learning curve that describe the latest update, with their names in stable-baselines3."""
GROWS = "training.episodes"
"""Number that a finished run may be given more of: it goes on from where it ended."""


def train_policy(
    records: Sequence[tuple[Array, Array]],
    active_model: ActiveModel,
    training: TrainingOptions,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train a policy and write `policy.onnx`, `config.yaml` and `progress.csv` into a folder.

    A training that was stopped continues from its checkpoint, with new episodes; a finished one continues if
    more episodes are asked for, and is left as it is if not.

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` at the sample time of the active model.
        active_model: the filter inside RAM, with the R that it is given in training.
        training: agent, length and parameters of PPO.
        folder: where the run is kept.
        on_progress: called with samples done, samples in all and the latest mean reward per sample [deg^2].
    """
    torch.set_num_threads(1)  # the networks are small: threads would only wait for each other
    pull, bend = stack_records(records)
    check_memory(training, pull.shape[1])
    configuration = run_configuration(records, active_model, training)
    policy_path, checkpoint = folder / POLICY_FILE, folder / CHECKPOINT_FILE
    files = (POLICY_FILE, CHECKPOINT_FILE)
    with open_run(folder, configuration, files, GROWS) as shorter:
        if shorter or not policy_path.is_file():
            task = TrainingTask(pull, bend, training.noise, training.noise_level, training.initial_error_deg)
            environment = BatchEnvironment(
                task,
                active_model,
                training.environments,
                training.seed,
                training.reward_scale,
                training.agent,
            )
            ppo = new_ppo(environment, training)
            key = state_key(__version__, torch.__version__, _without(configuration, GROWS), pull, bend)
            run = _Run(checkpoint, key, ppo, training, environment, on_progress)
            run.restore()
            _check_goes_on(ppo, run, shorter)
            with counted_cost(folder):
                _learn(ppo, run)
            run.save()  # what goes on from here is a longer training
            run.write()
            description = with_deployment(configuration, records, active_model, training.seed)
            export_policy(ppo, training.agent, active_model, description, policy_path)
            if shorter:  # the last: until then it is the shorter run, which may go on again
                write_configuration(folder, configuration)
            if on_progress:
                on_progress(run.total, run.total, run.latest)
    return policy_path


def _without(configuration: dict[str, Any], name: str) -> dict[str, Any]:
    part, setting = name.split(".")
    kept = {key: value for key, value in configuration[part].items() if key != setting}
    return configuration | {part: kept}


def _check_goes_on(ppo: PPO, run: "_Run", shorter: bool) -> None:
    if shorter and not ppo.num_timesteps:
        raise InputError(
            f"{run.folder} holds a shorter run, whose {CHECKPOINT_FILE} is not of this version: "
            "choose another `folder`"
        )
    if ppo.num_timesteps >= run.total + run.training.horizon:
        raise InputError(
            f"{run.folder} has gone on to {ppo.num_timesteps} samples already: ask for more than {run.total}"
        )


def _learn(ppo: PPO, run: "_Run") -> None:
    if ppo.num_timesteps < run.total:
        # Its own random numbers after each stop, not those of the beginning again.
        set_random_seed(
            int(np.random.SeedSequence([run.training.seed, ppo.num_timesteps]).generate_state(1)[0])
        )
        run.environment.rng = np.random.default_rng([run.training.seed, ppo.num_timesteps])
        learn(ppo, run.total - ppo.num_timesteps, run, reset=False)


def learn(ppo: PPO, samples: int, callback: BaseCallback, reset: bool = True) -> None:
    """Train by PPO for so many samples."""
    try:
        ppo.learn(samples, callback=callback, reset_num_timesteps=reset)
    except ValueError:
        check_finite(ppo)  # distributions refuse what is no number
        raise
    check_finite(ppo)


def new_ppo(environment: VecEnv, training: TrainingOptions, widths: Sequence[int] = PPO_WIDTHS) -> PPO:
    """Return an untrained policy with the parameters of a training, and layers of so many units."""
    ppo = PPO(
        "MlpPolicy",
        environment,
        learning_rate=training.learning_rate,
        n_steps=training.horizon // training.environments,
        batch_size=training.minibatch,
        gamma=training.discount,
        clip_range=training.clip,
        seed=training.seed,
        device="cpu",
        policy_kwargs={"net_arch": {"pi": list(widths), "vf": list(widths)}},
    )
    ppo.set_logger(Logger(folder=None, output_formats=[]))  # its own makes a folder outside of the run
    return ppo


def export_policy(
    ppo: PPO, agent: str, active_model: ActiveModel, description: dict[str, Any], path: Path
) -> None:
    """Write one sample of an agent as ONNX: its filter, and the mean action of a trained policy."""
    policy = torch.nn.Sequential(ppo.policy.mlp_extractor.policy_net, ppo.policy.action_net)
    step = POLICY_STEPS[agent](active_model, policy)
    contents = {"agent": agent, START: step.start, **description}
    export_step(step, dict.fromkeys(step.inputs, ()), dict.fromkeys(step.state, ()), contents, path)


def check_finite(ppo: PPO) -> None:
    """Refuse weights that are not numbers."""
    if not all(torch.isfinite(values).all() for values in ppo.policy.parameters()):
        raise DivergedError(
            f"the training has diverged after {ppo.num_timesteps} samples: lower `learning_rate`"
        )


class _Run(BaseCallback):
    """Learning curve of the finished episodes and, every so many updates, a checkpoint.

    Attributes:
        curve: rows of `progress.csv`: samples, mean reward per sample [deg^2] of as many finished episodes as
            there are environments, the figures of the latest update, and mean and deviation of each action.
    """

    def __init__(
        self,
        checkpoint: Path,
        key: str,
        ppo: PPO,
        training: TrainingOptions,
        environment: BatchEnvironment,
        on_progress: OnProgress | None,
    ):
        super().__init__()
        self.checkpoint, self.folder, self.key = checkpoint, checkpoint.parent, key
        self.ppo = ppo
        self.training = training
        self.environment = environment
        self.on_progress = on_progress
        self.total = training.episodes * (environment.task.pull_mm.shape[1] - 1)
        updates = math.ceil(self.total / training.horizon)
        self.between = math.ceil(updates / CHECKPOINTS) * training.horizon  # samples from one to the next
        self.curve: list[tuple[float, ...]] = []
        self.update = [math.nan] * len(UPDATE)
        self.episodes: list[dict[str, float]] = []  # finished since the last row
        self.actions: list[NDArray[np.float32]] = []

    def save(self) -> None:
        check_finite(self.ppo)
        state = {"samples": self.ppo.num_timesteps, "curve": self.curve, **self.ppo.get_parameters()}
        save_checkpoint(self.checkpoint, self.key, state)

    def restore(self) -> None:
        state = load_checkpoint(self.checkpoint, self.key)
        if state is not None:
            try:
                self.ppo.num_timesteps, self.curve = int(state.pop("samples")), list(state.pop("curve"))
                self.ppo.set_parameters(state)
            except Exception as error:  # what does not fit, in classes of torch and stable-baselines3
                raise unusable(self.checkpoint) from error

    def write(self) -> None:
        actions = action_columns(self.environment.filter_step.actions)
        write_curve(self.folder, self.curve, ["samples", "mean_reward", *UPDATE, *actions])

    @property
    def latest(self) -> float:
        """Mean reward per sample of the last episodes [deg^2]."""
        return self.curve[-1][1] if self.curve else math.nan

    def _on_rollout_start(self) -> None:
        self._take_update()
        if self.num_timesteps and self.num_timesteps % self.between == 0:
            self.save()

    def _on_training_end(self) -> None:
        self._take_update()
        if self.episodes:
            self._add_row()

    def _take_update(self) -> None:
        logged = self.logger.name_to_value
        if logged.keys() >= set(UPDATE.values()):
            self.update = [float(logged[name]) for name in UPDATE.values()]

    def _on_step(self) -> bool:
        self.actions.append(self.environment.actions)
        self.episodes += [info["episode"] for info in self.locals["infos"] if "episode" in info]
        if len(self.episodes) >= self.environment.num_envs:
            self._add_row()
            if self.on_progress:
                self.on_progress(min(self.num_timesteps, self.total - 1), self.total, self.latest)
        return True

    def _add_row(self) -> None:
        reward = sum(of["r"] for of in self.episodes) / sum(of["l"] for of in self.episodes)
        acted = np.concatenate(self.actions)
        figures = np.stack([acted.mean(axis=0), acted.std(axis=0)], axis=1).ravel().tolist()
        self.curve.append((self.num_timesteps, reward, *self.update, *figures))
        self.episodes, self.actions = [], []
        self.write()


for _method in (RAM, DIRECT):
    register_trainer(Trainer(_method, train_policy, unit="samples", counts_samples=True))
