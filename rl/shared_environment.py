"""Environments side by side in one object, for stable-baselines3: base of those whose step is arithmetic."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv


class SharedEnvironment(VecEnv):
    """Many episodes side by side that share all but their state, and one source of random numbers `rng`."""

    rng: np.random.Generator
    episode_return: NDArray[np.float64]

    def __init__(self, count: int, observations: gymnasium.spaces.Box, actions: gymnasium.spaces.Box):
        self.render_mode = None  # asked for by the next line
        super().__init__(count, observations, actions)

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Take (count, action_size) actions."""
        self.actions = np.asarray(actions, dtype=float)

    def _infos(
        self, ended: NDArray[np.bool_], seen: NDArray[np.float32], length: NDArray[np.int64]
    ) -> list[dict[str, Any]]:
        """Return the infos of a step for stable-baselines3; an episode that ends is truncated.

        Args:
            ended: (count,) episodes that end now.
            seen: (count, observation_size) the last observations.
            length: (count,) samples of the episodes so far.
        """
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for place in np.flatnonzero(ended):
            infos[place] = {
                "TimeLimit.truncated": True,
                "terminal_observation": seen[place],
                "episode": {"r": float(self.episode_return[place]), "l": int(length[place]), "t": 0.0},
            }
        return infos

    def close(self) -> None:
        """Nothing to release."""

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Restart the random numbers of all environments."""
        self.rng = np.random.default_rng(seed)
        return [seed] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute, which all environments share."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute, which all environments share."""
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method once and return its result for every environment asked for."""
        return [getattr(self, method_name)(*args, **kwargs)] * len(list(self._get_indices(indices)))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No environment is wrapped."""
        return [False] * len(list(self._get_indices(indices)))
