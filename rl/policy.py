"""A trained policy: running one needs neither torch nor stable-baselines3; exporting one does."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.estimation.learned.direct import ANGLE_LIMIT_DEG, DIRECT, DirectEstimator
from twin.estimation.learned.policy import Agent, Policy, load_policy
from twin.estimation.learned.ram import ERROR_GAIN_LIMIT, RAM, ReinforcementActiveModel

if TYPE_CHECKING:
    from stable_baselines3 import PPO

__all__ = ["Policy", "export_policy", "load_policy"]

AGENTS: dict[str | None, type[Agent]] = {RAM.agent: ReinforcementActiveModel, DIRECT.agent: DirectEstimator}
"""Agents that a policy steers, by their words on the command line."""


def export_policy(ppo: "PPO", agent_name: str, configuration: dict[str, Any], path: Path) -> None:
    """Write a trained policy as ONNX, whole or not at all: from what its agent senses to what it applies."""
    import torch

    from rl.export import export_module

    def log_scale(angle: torch.Tensor) -> torch.Tensor:
        return torch.sign(angle) * torch.log1p(torch.abs(angle))

    def ram_amounts(action: torch.Tensor) -> torch.Tensor:
        return (action + 1) * torch.tensor([0.5, ERROR_GAIN_LIMIT / 2])

    def direct_scaled(sensed: torch.Tensor) -> torch.Tensor:
        return torch.stack([log_scale(sensed[:, 0]), sensed[:, 1] * 10], dim=1)

    def direct_amounts(action: torch.Tensor) -> torch.Tensor:
        change = action * math.log1p(ANGLE_LIMIT_DEG)
        return torch.sign(change) * torch.expm1(torch.abs(change))

    # `Agent.scaled` and `Agent.amounts` of each, in torch; a test holds them together.
    scaled, amounts = {
        RAM.agent: (log_scale, ram_amounts),
        DIRECT.agent: (direct_scaled, direct_amounts),
    }[agent_name]

    class MeanAction(torch.nn.Module):
        """The network with its scales and bounds, without value function and exploration."""

        def __init__(self) -> None:
            super().__init__()
            self.hidden = ppo.policy.mlp_extractor.policy_net
            self.mean = ppo.policy.action_net

        def forward(self, sensed: torch.Tensor) -> torch.Tensor:
            return amounts(self.mean(self.hidden(scaled(sensed))).clamp(-1, 1))

    agent = AGENTS[agent_name]
    sizes = torch.logspace(-2, 2, 8)  # on either side of zero, from next to nothing to a first error
    reference = torch.cat([-sizes, sizes])[:, None].repeat(1, len(agent.sensed))
    export_module(
        MeanAction(),
        {"sensed": torch.zeros(2, len(agent.sensed))},
        ["applied"],
        {"sensed": [0]},
        {
            "agent": agent_name,
            "sensed": dict(agent.sensed),
            "applied": dict(agent.applied),
            **configuration,
        },
        path,
        reference={"sensed": reference[None]},
    )
