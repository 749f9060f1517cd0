"""Coleman-Hodgdon parameters by least squares on steps: those that foretell each sample from the one before.

A step is linear in a, a b and c, so that no search is needed (the equation-error method; Ljung 1999). It is
what a filter predicts by. Noise on the angle would bias it: it is for records whose angle is true.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]


def identify_steps(records: Sequence[tuple[Array, Array]]) -> ColemanHodgdon:
    """Return the model with the least square error of one-step predictions.

    Args:
        records: `(pull_mm (N,), true bend_deg (N,))`.

    Raises:
        ValueError: no model of Coleman and Hodgdon is near: a or b would not be positive.
    """
    rows, changes = [], []
    for pull, bend in records:
        increment = np.diff(pull)
        way = np.abs(increment)
        rows.append(np.stack([-way * bend[:-1], way * pull[1:], increment], axis=1))
        changes.append(np.diff(bend))
    (a, ab, c), *_ = np.linalg.lstsq(np.concatenate(rows), np.concatenate(changes), rcond=None)
    if not (a > 0 and ab > 0):
        raise InputError(f"steps of these records give a = {a:.3g}, a b = {ab:.3g}: both must be positive")
    return ColemanHodgdon(float(a), float(ab / a), float(c))
