"""Training of a policy on records, by PPO (Schulman et al. 2017) with the paper's Table I or by other agents.

One run folder holds the policy, its configuration, the learning curve and a checkpoint.
"""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnv

from rl.algorithms import MAKERS, AgentFile, modules_of, policy_of, quiet, wrapped_environments
from rl.environment import BatchEnvironment, EstimationEnvironment
from rl.export import export_step
from rl.options import TrainingOptions, check_memory
from rl.policies import POLICY_STEPS
from rl.run import (
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
from twin.estimation.learned.methods import ACTIONS, DIRECT, OWN, POLICY_FILE, RAM
from twin.estimation.learned.step import START
from twin.estimation.load import load_estimator
from twin.evaluation.reading import true_records
from twin.files.run_folder import CHECKPOINT_FILE, counted_cost, open_run, write_configuration
from twin.files.state_file import state_key
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]
CHECKPOINTS = 10  # over a whole training
HELD_OUT_SAMPLES = 600  # of each environment, at each of them
ERROR_SCALES = 6  # of the records' departure from the model that are met
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
    own = AgentFile(Path(training.agent_file)) if training.agent_file else None
    held_out = None
    if training.held_out:
        others = stack_records(true_records([Path(training.held_out)], active_model.sample_time))
        held_out = _environment(*others, active_model, training, own)
    configuration = run_configuration(records, active_model, training)
    del configuration["training"]["agent_file"]  # it may be moved: its contents are what counts
    del configuration["training"]["held_out"]  # no result depends on it
    if own:
        configuration["agent_file"] = {"name": own.path.name, "sha256": own.sha256}
    elif training.algorithm == "ppo":
        training = training.at(active_model.sample_time)
    policy_path, checkpoint = folder / POLICY_FILE, folder / CHECKPOINT_FILE
    with open_run(folder, configuration, (POLICY_FILE, CHECKPOINT_FILE), GROWS) as shorter:
        if shorter or not policy_path.is_file():
            met = with_smaller_errors(active_model.model, pull, bend, training.error_scale)
            environment = _environment(*met, active_model, training, own)
            agent = (own.make if own else MAKERS[training.algorithm])(environment, training)
            modules = modules_of(environment.envs[0]) if own and own.wrap else []  # type: ignore[attr-defined]
            policy, total = policy_of(agent), training.episodes * (pull.shape[1] - 1)
            if modules and hasattr(policy, "memory"):
                raise InputError(f"agent file {training.agent_file}: a policy with a memory takes no wrapper")
            if isinstance(agent, BaseAlgorithm):
                key = state_key(__version__, torch.__version__, _without(configuration, GROWS), pull, bend)
                quiet(agent)
                run = _Run(checkpoint, key, agent, training, total, on_progress, held_out)
                run.restore()
                _check_goes_on(agent, run, shorter)
                with counted_cost(folder):
                    _learn(agent, run)
                run.save()  # what goes on from here is a longer training
                run.write()
                policy = policy_of(agent)
            word = OWN.agent if own or training.algorithm != "ppo" else training.agent
            description = with_deployment(configuration, records, active_model, training.seed)
            deployed = torch.nn.Sequential(*modules, policy) if modules else policy
            export_policy(deployed, training.agent, active_model, {"agent": word} | description, policy_path)
            if own:
                _check_deployable(own, policy_path)
            if shorter:  # the last: until then it is the shorter run, which may go on again
                write_configuration(folder, configuration)
            if on_progress:
                on_progress(total, total, math.nan if isinstance(agent, torch.nn.Module) else run.latest)
    return policy_path


def _check_deployable(own: AgentFile, path: Path) -> None:
    """Remove what was exported of a user's agent again if no estimator could be read from it."""
    try:
        load_estimator(path)
    except ValueError as error:
        path.unlink()
        reason = str(error.__cause__ or error)
        raise InputError(f"agent file {own.path}: its policy cannot be deployed: {reason}") from error


