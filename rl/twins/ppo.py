"""PPO on the policy of RAM (twins): the same network, sequences and loss, without the gradient of the filter.

Schulman et al. (2017) by stable-baselines3, with the discount and the clip factor of the paper's Table I. It
begins with the weights that the step has, be they untrained, and explores around them. With the 1024 samples
of Table I between two updates it loses what it began with: what an action is worth drowns in what noise and
twins differ by, and the policy drifts. Here they are 25 times as many.
"""

import math

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from rl.options import TrainingOptions
from rl.training import learn, new_ppo
from rl.twins.environment import TwinsEnvironment
from rl.twins.run import VALIDATIONS, OnShare, OnWeights
from rl.twins.sequences import SequenceSource
from rl.twins.settings import PPO_HORIZON, TwinsTraining
from rl.twins.step import TwinsStep

ENVIRONMENTS, MINIBATCH = 256, 2_560
# From scratch, and from what back-propagation found: the rate of Adam, the latter that of Table I, and the
# deviation of the actions at the start, of which 1 is 4 of a gain's logarithm.
FROM_SCRATCH, FROM_THERE = (1e-3, 0.15), (2.5e-4, 0.1)


def learn_by_ppo(
    step: TwinsStep,
    source: SequenceSource,
    settings: TwinsTraining,
    on_share: OnShare,
    on_weights: OnWeights,
) -> None:
    """Train the policy of a step; what else it holds stays.

    Args:
        step: filter and policy.
        source: of the sequences.
        settings: of the training.
        on_share: told how many samples of how many are done.
        on_weights: told the same from time to time, when the step has the weights of then.

    Raises:
        FloatingPointError: the training has diverged.
    """
    rate, explores = FROM_THERE if "analytic" in settings.gain else FROM_SCRATCH
    options = TrainingOptions(
        learning_rate=rate,
        environments=ENVIRONMENTS,
        horizon=PPO_HORIZON,
        minibatch=MINIBATCH,
        seed=settings.seed,
    )
    environment = TwinsEnvironment(step, source, settings, options.environments, options.reward_scale)
    widths = [part.out_features for part in step.policy.children() if isinstance(part, torch.nn.Linear)]
    ppo = new_ppo(environment, options, widths[:-1])  # the last is that of the actions
    with torch.no_grad():
        for theirs, own in _shared(ppo, step):
            theirs.copy_(own)
        ppo.policy.log_std.fill_(math.log(explores))
    learn(ppo, settings.ppo_samples, _Watch(step, settings.ppo_samples, on_share, on_weights))


def _shared(ppo: PPO, step: TwinsStep) -> list[tuple[torch.Tensor, torch.Tensor]]:
    """Return the weights of PPO's policy, each beside that of the step."""
    layers = [*ppo.policy.mlp_extractor.policy_net, ppo.policy.action_net]
    theirs = [values for layer in layers for values in layer.parameters()]
    return list(zip(theirs, step.policy.parameters(), strict=True))


class _Watch(BaseCallback):
    """Hands the weights to the step from time to time, and tells of it."""

    def __init__(self, step: TwinsStep, total: int, on_share: OnShare, on_weights: OnWeights):
        super().__init__()
        self.step, self.total, self.on_share, self.on_weights = step, total, on_share, on_weights
        self.next = total / VALIDATIONS

    def _on_rollout_start(self) -> None:
        self._tell()

    def _on_training_end(self) -> None:
        self.next = 0.0  # whatever has been told
        self._tell()

    def _tell(self) -> None:
        self.on_share(min(self.num_timesteps, self.total), self.total)
        if self.num_timesteps < self.next:
            return
        self.next = self.num_timesteps + self.total / VALIDATIONS
        with torch.no_grad():
            for theirs, own in _shared(self.model, self.step):  # type: ignore[arg-type]
                own.copy_(theirs)
        self.on_weights(self.num_timesteps)

    def _on_step(self) -> bool:
        return True
