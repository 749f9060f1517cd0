"""Tuning of filters on simulated twins: Q and the first P by likelihood, on what RAM (twins) learns from too.

A filter that is tuned on five records of one endoscope knows the error of its model there, and trusts it on
others. Here the measurements are those of randomised twins along commands on strokes of any width, half of
them in sheaths that move, under noise whose R is drawn anew and told.
"""

import dataclasses
from typing import Any

import numpy as np

from twin.errors import DivergedError, InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.tuning import LikelihoodFit, TrainingEpisodes, register_likelihood, tune_active_model
from twin.hysteresis import BoucWen, ColemanHodgdon
from twin.signals.streams import SeedUse, random_stream

TWINS = 32
SECONDS = 40.0
STROKE_MM = (-4.0, 4.0)
"""Ends of the widest stroke [mm]."""
NARROWEST_MM = 1.0
VARIANCES_DEG2 = (0.05, 8.0)
"""Least and largest R; drawn log-uniformly [deg^2]."""
INITIAL_ERROR_DEG = 20.0
"""The first estimate is off by up to this [deg]."""
_SAMPLE_TIME = 0.02


@dataclasses.dataclass(frozen=True)
class TwinsLikelihoodFit(LikelihoodFit):
    """Variances of an active model that make measurements of randomised twins most likely."""

    def find(self, knowledge: Knowledge) -> dict[str, Any]:
        """Return the variances by the names of the fields of `ActiveModel`.

        Raises:
            ValueError: it is not known what twins are drawn from.
        """
        episodes, variance = draw_twin_episodes(knowledge)
        begin = ActiveModel(
            knowledge.models[self.model], knowledge.sample_time, measurement_variance=variance
        )
        found = tune_active_model(
            begin, episodes.pull_mm, episodes.measurement_deg, episodes.initial_bend_deg
        )
        return {
            "process_variance": list(found.process_variance),
            "measurement_variance": 1.0,  # it is told another before it runs
            "initial_variance": list(found.initial_variance),
        }


def draw_twin_episodes(knowledge: Knowledge) -> tuple[TrainingEpisodes, Any]:
    """Return noisy measurements of randomised reduced twins, and (B,) R of each [deg^2].

    Raises:
        ValueError: it is not known what twins are drawn from.
        FloatingPointError: none of the twins found an equilibrium.
    """
    from twin.reduced import simulate_batch  # here: a table of methods needs none of it
    from twin.signals.excitation import SIGNALS, command

    if knowledge.twins is None:
        raise InputError("a tuning on twins needs a preset and its ranges")
    preset, ranges = knowledge.twins
    stride = round(knowledge.sample_time / _SAMPLE_TIME)
    presets, pulls, bends = [], [], []
    for number in range(TWINS):
        rng = random_stream(knowledge.seed, SeedUse.TUNING_TWINS, number)
        drawn, other = ranges.draw(preset, rng), ranges.draw(preset, rng)
        width = rng.uniform(NARROWEST_MM, STROKE_MM[1] - STROKE_MM[0])
        low = rng.uniform(STROKE_MM[0], STROKE_MM[1] - width)
        signal = list(SIGNALS)[number % len(SIGNALS)]
        pull = command(signal, (low * 1e-3, (low + width) * 1e-3), SECONDS, _SAMPLE_TIME, rng)
        presets.append(drawn)
        pulls.append(pull)
        bends.append(np.linspace(drawn.sheath_bend, other.sheath_bend, len(pull)) if number % 2 else None)
    simulated = simulate_batch(presets, pulls, _SAMPLE_TIME, sheath_bends=bends)
    pairs = zip(pulls, simulated, strict=True)
    whole = [(pull, episode.truth_deg) for pull, episode in pairs if episode is not None]
    if not whole:
        raise DivergedError("no twin that a filter could be tuned on found an equilibrium")
    pull_mm = np.array([pull[::stride] * 1e3 for pull, _ in whole])
    bend_deg = np.array([bend[::stride] for _, bend in whole])
    rng = random_stream(knowledge.seed, SeedUse.TUNING_TWINS, TWINS)
    least, most = np.log(VARIANCES_DEG2)
    variance = np.exp(rng.uniform(least, most, len(whole)))
    measurement = bend_deg + np.sqrt(variance)[:, None] * rng.standard_normal(bend_deg.shape)
    initial = bend_deg[:, 0] + rng.uniform(-INITIAL_ERROR_DEG, INITIAL_ERROR_DEG, len(whole))
    return TrainingEpisodes(pull_mm, measurement, initial, bend_deg), variance


TUNED_ON_TWINS = TwinsLikelihoodFit(f"{ColemanHodgdon.name}, on twins", ColemanHodgdon.name)
"""Of the paper's active model."""


register_likelihood("AM-tuned (twins)", TUNED_ON_TWINS)
register_likelihood(
    "AM-tuned (Bouc-Wen, twins)", TwinsLikelihoodFit(f"{BoucWen.name}, on twins", BoucWen.name)
)
