"""Options of a training: the paper's Table I and its protocol, checked before any work."""

import dataclasses
import math

import numpy as np

from twin.estimation.registry import find_trainable, proposed_method
from twin.signals.noise import draw_noise

EPISODES = 2000
"""The paper's number of episodes."""


@dataclasses.dataclass(frozen=True)
class TrainingOptions:
    """Options of a training. Defaults are the paper's Table I and its protocol."""

    agent: str = ""
    """Of the method table; the one that the paper proposes, if not given."""
    episodes: int = EPISODES
    """Episodes of PPO in all; a network takes as large a share of its own steps as this is of the default."""
    learning_rate: float = 2.5e-4
    """Of Adam."""
    horizon: int = 1024
    """Samples between two updates, over all environments."""
    discount: float = 0.99
    """Discount factor gamma."""
    minibatch: int = 128
    """Samples in one gradient step."""
    clip: float = 0.2
    """Clip factor of PPO."""
    environments: int = 32
    """Episodes that run side by side."""
    reward_scale: float = 0.05
    """Factor on eq. 11 in PPO. It moves no optimum; it keeps the loss of the value function, which
    shares a clipped gradient with the policy, of the order of one."""
    noise: str = "gaussian"
    """Measurement noise during training."""
    noise_level: float = 0.1
    """Its level: R = 0.1 in the paper."""
    initial_error_deg: float = 20.0
    """The initial estimate is off by up to this [deg]."""
    seed: int = 0
    """Of the network, the exploration and the noise."""

    def __post_init__(self) -> None:
        """Refuse a training that cannot run.

        Raises:
            ValueError: a number is out of range, or the horizon does not divide evenly.
        """
        if not self.agent:
            object.__setattr__(self, "agent", proposed_method().agent)
        find_trainable(self.agent)
        for name in _POSITIVE:
            if not 0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} = {getattr(self, name)}: must be positive and finite")
        if not 0 <= self.initial_error_deg < math.inf:
            raise ValueError(f"initial_error_deg = {self.initial_error_deg}: must be finite, not negative")
        if self.minibatch < 2:
            raise ValueError(f"minibatch = {self.minibatch}: must be at least 2")
        draw_noise(self.noise, self.noise_level, (1,), np.random.default_rng(0))
        if not 0 < self.discount <= 1:
            raise ValueError(f"discount = {self.discount}: must be above 0 and at most 1")
        if self.horizon % self.environments or self.horizon % self.minibatch:
            raise ValueError(
                f"horizon = {self.horizon}: must be a multiple of environments = {self.environments} "
                f"and of minibatch = {self.minibatch}"
            )


_POSITIVE = (
    "episodes",
    "learning_rate",
    "horizon",
    "minibatch",
    "clip",
    "environments",
    "noise_level",
    "reward_scale",
)


def share_of(iterations: int, options: TrainingOptions) -> int:
    """Return the gradient steps of a network, scaled as the episodes are to the paper's number."""
    return max(round(iterations * options.episodes / EPISODES), 1)
