"""Training on simulated twins: RAM (twins), RAM (memory) and their rivals, into one run folder each."""

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rl.trainers import RATES, OnProgress, Trainer, register_trainer
from rl.twins.graph import export_twins
from rl.twins.learning import fit_ood_detector, learn_noise_models
from rl.twins.members import choose_members
from rl.twins.memory_step import HIDDEN, MemoryStep
from rl.twins.noises import noise_models
from rl.twins.records import Prediction, TwinArrays, by_members, principal_directions
from rl.twins.recurrent_step import (
    Convolution,
    Correction,
    GatedUnit,
    LearnedGain,
    LearnedGainAndBias,
    LongShortTerm,
    MemoryCell,
    RecurrentStep,
    RecursiveGain,
    StateSpace,
)
from rl.twins.run import Learner, OnShare, scaled_to_options, train_on_twins, train_with_model
from rl.twins.settings import NetworkTraining, TwinsTraining
from rl.twins.step import TwinsStep
from twin.estimation.learned import methods, ram_twins
from twin.estimation.registry import MethodSpec
from twin.preset.preset import Preset
from twin.preset.randomization import Ranges
from twin.reduced.members import MemberSet


@dataclasses.dataclass(frozen=True)
class Rival:
    """Rival of RAM (twins)."""

    spec: MethodSpec  # its method
    step: Callable[[Callable[[int, int], MemoryCell], int], RecurrentStep]  # what it does with a sample
    cell: Callable[[int, int], MemoryCell]  # its memory
    widths: tuple[int, ...]  # of its memory, that a search tries
    rate: float  # learning rate that the search chose, see docs/ram_twins.md
    width: int  # that it chose

    @property
    def settings(self) -> NetworkTraining:
        """Settings of its training."""
        return NetworkTraining(learning_rate=self.rate, width=self.width)

    def untrained(self, settings: NetworkTraining | None = None) -> RecurrentStep:
        """Return its step before a training with these settings, or with its own."""
        return self.step(self.cell, (settings or self.settings).width)


RIVALS = {
    rival.spec.name: rival
    for rival in (
        Rival(methods.LSTM_TWINS, Correction, LongShortTerm, (40, 60), 3e-3, 40),
        Rival(methods.GRU_TWINS, Correction, GatedUnit, (48, 72), 1e-2, 48),
        Rival(methods.CONVOLUTION_TWINS, Correction, Convolution, (16, 24), 3e-3, 24),
        Rival(methods.STATE_SPACE_TWINS, Correction, StateSpace, (64, 96), 3e-3, 64),
        Rival(methods.KALMAN_NET_TWINS, LearnedGain, GatedUnit, (48, 72), 1e-2, 48),
        Rival(methods.BIASED_KALMAN_NET_TWINS, LearnedGainAndBias, GatedUnit, (48, 72), 1e-2, 48),
        Rival(methods.RECURSIVE_KALMAN_NET_TWINS, RecursiveGain, GatedUnit, (48, 72), 1e-2, 48),
    )
}
"""By name of the method."""
RAM_MEMORY_SETTINGS = NetworkTraining(width=72)
"""Settings of RAM (memory); width and learning rate are what the search chose, see docs/ram_twins.md."""


assert methods.RAM_MEMORY.training is not None
train_ram_memory = functools.partial(
    train_with_model, methods.RAM_MEMORY.training, lambda settings: MemoryStep(settings.width)
)
"""Train RAM (memory) into a folder, as `train_with_model` does."""


def train_ram_twins(
    preset: Preset,
    ranges: Ranges,
    settings: TwinsTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train RAM (twins) into a folder, as `train_on_twins` does; the file contains the members too."""

    def choose(on_share: OnShare) -> MemberSet:
        size, stroke_mm = (settings.members, settings.seed, settings.moving), settings.stroke_mm
        return choose_members(preset, ranges, *size, stroke_mm=stroke_mm, on_progress=on_share)

    def begin(records: TwinArrays) -> tuple[TwinsStep, Prediction]:
        step = TwinsStep(
            principal_directions(records[1], settings.rank),
            noise_models(settings.known_noises),
            with_error=settings.with_error,
        )
        return step, by_members

    def learn_noise(step: TwinsStep, on_share: OnShare) -> None:
        learn_noise_models(
            step.filter_bank.noise_models,
            settings,
            lambda update, _: on_share(update, settings.noise_model_updates),
        )

    learner = Learner(
        ram_twins.TRAINING,
        begin,
        lambda step, *written: export_twins(step, settings.members, *written),
        choose,
        prepare=learn_noise,
        guard=lambda step, source: fit_ood_detector(step, source, settings),
    )
    return train_on_twins(learner, preset, ranges, settings, folder, on_progress)


def _register(
    spec: MethodSpec, train: Callable[..., Path], settings: Any, searched: dict[str, tuple[float, ...]]
) -> None:
    register_trainer(
        Trainer(
            spec,
            on_twins=scaled_to_options(train, settings),
            unit="thousandths",
            searched=searched,
        )
    )


for _rival in RIVALS.values():
    assert _rival.spec.training is not None
    _register(
        _rival.spec,
        functools.partial(train_with_model, _rival.spec.training, _rival.untrained),
        _rival.settings,
        {"learning_rate": RATES, "width": _rival.widths},
    )
_of_memory = {"learning_rate": RATES, "width": (HIDDEN, 72)}
_register(methods.RAM_MEMORY, train_ram_memory, RAM_MEMORY_SETTINGS, _of_memory)
_register(ram_twins.RAM_TWINS, train_ram_twins, TwinsTraining(), {})
