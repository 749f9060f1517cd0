"""RAM on one stream: the active model on plain numbers, the policy's graph on arrays of its own."""

import math

from twin.estimation.learned.bound_network import BoundNetwork
from twin.estimation.learned.trained_file import TrainedFile
from twin.estimation.two_states import TwoStates, TwoStatesForm


class RamForm(TwoStatesForm):
    """Eq. 10 behind the active model's update; see `ReinforcementActiveModel`."""

    states_interval = False  # the covariance is that of the active model, not of what the policy makes of it

    def __init__(self, active_model: TwoStatesForm, file: TrainedFile):
        """Take the filter and the graph from phi / sqrt(R) to both numbers of K_RAM."""
        vars(self).update(vars(active_model))
        self.network = BoundNetwork(file, 1, 2)
        self.noise_deg = math.sqrt(active_model.variance)

    def step(
        self, state: TwoStates, pull_mm: float, previous_pull_mm: float, measurement_deg: float
    ) -> TwoStates:
        """Predict and update by one sample, and add K_RAM phi; nothing without a measurement."""
        bend, error, p, r, q, innovation, expected = self.numbers_after(
            state, pull_mm, previous_pull_mm, measurement_deg
        )
        residual = measurement_deg - bend
        if residual != residual:  # NaN: nothing was measured
            return TwoStates(bend, error, p, r, q, innovation, expected)
        network = self.network
        network.given[0, 0] = residual / self.noise_deg
        network.run()
        of_bend, of_error = network.returned.tolist()[0]
        bend += of_bend * residual
        return TwoStates(bend, error + of_error * residual, p, r, q, innovation, expected)
