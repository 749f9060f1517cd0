"""The endoscope as its preset is, along a few commands: what a model of it is identified on."""

import numpy as np
from numpy.typing import NDArray

from rl.twins.records import SAMPLE_TIME
from rl.twins.sequences import STRIDES
from twin.preset.preset import Preset
from twin.reduced import simulate
from twin.signals.excitation import SIGNALS, command

Array = NDArray[np.float64]
_SECONDS = 60.0
_MODEL = 210  # what the seed is used for


def nominal_records(preset: Preset, stroke_mm: tuple[float, float], seed: int) -> list[tuple[Array, Array]]:
    """Return `(pull_mm, bend_deg)` of a record of each kind of signal, at the coarsest T of a training.

    Raises:
        FloatingPointError: the endoscope found no equilibrium.
    """
    low, high = stroke_mm
    records = []
    for number, kind in enumerate(SIGNALS):
        rng = np.random.default_rng([seed, _MODEL, number])
        pull = command(kind, (low * 1e-3, high * 1e-3), _SECONDS, SAMPLE_TIME, rng)
        bend_deg = simulate(preset, pull, SAMPLE_TIME).bend_deg
        records.append((pull[:: STRIDES[0]] * 1e3, bend_deg[:: STRIDES[0]]))
    return records
