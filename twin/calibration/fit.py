"""Result of a calibration: the fitted preset, and what is needed to say how well it is known."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.calibration.parameters import FreeParameters
from twin.preset.preset import Preset

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Fit:
    """Fitted preset, with residuals and Jacobian at the fit.

    Attributes:
        free: the fitted parameters.
        preset: the fitted preset.
        cost: sum over logs of the mean square error of the twin in MuJoCo, in units of `BEND_SCALE` and
            `TENSION_SHARE`.
        reduced_cost: the same of the reduced twin, on which the search was made.
        jacobian: derivative of the residuals with respect to the search space, (R, P).
        residual: residuals, weighted as the search had them at its end (`weights.py`), (R,).
        beside: points that walks met beside the fit of the reduced twin: how much more each costs, and how
            far away it is in the search space, (K, 1 + P).
    """

    free: FreeParameters
    preset: Preset
    cost: float
    reduced_cost: float
    jacobian: Array
    residual: Array
    beside: Array = dataclasses.field(default_factory=lambda: np.empty((0, 0)))
