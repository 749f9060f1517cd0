"""Estimation on simulated twins as an environment: RAM (twins) with a policy from outside."""

from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray

from rl.environment import SharedEnvironment
from rl.supervised import tensor32
from rl.twins.balance import SMALLEST_ERROR_DEG2, TypicalErrors, departure
from rl.twins.filter_step import ALL
from rl.twins.learning import filter_sequences
from rl.twins.sequences import SequenceSource
from rl.twins.settings import SimulatedTraining
from rl.twins.step import ACTIONS, TwinsStep
from twin.signals.streams import SeedUse, random_stream

LARGEST_ACTION = 3.0  # tanh(3) = 0.995 of what an action reaches

Array32 = NDArray[np.float32]


class TwinsEnvironment(SharedEnvironment):
    """Sequences of `rl.twins.sequences` side by side; an action is that of the policy of RAM (twins).

    The reward of a sample is minus its share of the loss that back-propagation takes the gradient of: its
    square error, balanced over families and windows, and what departs from the linear update where that is
    best. Recogniser and filter are those of the step, and do not learn.
    """

    def __init__(
        self, step: TwinsStep, source: SequenceSource, settings: SimulatedTraining, count: int, scale: float
    ):
        """Meet every sample time once, so that rewards are balanced from the start.

        Args:
            step: the filter.
            source: of the sequences.
            settings: of the training.
            count: sequences side by side.
            scale: factor on the reward.
        """
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
        """Predict the next sample and return what the policy sees of it."""
        drawn, sample = self.drawn, self.sample
        if sample % self.settings.window == 0:
            self.squares = torch.zeros(self.num_envs)
            self.factors = self.typical.factors(drawn, sample // self.settings.window)
        members, way = (of[sample] for of in drawn.inputs)
        self.predicted = self.filter_step.predict(
            members,
            way,
            drawn.measurement_deg[sample],
            drawn.variance,
            drawn.sample_time,
            ALL,
            self.state,
        )
        self.seen: Array32 = self.predicted.features.numpy()
        return self.seen

    @torch.no_grad()
    def _advance(self, action: torch.Tensor) -> Array32:
        """Return the reward (count,) of an action."""
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
