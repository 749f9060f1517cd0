"""A trained policy: running one needs neither torch nor stable-baselines3; exporting one does."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.estimation.learned.policy import Policy, load_policy

if TYPE_CHECKING:
    from stable_baselines3 import PPO

__all__ = ["Policy", "export_policy", "load_policy"]


def export_policy(ppo: "PPO", agent_name: str, configuration: dict[str, Any], path: Path) -> None:
    """Write the mean action of a trained policy, clipped to [-1, 1], as ONNX, whole or not at all."""
    import torch

    from rl.export import export_module

    class MeanAction(torch.nn.Module):
        """The network from observation to clipped mean action, without value function and exploration."""

        def __init__(self) -> None:
            super().__init__()
            self.hidden = ppo.policy.mlp_extractor.policy_net
            self.mean = ppo.policy.action_net

        def forward(self, observation: torch.Tensor) -> torch.Tensor:
            clipped: torch.Tensor = self.mean(self.hidden(observation)).clamp(-1, 1)
            return clipped

    size = ppo.observation_space.shape[0]  # type: ignore[index]
    export_module(
        MeanAction(),
        {"observation": torch.zeros(2, size)},
        ["action"],
        {"observation": [0]},
        {"agent": agent_name, **configuration},
        path,
    )
