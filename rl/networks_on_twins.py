"""Training of the rivals of RAM (twins), on what it learns on itself."""

import dataclasses
import functools
from collections.abc import Callable

from rl.trainers import RATES, Trainer, register_trainer
from rl.twins.beside_model import train_beside_model
from rl.twins.cells import Convolution, GatedUnit, LongShortTerm, MemoryCell, StateSpace
from rl.twins.graph import export_recurrent_step
from rl.twins.recurrent_step import Correction, LearnedGain, LearnedGainAndBias, RecurrentStep, RecursiveGain
from rl.twins.run import scaled_to_options
from rl.twins.settings import NetworkTraining
from twin.estimation.learned import networks_on_twins as methods
from twin.estimation.registry import MethodSpec


@dataclasses.dataclass(frozen=True)
class Rival:
    """Rival of RAM (twins).

    Attributes:
        spec: its row of the method table.
        step: what it does with a sample.
        cell: what it remembers by.
        widths: of its memory, that a search tries.
        rate: learning rate that the search took, see docs/ram_twins.md.
        width: that it took.
    """

    spec: MethodSpec
    step: Callable[[Callable[[int, int], MemoryCell], int], RecurrentStep]
    cell: Callable[[int, int], MemoryCell]
    widths: tuple[int, ...]
    rate: float
    width: int

    @property
    def settings(self) -> NetworkTraining:
        """Settings of its training."""
        return NetworkTraining(learning_rate=self.rate, width=self.width)

    def untrained(self, settings: NetworkTraining | None = None) -> RecurrentStep:
        """Return its step before a training of these settings, or of its own."""
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
        Rival(methods.RECURSIVE_KALMAN_NET_TWINS, RecursiveGain, GatedUnit, (48, 72), 3e-3, 48),
    )
}
"""By name of the method."""

for _rival in RIVALS.values():
    assert _rival.spec.training is not None
    _train = functools.partial(
        train_beside_model, _rival.spec.training, _rival.untrained, export_recurrent_step
    )
    register_trainer(
        Trainer(
            _rival.spec,
            on_twins=scaled_to_options(_train, _rival.settings),
            unit="thousandths",
            searched={"learning_rate": RATES, "width": _rival.widths},
        )
    )
