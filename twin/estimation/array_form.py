"""Any estimator on one stream, as a batch of one."""

from typing import Any

import numpy as np

from twin.estimation.estimator import Estimator
from twin.estimation.single import SingleForm
from twin.estimation.soundness import is_sound


class ArrayForm(SingleForm[Any]):
    """Any estimator on one stream, as a batch of one."""

    plain = False

    def __init__(self, estimator: Estimator[Any]):
        self.estimator = estimator
        self.states_interval = estimator.states_interval

    def start(self, pull_mm: float, bend_deg: float) -> Any:
        """Return the state at the first sample."""
        return self.estimator.start(np.array([pull_mm]), np.array([bend_deg]))

    def resume(self, trusted: Any, pull_mm: float, bend_deg: float) -> Any:
        """Return the state of a stream that restarts."""
        return self.estimator.resume(trusted, np.array([pull_mm]), np.array([bend_deg]))

    def step(self, state: Any, pull_mm: float, previous_pull_mm: float, measurement_deg: float) -> Any:
        """Return the state one sample later."""
        now, before, measured = np.array([pull_mm]), np.array([previous_pull_mm]), np.array([measurement_deg])
        with np.errstate(all="ignore"):  # what overflows is not sound
            return self.estimator.step(state, now, before, measured)

    def bend_deg(self, state: Any) -> float:
        """Return the estimate [deg]."""
        return float(self.estimator.bend_deg(state)[0])

    def half_width_deg(self, state: Any) -> float:
        """Return half of its 95 % interval [deg]."""
        return float(self.estimator.half_width_deg(state)[0])

    def is_sound(self, state: Any) -> bool:
        """Return whether every number of a state is sound."""
        with np.errstate(all="ignore"):
            return is_sound(state)
