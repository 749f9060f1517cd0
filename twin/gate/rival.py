"""The trusted filter that a policy is held against: a tuned active model of the preset, eqs. 4 to 9.

Its model of hysteresis is identified on simulated records of the preset itself, its Q and P make the
measurements of nominal and randomised twins most likely, under every noise of the gate, and it is told R. No
part of it is learned from a policy's training, and nothing in it can fail in a way that a network can.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.tuning import AM_TUNED, tune_active_model
from twin.gate.cases import NOISES, Runs, noisy
from twin.identification.coleman_hodgdon import identify_coleman_hodgdon

Array = NDArray[np.float64]
RIVAL = AM_TUNED
TUNING_SECONDS = 15.0  # of each record that Q and P are found on
POPULATION, GENERATIONS = 40, 60


def tuned_rival(
    nominal: Sequence[tuple[Array, Array]], drawn: Runs, rng: np.random.Generator, sample_time: float
) -> ActiveModel:
    """Return the tuned active model of a preset.

    Args:
        nominal: `(pull_mm (N,), bend_deg (N,))` of the preset itself.
        drawn: twins that Q and P are found on; other ones than those that are tested.
        rng: of the search and of the noise.
        sample_time: T [s].
    """
    model, _ = identify_coleman_hodgdon(
        nominal, int(rng.integers(2**31)), population=POPULATION, generations=GENERATIONS
    )
    count = max(round(TUNING_SECONDS / sample_time), 20)
    short = Runs(drawn.pull_mm[:, :count], drawn.bend_deg[:, :, :count], drawn.strokes_mm, drawn.left_out)
    cases = [noisy(short, noise, 1, rng) for noise in NOISES]
    pull, measured, initial = (
        np.concatenate([np.asarray(getattr(case, name)) for case in cases])
        for name in ("pull_mm", "measurement_deg", "initial_bend_deg")
    )
    told = np.concatenate([np.asarray(case.sensor.variance) for case in cases])
    begin = ActiveModel(model, sample_time, (0.1, 0.1), told)
    return tune_active_model(begin, pull, measured, initial)
