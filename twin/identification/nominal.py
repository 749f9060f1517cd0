"""A model of the endoscope of a preset: records along a few commands, and parameters from single steps."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from twin.hysteresis import ColemanHodgdon
from twin.preset.preset import Preset
from twin.signals.excitation import SIGNALS, command
from twin.signals.streams import SeedUse, random_stream
from twin.simulation import simulate

Array = NDArray[np.float64]
LEAST_PER_MM = 0.01  # smallest a of the model: its memory is 100 mm of travel
_SECONDS = 60.0


def nominal_records(
    preset: Preset, stroke_mm: tuple[float, float], seed: int, sample_time: float, stride: int
) -> list[tuple[Array, Array]]:
    """Return `(pull_mm, truth_deg)` of a record of each kind of signal on a stroke [mm].

    `sample_time` [s] is that of the simulation, of which every `stride`-th sample is returned. Raises
    `FloatingPointError` where the endoscope found no equilibrium.
    """
    low, high = stroke_mm
    records = []
    for number, kind in enumerate(SIGNALS):
        rng = random_stream(seed, SeedUse.NOMINAL_RECORDS, number)
        pull = command(kind, (low * 1e-3, high * 1e-3), _SECONDS, sample_time, rng)
        bend_deg = simulate(preset, pull, sample_time, physics="reduced").truth_deg
        records.append((pull[::stride] * 1e3, bend_deg[::stride]))
    return records


def identify_steps(records: Sequence[tuple[Array, Array]]) -> ColemanHodgdon:
    """Return the model of least square error of one-step predictions on `(pull_mm, truth_deg)` records.

    A step is linear in a, a b and c, so that no search is needed (the equation-error method; Ljung 1999). A
    filter predicts by it. Noise on the angle would bias it. Where the loops of an endoscope have another
    curvature than the model's, a is `LEAST_PER_MM`.
    """
    rows, changes = [], []
    for pull, bend in records:
        increment = np.diff(pull)
        travel = np.abs(increment)
        rows.append(np.stack([-travel * bend[:-1], travel * pull[1:], increment], axis=1))
        changes.append(np.diff(bend))
    bounds = [LEAST_PER_MM, LEAST_PER_MM, -np.inf], np.inf  # of a, a b and c
    a, ab, c = lsq_linear(np.concatenate(rows), np.concatenate(changes), bounds).x
    return ColemanHodgdon(float(a), float(ab / a), float(c))
