"""An agent of your own: SAC on EndoTwin's estimation task, with a reward and an observation of its own.

    endotwin train data/train --model coleman_hodgdon.json --agent-file my_agent.py --out runs/mine
    endotwin evaluate data/test --train data/train --model coleman_hodgdon.json --methods C-H AM "Own agent" \
        --policy runs/mine/policy.onnx --out results

`make_agent` may return any algorithm of stable-baselines3 or sb3-contrib, or a module of torch.
"""

import gymnasium
import torch
from stable_baselines3 import SAC

from rl.algorithms import ModuleObservation


def wrap(environment):
    """Reward the absolute error, and show the residual bounded: the module is deployed with the policy."""
    environment = ModuleObservation(environment, torch.nn.Hardtanh(-4.0, 4.0))
    return gymnasium.wrappers.TransformReward(environment, lambda reward: -(abs(reward) ** 0.5))


def make_agent(environment, seed):
    """Return the agent; it is trained for --episodes episodes."""
    return SAC("MlpPolicy", environment, gamma=0.9, seed=seed, policy_kwargs={"net_arch": [32, 32]})
