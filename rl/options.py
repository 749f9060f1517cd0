"""Options of a training: the paper's Table I and its protocol, checked before any work."""

import dataclasses

from twin.errors import InputError
from twin.estimation.registry import find_training, proposed_method

EPISODES = 2000  # the paper's number of episodes
ALGORITHMS = ("ppo", "sac", "td3")  # of stable-baselines3 that need no agent file
PAPER_SAMPLE_TIME = 0.1  # T that `horizon` and `minibatch` refer to [s]
TRAINING_STROKE_MM = (2.0, 4.0)  # the paper's stroke in training


@dataclasses.dataclass(frozen=True)
class TrainingOptions:
    """Options of a training. Defaults are the paper's Table I and its protocol."""

    agent: str = ""  # of the method table; the one that the paper proposes, if not given
    algorithm: str = "ppo"  # one of `ALGORITHMS`
    network: tuple[int, ...] = (64, 64)  # units of each layer of a policy
    agent_file: str = ""  # program of the user that makes the agent, in place of algorithm and network
    held_out: str = ""  # folder of recordings that the learning curve is drawn on too
    # episodes of PPO in all; a network takes as large a share of its own steps as this is of the default
    episodes: int = EPISODES
    learning_rate: float = 2.5e-4  # of Adam; of PPO, in the first half of a training
    horizon: int = 1024  # samples between two updates, over all environments, at T = 0.1 s; see `at`
    discount: float = 0.99  # discount factor gamma
    minibatch: int = 128  # samples in one gradient step, at T = 0.1 s
    clip: float = 0.2  # clip factor of PPO
    environments: int = 16  # episodes that run side by side
    # factor on eq. 11 in PPO. It moves no optimum; it keeps the loss of the value function, which shares a
    # clipped gradient with the policy, of the order of one
    reward_scale: float = 0.05
    noise: str = "gaussian"  # measurement noise during training
    noise_level: float = 0.1  # its level: R = 0.1 in the paper
    error_scale: float = 0.3  # smallest share of their departure from the model that records are met with
    initial_error_deg: float = 20.0  # the initial estimate is off by up to this [deg]
    seed: int = 0  # of the network, the exploration and the noise

    def __post_init__(self) -> None:
        if not self.agent:
            object.__setattr__(self, "agent", proposed_method().agent)
        find_training(self.agent)
        if self.algorithm not in ALGORITHMS:
            raise InputError(f"unknown algorithm {self.algorithm!r}; valid: {', '.join(ALGORITHMS)}")
        if len(self.network) > 8 or not all(1 <= width <= 1024 for width in self.network):
            raise InputError(f"network {self.network}: must be at most 8 layers of 1 to 1024 units")
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if isinstance(low, int) and not (isinstance(value, int) and not isinstance(value, bool)):
                raise InputError(f"{name} = {value!s:.40}: must be a whole number")
            if not low <= value <= high:
                raise InputError(f"{name} = {value!s:.40}: must be at least {low:g} and at most {high:g}")
        import numpy as np  # here: the help of a command needs none of it

        from twin.signals.noise import draw_noise

        draw_noise(self.noise, self.noise_level, (1,), np.random.default_rng(0))
        if self.horizon % self.environments or self.horizon % self.minibatch:
            raise InputError(
                f"horizon = {self.horizon}: must be a multiple of environments = {self.environments} "
                f"and of minibatch = {self.minibatch}"
            )

    def at(self, sample_time: float) -> "TrainingOptions":
        """Return the options of PPO at T [s]: an update spans as much time as at T = 0.1 s.

        The noise of neighbouring samples averages out over a time: with as many samples at 50 Hz, an update
        would see a fifth of it.
        """
        times = max(round(PAPER_SAMPLE_TIME / sample_time), 1)
        return dataclasses.replace(self, horizon=times * self.horizon, minibatch=times * self.minibatch)


LIMITS: dict[str, tuple[int, int] | tuple[float, float]] = {
    "episodes": (1, 1_000_000),
    "horizon": (1, 2**20),
    "minibatch": (2, 2**20),
    "environments": (1, 4096),
    "seed": (0, 2**32 - 1),
    "learning_rate": (1e-12, 1.0),
    "discount": (1e-6, 1.0),
    "clip": (1e-6, 1e3),
    "reward_scale": (1e-12, 1e6),
    "noise_level": (1e-12, 1e6),
    "initial_error_deg": (0.0, 360.0),
    "error_scale": (1e-3, 1.0),
}
"""Least and greatest value of each number: what is beyond would not end, or not fit into memory."""
_MOST_MEASUREMENTS = 200_000_000  # that are drawn at once, eight bytes each


def check_memory(options: TrainingOptions, samples: int) -> None:
    """Refuse more measurements at once than fit into memory."""
    if options.environments * samples > _MOST_MEASUREMENTS:
        most = _MOST_MEASUREMENTS // samples
        raise InputError(
            f"environments = {options.environments}: must be at most {most} for records of {samples} samples"
        )


def share_of(iterations: int, options: TrainingOptions) -> int:
    """Return the gradient steps of a network, scaled as the episodes are to the paper's number."""
    return max(round(iterations * options.episodes / EPISODES), 1)
