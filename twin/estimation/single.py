"""An estimator on one stream: the steps of a batch of one, on plain numbers where that is faster.

NumPy takes a microsecond to begin each operation; a filter of two states needs fifty of them and calculates
for none of that time. What `Estimator.single` returns may therefore do the same arithmetic on floats.
"""

import abc
from typing import Generic, TypeVar

State = TypeVar("State")


class SingleForm(abc.ABC, Generic[State]):
    """An estimator on one stream; parameters are frozen, what moves is in its state."""

    states_interval = False
    """True if it states a 95 % interval with every estimate."""
    plain = True
    """True if it has arithmetic of its own, and is not a batch of one."""

    @abc.abstractmethod
    def start(self, pull_mm: float, bend_deg: float) -> State:
        """Return the state at the first sample, with an initial estimate of the angle [deg]."""

    def resume(self, trusted: State, pull_mm: float, bend_deg: float) -> State:
        """Return the state of a stream that restarts after a fault; see `Estimator.resume`."""
        return self.start(pull_mm, bend_deg)

    @abc.abstractmethod
    def step(self, state: State, pull_mm: float, previous_pull_mm: float, measurement_deg: float) -> State:
        """Return the state one sample later; NaN is a measurement that is missing."""

    @abc.abstractmethod
    def bend_deg(self, state: State) -> float:
        """Return the estimate that a state holds [deg]."""

    def half_width_deg(self, state: State) -> float:
        """Return half of its 95 % interval [deg], where it states one."""
        raise NotImplementedError

    @abc.abstractmethod
    def is_sound(self, state: State) -> bool:
        """Return whether every number of a state is finite and possible, and variances are positive."""
