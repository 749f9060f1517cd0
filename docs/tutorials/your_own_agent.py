# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Your own agent
#
# You will train SAC instead of the paper's PPO on the task of RAM, deploy it as a file that needs no torch, and compare both. The training runs are short, so that the page runs in a minute.

# %%
import subprocess
from pathlib import Path

import gymnasium
import rl  # noqa: F401  it registers the environments
import twin

# %% [markdown]
# ## The task
#
# `import rl` makes the environment known. An observation is the residual of the active model, in units of $\sqrt{R}$ and on a logarithmic scale. An action has two numbers in [-1, 1]:
# the gain on the residual, of the angle (0 to 1) and of the model's error (0 to 1 per second). The reward is minus the square error [deg²].

# %%
environment = gymnasium.make("EndoTwin/Estimation-v0")
print(environment.observation_space.shape, environment.action_space.shape)
# > (1,) (2,)

# %% [markdown]
# ## An agent file
#
# A Python file defines what learns: an algorithm of stable-baselines3 or sb3-contrib, or a module of torch that you have trained. `wrap` may change the reward by any wrapper of Gymnasium, and the observation by a module, which is deployed with the policy.

# %%
Path("my_agent.py").write_text("""
import gymnasium
from stable_baselines3 import SAC

def wrap(environment):
    return gymnasium.wrappers.TransformReward(environment, lambda reward: -abs(reward) ** 0.5)

def make_agent(environment, seed):
    return SAC("MlpPolicy", environment, seed=seed, gamma=0.9, policy_kwargs={"net_arch": [32, 32]})
""")


def endotwin(words: str) -> None:
    """Run a command as it would be typed, and print its last line."""
    done = subprocess.run(f"endotwin {words}", shell=True, check=True, capture_output=True, text=True)
    print(done.stdout.strip().splitlines()[-1])


endotwin("generate --stroke 2 4 --episodes 2 --seconds 20 --seed 1 --out data/train")
endotwin("generate --stroke -1 1 --episodes 2 --seconds 20 --seed 2 --out data/test")
endotwin("identify data/train --out coleman_hodgdon.json")
learn = "train data/train --model coleman_hodgdon.json --environments 8 --episodes 16"
endotwin(f"{learn} --agent-file my_agent.py --out runs/mine")
endotwin(f"{learn} --agent ram --out runs/ram")
# > data/train: 2 episodes, 40 s of ureteroscope
# > data/test: 2 episodes, 40 s of ureteroscope
# > coleman_hodgdon.json: a_per_mm = 1.255, b_deg_per_mm = 22.37, c_deg_per_mm = 4.768, c_over_b = 0.2132, monotone = no, RMSE 0.858 deg over 2 records
# > runs/mine/policy.onnx: ram with my_agent.py trained on 2 records
# > runs/ram/policy.onnx: ram trained on 2 records

# %% [markdown]
# ## Comparison
#
# Both files contain the estimator of one sample, so `evaluate`, `gate` and `run` accept both. `policy.onnx` needs no torch.

# %%
filters = {name: twin.load_estimator(f"runs/{name}/policy.onnx") for name in ("mine", "ram")}
for score in twin.evaluate("data/test", filters, suite="paper-only", seeds=2):
    print(f"{score.noise} {score.level:g}: {score.method} {score.rmse_deg:.2f} deg RMSE")
# > gaussian 1: mine 0.99 deg RMSE
# > gaussian 1: ram 0.99 deg RMSE
# > gaussian 5: mine 1.64 deg RMSE
# > gaussian 5: ram 1.64 deg RMSE
# > poisson 0.1: mine 0.79 deg RMSE
# > poisson 0.1: ram 0.78 deg RMSE
# > poisson 1: mine 1.41 deg RMSE
# > poisson 1: ram 1.44 deg RMSE
# > poisson 2: mine 2.32 deg RMSE
# > poisson 2: ram 2.36 deg RMSE

# %% [markdown]
# `endotwin evaluate --policy runs/mine/policy.onnx ... --methods RAM "Own agent"` puts it into the tables and figures. [my_agent.py](../examples/my_agent.py) also bounds the observation.
