"""Everything learned: agents, environments, PPO training, policies in ONNX, and the LSTM baseline."""

from rl.environment import register_environments

register_environments()