def with_smaller_errors(
    model: HysteresisModel, pull_mm: Array, bend_deg: Array, smallest: float
) -> tuple[Array, Array]:
    """Return records with their departure from a model scaled from `smallest` to 1, (records, N) each.

    What a residual of some sqrt(R) means depends on how large the model's error is next to the noise. Records
    that are met under one R alone have one ratio of both: a policy that has met no other follows the noise
    where R is larger.
    """
    if smallest == 1:
        return pull_mm, bend_deg
    response = np.stack([model.response(pull, bend[0]) for pull, bend in zip(pull_mm, bend_deg, strict=True)])
    scale = np.geomspace(smallest, 1, ERROR_SCALES)[:, None, None]
    scaled = response + scale * (bend_deg - response)
    return np.tile(pull_mm, (ERROR_SCALES, 1)), scaled.reshape(-1, bend_deg.shape[1])


def _environment(
    pull_mm: Array,
    bend_deg: Array,
    active_model: ActiveModel,
    training: TrainingOptions,
    own: AgentFile | None,
) -> VecEnv:
    """Return the environments of a training: one batch, or each in the wrappers of the user."""
    task = TrainingTask(pull_mm, bend_deg, training.noise, training.noise_level, training.initial_error_deg)
    make = partial(
        BatchEnvironment, task, active_model, reward_scale=training.reward_scale, agent=training.agent
    )
    environment: VecEnv
    if own is None or own.wrap is None:
        environment = make(count=training.environments)
    else:
        singles = [EstimationEnvironment(batch=make(count=1)) for _ in range(training.environments)]
        environment = wrapped_environments(singles, own.wrap)
    environment.seed(training.seed)
    return environment


def _without(configuration: dict[str, Any], name: str) -> dict[str, Any]:
    part, setting = name.split(".")
    kept = {key: value for key, value in configuration[part].items() if key != setting}
    return configuration | {part: kept}


def _check_goes_on(agent: BaseAlgorithm, run: "_Run", shorter: bool) -> None:
    if shorter and not agent.num_timesteps:
        raise InputError(
            f"{run.folder} holds a shorter run, whose {CHECKPOINT_FILE} is not of this version: "
            "choose another `folder`"
        )
    if agent.num_timesteps >= run.total + run.training.horizon:
        raise InputError(
            f"{run.folder} has gone on to {agent.num_timesteps} samples already: "
            f"ask for more than {run.total}"
        )


def _learn(agent: BaseAlgorithm, run: "_Run") -> None:
    if agent.num_timesteps < run.total:
        # Its own random numbers after each stop, not those of the beginning again.
        seed = int(np.random.SeedSequence([run.training.seed, agent.num_timesteps]).generate_state(1)[0])
        set_random_seed(seed)
        assert agent.env is not None
        agent.env.seed(seed)
        learn(agent, run.total - agent.num_timesteps, run, reset=False)


def learn(agent: BaseAlgorithm, samples: int, callback: BaseCallback, reset: bool = True) -> None:
    """Train for so many samples."""
    validates = torch.distributions.Distribution.set_default_validate_args
    validates(False)  # a tenth of the time: weights that are no numbers are found in the end
    try:
        agent.learn(samples, callback=callback, reset_num_timesteps=reset)
    finally:
        validates(True)
    check_finite(agent)


def export_policy(
    policy: torch.nn.Module, agent: str, active_model: ActiveModel, description: dict[str, Any], path: Path
) -> None:
    """Write one sample of an agent as ONNX: its filter, and the mean action of a trained policy."""
    step = POLICY_STEPS[agent](active_model, policy)
    state = dict.fromkeys(step.state, ()) | step.memory
    contents = {"agent": agent, START: step.start, **description}
    export_step(step, dict.fromkeys(step.inputs, ()), state, contents, path)


def check_finite(agent: BaseAlgorithm) -> None:
    """Refuse weights that are not numbers."""
    if not all(torch.isfinite(values).all() for values in agent.policy.parameters()):
        raise DivergedError(
            f"the training has diverged after {agent.num_timesteps} samples: lower `learning_rate`"
        )


