"""The endoscope as its preset is, along a few commands: what a model of it is identified on."""

import numpy as np
from numpy.typing import NDArray

from twin.preset.preset import Preset
from twin.signals.excitation import SIGNALS, command
from twin.signals.streams import SeedUse, random_stream
from twin.simulation import simulate

Array = NDArray[np.float64]
_SECONDS = 60.0


def nominal_records(
    preset: Preset, stroke_mm: tuple[float, float], seed: int, sample_time: float, stride: int
) -> list[tuple[Array, Array]]:
    """Return `(pull_mm, bend_deg)` of a record of each kind of signal on a stroke [mm].

    Args:
        preset: the endoscope.
        stroke_mm: lowest and highest pull [mm].
        seed: of the commands.
        sample_time: of the simulation [s].
        stride: samples from one that is returned to the next.

    Raises:
        FloatingPointError: the endoscope found no equilibrium.
    """
    low, high = stroke_mm
    records = []
    for number, kind in enumerate(SIGNALS):
        rng = random_stream(seed, SeedUse.NOMINAL_RECORDS, number)
        pull = command(kind, (low * 1e-3, high * 1e-3), _SECONDS, sample_time, rng)
        bend_deg = simulate(preset, pull, sample_time, physics="reduced").truth_deg
        records.append((pull[::stride] * 1e3, bend_deg[::stride]))
    return records
