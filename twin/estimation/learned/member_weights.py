"""Weights that the filter of RAM (twins) gives its members: how their bends add up to what it foretells.

The graph of a trained file foretells mean + (theta - mean) . D c + d of the members' angles theta, where c
is in its state. D is a constant inside of the graph. It is found by asking: without a measurement, the graph
returns what it foretells, which is linear in theta and in c.
"""

import numpy as np
from numpy.typing import NDArray

from twin.estimation.learned.ram_twins import STATE, TwinsState
from twin.estimation.learned.step_network import StepNetwork

Array = NDArray[np.float64]
NOT_OF_MEMBERS = 2  # the last numbers of the state: d and b
_MEAN = list(STATE).index("mean")


class MemberWeights:
    """Weights of M members by the state of a filter.

    Attributes:
        directions: (M, r) D, with the mean over the members taken off.
    """

    def __init__(self, network: StepNetwork) -> None:
        """Ask a graph for its directions."""
        shapes = {part.name: part.shape for part in network.file.session.get_inputs()}
        members, (size,) = int(shapes["members_deg"][1]), network.state["mean"]
        directions = size - NOT_OF_MEMBERS
        memory = [of.copy() for of in network.start(members * directions)]
        # Any covariance that is not zero: a state of zeros would be taken for one that has not begun.
        memory[list(STATE).index("covariance")][:] = np.eye(size)
        memory[_MEAN][:, :directions] = np.tile(np.eye(directions), (members, 1))
        one = np.repeat(np.eye(members), directions, axis=0)
        told, _, _ = network.step(
            tuple(memory), np.full(len(one), np.nan), 1.0, 0.1, members_deg=one, way_mm=np.zeros(len(one))
        )
        self.directions: Array = told.reshape(members, directions) - 1 / members

    def of(self, state: TwinsState) -> Array:
        """Return the (M,) weights of the one filter of a state; their sum is 1."""
        members, directions = self.directions.shape
        weights: Array = 1 / members + self.directions @ np.asarray(
            state.memory[_MEAN][0, :directions], float
        )
        return weights