class _Run(BaseCallback):
    """Learning curve of the finished episodes and, every so often, a checkpoint.

    Attributes:
        curve: rows of `progress.csv` by column: samples, mean reward per sample [deg^2] of as many finished
            episodes as there are environments, what stable-baselines3 logs of the latest update, and mean and
            standard deviation of each action.
    """

    def __init__(
        self,
        checkpoint: Path,
        key: str,
        agent: BaseAlgorithm,
        training: TrainingOptions,
        total: int,
        on_progress: OnProgress | None,
        held_out: VecEnv | None,
    ):
        super().__init__()
        self.checkpoint, self.folder, self.key = checkpoint, checkpoint.parent, key
        self.agent = agent
        self.training = training
        self.on_progress = on_progress
        self.total = total
        updates = math.ceil(self.total / training.horizon)
        self.between = math.ceil(updates / CHECKPOINTS) * training.horizon  # samples from one to the next
        self.saved = 0  # samples at the latest checkpoint
        self.held_out = held_out  # environments of other records
        self.held_out_reward: dict[str, float] = {}  # since the last row
        self.curve: list[dict[str, float]] = []
        self.update: dict[str, float] = {}
        self.episodes: list[dict[str, float]] = []  # finished since the last row
        self.actions: list[NDArray[np.float32]] = []

    def save(self) -> None:
        check_finite(self.agent)
        state = {"samples": self.agent.num_timesteps, "curve": self.curve, **self.agent.get_parameters()}
        save_checkpoint(self.checkpoint, self.key, state)
        self.saved = self.agent.num_timesteps

    def restore(self) -> None:
        state = load_checkpoint(self.checkpoint, self.key)
        if state is not None:
            try:
                self.agent.num_timesteps, self.curve = int(state.pop("samples")), list(state.pop("curve"))
                self.saved = self.agent.num_timesteps
                self.agent.set_parameters(state)
            except Exception as error:  # what does not fit, in classes of torch and stable-baselines3
                raise unusable(self.checkpoint) from error

    def write(self) -> None:
        columns = list(
            dict.fromkeys(["samples", "mean_reward", *(name for row in self.curve for name in row)])
        )
        write_curve(
            self.folder, [[row.get(name, math.nan) for name in columns] for row in self.curve], columns
        )

    @property
    def latest(self) -> float:
        """Mean reward per sample of the last episodes [deg^2]."""
        return self.curve[-1]["mean_reward"] if self.curve else math.nan

    def _on_rollout_start(self) -> None:
        self._take_update()
        if self.num_timesteps >= self.saved + self.between:
            self.save()
            self._meet_held_out()

    def _on_training_end(self) -> None:
        self._take_update()
        self._meet_held_out()
        if self.episodes:
            self._add_row()

    def _meet_held_out(self) -> None:
        """Keep, for the next row, the mean reward per sample [deg^2] of the mean actions on other records."""
        if self.held_out is None:
            return
        self.held_out.seed(self.training.seed)  # the same noise each time
        seen: Any = self.held_out.reset()
        state, began, rewards = None, np.ones(self.held_out.num_envs, bool), []
        for _ in range(HELD_OUT_SAMPLES):
            action, state = self.agent.predict(seen, state, began, deterministic=True)
            seen, reward, began, _ = self.held_out.step(action)
            rewards.append(reward.mean())
        self.held_out_reward["eval/mean_reward"] = float(np.mean(rewards)) / self.training.reward_scale

    def _take_update(self) -> None:
        logged = self.logger.name_to_value
        if any(name.startswith("train/") for name in logged):
            self.update = {name: float(of) for name, of in logged.items() if name.startswith("train/")}

    def _on_step(self) -> bool:
        self.actions.append(np.clip(self.locals["actions"], -1, 1))
        self.episodes += [info["episode"] for info in self.locals["infos"] if "episode" in info]
        if len(self.episodes) >= self.training.environments:
            self._add_row()
            if self.on_progress:
                self.on_progress(min(self.num_timesteps, self.total - 1), self.total, self.latest)
        return True

    def _add_row(self) -> None:
        rewards, lengths = ([float(of[name]) for of in self.episodes] for name in ("r", "l"))
        acted = np.concatenate(self.actions)
        row = {"samples": self.num_timesteps, "mean_reward": sum(rewards) / sum(lengths)}
        row |= {
            "rollout/ep_rew_mean": float(np.mean(rewards)),
            "rollout/ep_len_mean": float(np.mean(lengths)),
        }
        row |= self.update | self.held_out_reward
        for name, of in zip(ACTIONS[self.training.agent], acted.T, strict=True):
            row |= {f"action/{name}": float(of.mean()), f"action/{name}, deviation": float(of.std())}
        self.curve.append(row)
        self.episodes, self.actions, self.held_out_reward = [], [], {}
        self.write()


for _method in (RAM, DIRECT):
    register_trainer(Trainer(_method, train_policy, unit="samples"))
