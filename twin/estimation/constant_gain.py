"""The active model with a second, constant gain on the measured residual: eq. 10 with a constant action.

    phi = y - theta_AM(k|k),    X = X_AM + K phi

It is what RAM must pass to show that its policy does more than one number could.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.gaussian import Belief

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class ConstantGain(ActiveModel):
    """The active model, moved further towards each measurement; the covariance is left as it is."""

    gain: tuple[float, float] = (0.0, 0.0)
    """K: of the angle, and of the model's error [1 / s]; zero: the active model."""

    def update(self, belief: Belief, measurement_deg: Array) -> Belief:
        """Condition the belief on one measurement and add the gain times what is left of the residual."""
        updated = super().update(belief, measurement_deg)
        residual = measurement_deg - updated.mean[0]
        residual = np.where(np.isnan(residual), 0.0, residual)  # without a measurement there is none
        return updated._replace(mean=updated.mean + np.array(self.gain)[:, None] * residual)
