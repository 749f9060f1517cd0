"""Training of the rivals of RAM (twins), on what it learns on itself."""

import functools
from collections.abc import Callable

from rl.trainers import Trainer, register_trainer
from rl.twins.beside_model import train_beside_model
from rl.twins.cells import Convolution, GatedUnit, LongShortTerm, StateSpace
from rl.twins.graph import export_recurrent_step
from rl.twins.recurrent_step import Correction, LearnedGain, LearnedGainAndBias, RecurrentStep, RecursiveGain
from rl.twins.run import scaled_to_options
from rl.twins.settings import SimulatedTraining
from twin.estimation.learned import networks_on_twins as methods
from twin.estimation.registry import MethodSpec

STEPS: dict[str, tuple[MethodSpec, Callable[[], RecurrentStep]]] = {
    spec.name: (spec, functools.partial(step, cell))
    for spec, step, cell in (
        (methods.LSTM_TWINS, Correction, LongShortTerm),
        (methods.GRU_TWINS, Correction, GatedUnit),
        (methods.CONVOLUTION_TWINS, Correction, Convolution),
        (methods.STATE_SPACE_TWINS, Correction, StateSpace),
        (methods.KALMAN_NET_TWINS, LearnedGain, GatedUnit),
        (methods.BIASED_KALMAN_NET_TWINS, LearnedGainAndBias, GatedUnit),
        (methods.RECURSIVE_KALMAN_NET_TWINS, RecursiveGain, GatedUnit),
    )
}
"""By name, each method and its untrained step."""

for _spec, _begin in STEPS.values():
    assert _spec.training is not None
    _train = functools.partial(train_beside_model, _spec.training, _begin, export_recurrent_step)
    register_trainer(
        Trainer(_spec, on_twins=scaled_to_options(_train, SimulatedTraining()), unit="thousandths")
    )
