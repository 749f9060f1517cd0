"""Training of a tracking policy by PPO on `EndoTwin/Tracking-v0`, into one ONNX file that `ppo` runs.

The endoscopes are reduced and another one is drawn for every episode; the parallel environments divide the
strokes among them, so that one policy serves all strokes.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rl.trainers import OnProgress
from twin.control.controllers.ppo import AGENT, ERROR_DEG, INPUT, OBSERVED, OUTPUT
from twin.files.bounds import check_between

if TYPE_CHECKING:
    import gymnasium
    from stable_baselines3 import PPO

_REPORTED = 100  # episodes that the mean reward is of


@dataclasses.dataclass(frozen=True)
class TrackingTraining:
    """Settings of a training."""

    samples: int = 400_000  # of all environments together
    strokes_mm: tuple[tuple[float, float], ...] = ((-1.0, 1.0), (2.0, 4.0))  # of the work, taken in turn [mm]
    environments: int = 4  # that run side by side
    horizon: int = 1024  # samples of each between two updates
    minibatch: int = 256  # samples in one gradient step
    discount: float = 0.97  # factor of PPO
    log_std: float = -2.0  # of the first exploration; -2 is 0.14 of the speed limit, as an offset sums it up
    sample_time: float = 0.02  # T [s]
    speed_mm_s: float = 5.0  # fastest change of the command [mm / s]
    noise_variance: float = 1.0  # R of the sensor [deg^2]
    seed: int = 0  # of network, exploration, endoscopes, references and noise

    def __post_init__(self) -> None:
        """Refuse what PPO cannot train on; the environments check the rest."""
        check_between("samples", self.samples, 1, 10**9)
        check_between("environments", self.environments, len(self.strokes_mm) or 1, 1000)
        check_between("horizon", self.horizon, 2, 10**6)
        check_between("seed", self.seed, 0, 2**32 - 1 - self.environments)


def train_tracking(
    path: Path,
    preset: str = "ureteroscope",
    training: TrackingTraining | None = None,
    on_progress: OnProgress | None = None,
) -> float:
    """Train a policy and write it, complete or not at all; returns the mean reward [deg^2]."""
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.logger import Logger
    from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

    from rl.tracking import TrackingEnvironment

    settings = training or TrackingTraining()
    torch.set_num_threads(1)  # the networks are small: threads would only wait for each other

    def make(number: int) -> "Callable[[], gymnasium.Env[Any, Any]]":
        return functools.partial(
            TrackingEnvironment,
            preset,
            randomized=True,
            stroke_mm=settings.strokes_mm[number % len(settings.strokes_mm)],
            speed_mm_s=settings.speed_mm_s,
            noise_variance=settings.noise_variance,
            sample_time=settings.sample_time,
            physics="reduced",
        )

    makers = [make(number) for number in range(settings.environments)]
    ppo = PPO(
        "MlpPolicy",
        VecMonitor(DummyVecEnv(makers)),
        n_steps=settings.horizon,
        batch_size=settings.minibatch,
        gamma=settings.discount,
        policy_kwargs={"log_std_init": settings.log_std},
        stats_window_size=_REPORTED,
        seed=settings.seed,
        device="cpu",
    )
    ppo.set_logger(Logger(folder=None, output_formats=[]))  # its own makes a folder elsewhere

    def tell(local: dict[str, Any], _: dict[str, Any]) -> bool:
        if on_progress is not None and ppo.num_timesteps < settings.samples:
            on_progress(ppo.num_timesteps, settings.samples, _mean_reward_deg2(ppo))
        return True

    ppo.learn(settings.samples, callback=tell)
    reward = _mean_reward_deg2(ppo)
    path.parent.mkdir(parents=True, exist_ok=True)
    more = {"preset": preset, "mean_reward_deg2": None if math.isnan(reward) else reward}
    export_actor(ppo, dataclasses.asdict(settings) | more, path)
    if on_progress is not None:
        on_progress(settings.samples, settings.samples, reward)
    return reward


def export_actor(ppo: "PPO", description: dict[str, Any], path: Path) -> None:
    """Write the deterministic actor of PPO as ONNX: from an observation to an action within [-1, 1]."""
    import torch

    from rl.algorithms import policy_of
    from rl.export import export_module

    export_module(
        torch.nn.Sequential(policy_of(ppo), torch.nn.Hardtanh()),
        {INPUT: torch.zeros(2, OBSERVED)},
        [OUTPUT],
        {INPUT: [0]},
        {"agent": AGENT, **description},
        path,
    )


def _mean_reward_deg2(ppo: "PPO") -> float:
    """Return the mean reward per sample of the latest episodes [deg^2]; NaN before one is over."""
    episodes = ppo.ep_info_buffer or ()
    samples = sum(episode["l"] for episode in episodes)
    if not samples:
        return math.nan
    return float(ERROR_DEG**2 * sum(episode["r"] for episode in episodes) / samples)
