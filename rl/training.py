"""Training of a policy by PPO (Schulman et al. 2017) with the paper's Table I, into one run folder."""

import contextlib
import csv
import io
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from rl.environment import AGENTS, BatchEnvironment
from rl.options import TrainingOptions
from rl.policy import export_policy
from rl.run import run_configuration
from rl.trainers import OnProgress, Trainer, register_trainer
from twin.estimation.active_model import ActiveModel
from twin.estimation.learned.direct import DIRECT
from twin.estimation.learned.policy import POLICY_FILE
from twin.estimation.learned.ram import RAM
from twin.estimation.task import TrainingTask, stack_records
from twin.files.atomic import write_whole
from twin.files.run_folder import claim_folder

Array = NDArray[np.float64]
CHECKPOINTS = 10  # over a whole training


def train_policy(
    records: Sequence[tuple[Array, Array]],
    active_model: ActiveModel,
    training: TrainingOptions,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train a policy and write `policy.onnx`, `config.yaml`, `progress.csv` and checkpoints into a folder.

    A training that was stopped goes on from its newest whole checkpoint; one that is finished is left as it
    is. (A resumed training draws other random numbers than an undisturbed one.)

    Args:
        records: `(pull_mm (N,), bend_deg (N,))` at the sample time of the active model.
        active_model: the filter inside RAM; its R is told at training.
        training: agent, length and parameters of PPO.
        folder: where the run is kept.
        on_progress: told samples done, samples in all and the latest mean reward per sample [deg^2].

    Returns:
        Path of the policy.

    Raises:
        ValueError: the folder holds a run of another configuration.
    """
    torch.set_num_threads(1)  # the networks are small: threads would only wait for each other
    folder.mkdir(parents=True, exist_ok=True)
    configuration = run_configuration(records, active_model, training)
    policy_path = folder / POLICY_FILE
    claim_folder(folder, configuration)
    if policy_path.is_file():
        return policy_path

    pull, bend = stack_records(records)
    task = TrainingTask(pull, bend, training.noise, training.noise_level, training.initial_error_deg)
    agent = AGENTS[training.agent](active_model)
    total = training.episodes * (pull.shape[1] - 1)
    environment = BatchEnvironment(task, agent, training.environments, training.seed, training.reward_scale)
    ppo = _newest_checkpoint(folder, environment, training.seed) or _new_ppo(environment, training)
    callback = _Progress(folder, total, on_progress)
    if ppo.num_timesteps < total:
        ppo.learn(total - ppo.num_timesteps, callback=callback, reset_num_timesteps=False)
    export_policy(ppo, training.agent, configuration, policy_path)
    return policy_path


def _new_ppo(environment: BatchEnvironment, training: TrainingOptions) -> PPO:
    return PPO(
        "MlpPolicy",
        environment,
        learning_rate=training.learning_rate,
        n_steps=training.horizon // training.environments,
        batch_size=training.minibatch,
        gamma=training.discount,
        clip_range=training.clip,
        seed=training.seed,
        device="cpu",
    )


def _newest_checkpoint(folder: Path, environment: BatchEnvironment, seed: int) -> PPO | None:
    """Load the newest checkpoint that is whole; one that was damaged is passed over."""
    for path in sorted(folder.glob("checkpoints/*.zip"), reverse=True):
        with contextlib.suppress(Exception):  # whatever a damaged archive raises
            ppo = PPO.load(path, env=environment, device="cpu")
            # The stream of the first run has been learned from already.
            environment.rng = np.random.default_rng([seed, ppo.num_timesteps])
            return ppo
    return None


class _Progress(BaseCallback):
    """Appends the return of finished episodes to `progress.csv` and keeps checkpoints."""

    def __init__(self, folder: Path, total: int, on_progress: Callable[[int, int, float], None] | None):
        super().__init__()
        self.folder = folder
        self.total = total
        self.on_progress = on_progress
        self.latest = float("nan")

    def _on_training_start(self) -> None:
        self.next_checkpoint = self.num_timesteps + self.total // CHECKPOINTS
        path = self.folder / "progress.csv"
        kept = []
        if path.is_file():  # of a stopped run: rows after its last checkpoint will be made again
            with path.open() as file:
                kept = [row for row in csv.reader(file) if row and row[0].isdigit()]
            kept = [row for row in kept if int(row[0]) <= self.num_timesteps]
        self.file = path.open("w", newline="")
        self.writer = csv.writer(self.file)
        self.writer.writerows([["samples", "mean_reward"], *kept])

    def _on_step(self) -> bool:
        rewards = [
            info["episode"]["r"] / info["episode"]["l"] for info in self.locals["infos"] if "episode" in info
        ]
        if rewards:
            self.latest = float(np.mean(rewards))
            self.writer.writerow([self.num_timesteps, f"{self.latest:.6g}"])
            self.file.flush()
            if self.on_progress:
                self.on_progress(min(self.num_timesteps, self.total - 1), self.total, self.latest)
        return True

    def _on_rollout_end(self) -> None:
        # The policy of this moment has made the rollout but has not learned from it yet.
        if self.num_timesteps >= self.next_checkpoint:
            self._save()
            self.next_checkpoint += self.total // CHECKPOINTS

    def _save(self) -> None:
        checkpoints = self.folder / "checkpoints"
        checkpoints.mkdir(exist_ok=True)
        buffer = io.BytesIO()
        self.model.save(buffer)
        write_whole(checkpoints / f"{self.num_timesteps:010d}.zip", buffer.getvalue())

    def _on_training_end(self) -> None:
        self.file.close()
        if self.on_progress:
            self.on_progress(self.total, self.total, self.latest)


for _method in (RAM, DIRECT):
    register_trainer(Trainer(_method, train_policy, "samples", counts_samples=True))
