"""Measurements of what learns: cost of PPO's environment, of a sample, of a command, of a live stream."""

import statistics
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rl.algorithms import new_ppo
from rl.environment import PAPER_MODEL, BatchEnvironment, model_record
from rl.options import TrainingOptions
from rl.training import train_policy
from rl.twins.graph import export_twins
from rl.twins.members import draw_members
from rl.twins.noises import noise_models
from rl.twins.settings import TwinsTraining
from rl.twins.step import TwinsStep
from scripts.benchmarks.harness import SAMPLE_TIME, Result, in_turn, measurement, sinusoid
from scripts.benchmarks.live import control_step, one_live_sample, stream
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import KEY as DEPLOYMENT
from twin.estimation.deployment import prepare_deployment
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned import ram_twins
from twin.estimation.learned.trained_file import read_trained_file
from twin.identification.nominal import nominal_records
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced.members import members_to_dict

SAMPLES = 16 * TrainingOptions.horizon  # of PPO in one measurement
WHOLE_TRAINING = 1.2e6  # samples of the paper's 2000 episodes
T = 0.1  # [s]
SIDE_BY_SIDE, STEPS = 1024, 200  # episodes, and samples of each, of the batched environment

Array32 = NDArray[np.float32]


class IdleEnvironment(BatchEnvironment):
    """Environments that do nothing in a step: what is left is the cost of PPO itself."""

    def step_wait(self) -> tuple[Array32, Array32, NDArray[np.bool_], list[dict[str, Any]]]:
        """Return the first observation again, no reward, and the end of an episode with its record."""
        self.sample += 1
        ended = self.sample == self.task.pull_mm.shape[1]
        infos = self._infos(ended, self._last_observation, self.sample)
        self.sample[ended] = 1
        return self._last_observation, np.zeros(self.num_envs, np.float32), ended, infos


@measurement("environment")
def environment() -> Result:
    """Measure the batched environment of RAM."""
    task = TrainingTask(*stack_records([model_record(PAPER_MODEL, T)]))
    batch = BatchEnvironment(task, ActiveModel(PAPER_MODEL, T), SIDE_BY_SIDE, 1)
    actions = np.zeros((SIDE_BY_SIDE, 2), np.float32)
    batch.reset()
    begun = time.process_time()
    for _ in range(STEPS):
        batch.step(actions)
    rate = SIDE_BY_SIDE * STEPS / (time.process_time() - begun)
    return Result("batched environment of RAM, one core", rate, "steps/s", ">= 200000")


@measurement("ppo")
def ppo() -> dict[str, Result]:
    """Measure PPO in the environment of the paper's RAM, against one that does nothing."""
    options = TrainingOptions(seed=1)
    active_model = ActiveModel(PAPER_MODEL, T)
    pull, bend = stack_records([model_record(PAPER_MODEL, T)])
    torch.set_num_threads(1)
    ours, idle = (
        new_ppo(
            kind(TrainingTask(pull, bend), active_model, options.environments, 1, options.reward_scale),
            options,
        )
        for kind in (BatchEnvironment, IdleEnvironment)
    )
    whole = WHOLE_TRAINING / SAMPLES
    took, nothing = (
        whole * seconds for seconds in in_turn(lambda: ours.learn(SAMPLES), lambda: idle.learn(SAMPLES))
    )
    name, peer, bar = "PPO, 1.2 M samples", "an environment that does nothing", "< 1.2 times it"
    return {
        "ppo_environment": Result(name, took, "s", bar, None, peer, nothing),
        "ppo_time": Result(name, took, "s", "< 150 s"),
    }


@measurement("ram_twins_online")
def one_sample(preset: Preset, ranges: Ranges, amplitude: float) -> Result:
    """Measure one sample of RAM (twins) with its members, on one core; an untrained one takes as long."""
    with tempfile.TemporaryDirectory() as folder:
        path = _untrained_twins(preset, ranges, Path(folder))
        estimator = ram_twins.load(read_trained_file(path)).with_sensor(Sensor(1.0))
    pull = sinusoid(amplitude, 8.0, 8)[:: round(T / SAMPLE_TIME), None] * 1e3
    measurement = np.random.default_rng(1).standard_normal((len(pull), 1))
    state = estimator.start(pull[0], measurement[0])
    took = []
    for k in range(1, len(pull)):
        begun = time.perf_counter()
        state = estimator.step(state, pull[k], pull[k - 1], measurement[k])
        took.append(time.perf_counter() - begun)
    median = 1e3 * statistics.median(took)
    of = f"one sample of RAM (twins), {len(estimator.twins.presets)} members"
    return Result(of, median, "ms", "< 1 ms")


@measurement("control_step")
def one_command(preset: Preset, ranges: Ranges) -> dict[str, Result]:
    """Measure one command by the inverse of RAM (twins)' members, on one core."""
    with tempfile.TemporaryDirectory() as folder:
        records = nominal_records(preset, TwinsTraining().stroke_mm, 1, T, 1)
        deployment = prepare_deployment(records, PAPER_MODEL, T, 1).to_dict()
        extra = {"preset": preset.to_dict(), DEPLOYMENT: deployment}
        return control_step(_untrained_twins(preset, ranges, Path(folder), extra), preset)


def _untrained_twins(
    preset: Preset, ranges: Ranges, folder: Path, extra: Mapping[str, Any] | None = None
) -> Path:
    """Write an untrained file of RAM (twins), with an extra description."""
    settings = TwinsTraining()
    members = draw_members(preset, ranges, settings.members, 1, moving=settings.moving)
    directions = torch.linalg.qr(torch.randn(settings.members, settings.rank))[0]
    step = TwinsStep(directions, noise_models(settings.noises)).eval()
    step.guarded = True
    description = {"agent": ram_twins.AGENT, "members": members_to_dict(members), **(extra or {})}
    path = folder / ram_twins.TRAINING.file
    export_twins(step, settings.members, description, path)
    return path


def _with_policy(measure: Callable[[Path], dict[str, Result]]) -> dict[str, Result]:
    """Measure something with the paper's RAM; one that has learned little takes as long."""
    options = TrainingOptions(episodes=16, environments=8, horizon=256, minibatch=64, seed=1)
    with tempfile.TemporaryDirectory() as folder:
        records = [model_record(PAPER_MODEL, T)]
        return measure(train_policy(records, ActiveModel(PAPER_MODEL, T), options, Path(folder)))


@measurement("run")
def run() -> dict[str, Result]:
    """Measure `endotwin run` with the paper's RAM."""
    return _with_policy(stream)


@measurement("runtime")
def runtime() -> dict[str, Result]:
    """Measure one sample of the paper's RAM, with fallback and monitor."""
    return _with_policy(one_live_sample)
