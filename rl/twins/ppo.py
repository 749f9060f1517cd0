"""PPO on the policy of RAM (twins): the same network, sequences and loss, without the gradient of the filter.

Schulman et al. (2017) by stable-baselines3, with the discount and the clip factor of the paper's Table I. It
begins with the weights that the step has, be they untrained, and explores around them. With the 1024 samples
of Table I between two updates it loses what it began with: what an action is worth drowns in what noise and
twins differ by, and the policy drifts. Here they are 25 times as many.
"""

import math
from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from rl.algorithms import new_ppo
from rl.environment import SharedEnvironment
from rl.options import TrainingOptions
from rl.supervised import tensor32
from rl.training import learn
from rl.twins.filter_step import ALL
from rl.twins.learning import SMALLEST_ERROR_DEG2, TypicalErrors, departure, filter_sequences
from rl.twins.records import SequenceSource
from rl.twins.run import VALIDATIONS, OnShare, OnWeights
from rl.twins.settings import PPO_HORIZON, SimulatedTraining, TwinsTraining
from rl.twins.step import ACTIONS, TwinsStep
from twin.signals.streams import SeedUse, random_stream

LARGEST_ACTION = 3.0  # tanh(3) = 0.995 of what an action reaches

Array32 = NDArray[np.float32]


class TwinsEnvironment(SharedEnvironment):
    """Sequences of `rl.twins.records` side by side; an action is that of the policy of RAM (twins).

    The reward of a sample is minus its share of the loss that back-propagation takes the gradient of: its
    square error, balanced over families and windows, and what departs from the linear update where that is
    best. Recogniser and filter are those of the step, and do not learn.
    """

    def __init__(
        self, step: TwinsStep, source: SequenceSource, settings: SimulatedTraining, count: int, scale: float
    ):
        actions = gymnasium.spaces.Box(-LARGEST_ACTION, LARGEST_ACTION, (ACTIONS,))
        super().__init__(count, gymnasium.spaces.Box(-np.inf, np.inf, (step.seen,)), actions)
        self.filter_step, self.source, self.settings, self.scale = step, source, settings, scale
        self.length = settings.windows * settings.window
        self.seed(settings.seed)
        self.typical = TypicalErrors(settings)
        for stride in source.strides:
            met = source.draw(settings.sequences, self.length, self.rng, stride)
            with torch.no_grad():
                bends = [output.bend_deg for output, _ in filter_sequences(step, met, ALL)]
            squares = (torch.stack(bends) - met.truth_deg) ** 2 + SMALLEST_ERROR_DEG2
            for place, window in enumerate(squares.split(settings.window)):
                self.typical.meet(window.mean(dim=0), met, place)

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Restart the random numbers of all sequences."""
        self.rng = np.random.default_rng() if seed is None else random_stream(seed, SeedUse.LESSON_EXPLORING)
        return [seed] * self.num_envs

    def reset(self) -> Array32:
        """Draw new sequences; returns (count, step.seen) what the policy sees."""
        self.drawn = self.source.draw(self.num_envs, self.length, self.rng)
        self.state = self.filter_step.start(self.drawn.variance)
        self.sample = 0
        self.episode_return = np.zeros(self.num_envs)
        return self._observe()

    def step_wait(self) -> tuple[Array32, Array32, NDArray[np.bool_], list[dict[str, Any]]]:
        """Apply the actions; sequences end together, truncated, and others begin."""
        reward = self._advance(tensor32(self.actions))
        self.episode_return += reward
        ended = np.full(self.num_envs, self.sample == self.length)
        infos = self._infos(ended, self.seen, np.full(self.num_envs, self.sample))
        observation = self.reset() if ended.all() else self._observe()
        return observation, self.scale * reward, ended, infos

    @torch.no_grad()
    def _observe(self) -> Array32:
        drawn, sample = self.drawn, self.sample
        if sample % self.settings.window == 0:
            self.squares = torch.zeros(self.num_envs)
            self.factors = self.typical.factors(drawn, sample // self.settings.window)
        members, way = (of[sample] for of in drawn.inputs)
        self.predicted = self.filter_step.predict(
            members, way, drawn.measurement_deg[sample], drawn.variance, drawn.sample_time, ALL, self.state
        )
        self.seen: Array32 = self.predicted.features.numpy()
        return self.seen

    @torch.no_grad()
    def _advance(self, action: torch.Tensor) -> Array32:
        drawn, window = self.drawn, self.settings.window
        output, self.state = self.filter_step.update(self.predicted, action)
        square = (output.bend_deg - drawn.truth_deg[self.sample]) ** 2 + SMALLEST_ERROR_DEG2
        lost = self.factors * square + self.settings.linear_penalty * departure(output.action, drawn.linear)
        self.squares += square
        self.sample += 1
        if self.sample % window == 0:
            self.typical.meet(self.squares / window, drawn, self.sample // window - 1)
        reward: Array32 = -lost.numpy()
        return reward


ENVIRONMENTS, MINIBATCH = 256, 2_560
# From scratch, and from what back-propagation found: the rate of Adam, the latter that of Table I, and the
# deviation of the actions at the start, of which 1 is 4 of a gain's logarithm.
FROM_SCRATCH, FROM_THERE = (1e-3, 0.15), (2.5e-4, 0.1)


def learn_by_ppo(
    step: TwinsStep, source: SequenceSource, settings: TwinsTraining, on_share: OnShare, on_weights: OnWeights
) -> None:
    """Train the policy of a step; what else it holds stays."""
    rate, explores = FROM_THERE if "analytic" in settings.gain else FROM_SCRATCH
    widths = [part.out_features for part in step.policy.children() if isinstance(part, torch.nn.Linear)]
    options = TrainingOptions(
        learning_rate=rate,
        environments=ENVIRONMENTS,
        horizon=PPO_HORIZON,
        minibatch=MINIBATCH,
        network=tuple(widths[:-1]),  # the last is that of the actions
        seed=settings.seed,
    )
    environment = TwinsEnvironment(step, source, settings, options.environments, options.reward_scale)
    ppo = new_ppo(environment, options, epochs=10)
    with torch.no_grad():
        for theirs, own in _shared(ppo, step):
            theirs.copy_(own)
        ppo.policy.log_std.fill_(math.log(explores))
    learn(ppo, settings.ppo_samples, _Watch(step, settings.ppo_samples, on_share, on_weights))


def _shared(ppo: PPO, step: TwinsStep) -> list[tuple[torch.Tensor, torch.Tensor]]:
    layers = [*ppo.policy.mlp_extractor.policy_net, ppo.policy.action_net]
    theirs = [values for layer in layers for values in layer.parameters()]
    return list(zip(theirs, step.policy.parameters(), strict=True))


class _Watch(BaseCallback):
    """Copies the weights to the step from time to time, and reports."""

    def __init__(self, step: TwinsStep, total: int, on_share: OnShare, on_weights: OnWeights):
        super().__init__()
        self.step, self.total, self.on_share, self.on_weights = step, total, on_share, on_weights
        self.next = total / VALIDATIONS

    def _on_rollout_start(self) -> None:
        self._report()

    def _on_training_end(self) -> None:
        self.next = 0.0  # report once more
        self._report()

    def _report(self) -> None:
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
