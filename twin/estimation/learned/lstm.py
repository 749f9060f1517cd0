"""A recurrent network that filters without a model (LSTM: Hochreiter and Schmidhuber 1997).

It sees increments, from sample to sample, of the pulling distance and of the measurement. It predicts the
noise of the measurement, so that its estimate is y minus that. Absolute values are left out on purpose:
trained on stroke [2, 4] mm, a network that sees them has never met [-1, 1] mm.

A sample without measurement is skipped: the estimate stands, since there is no model that could move it, and
the next increments span the gap.
"""

import dataclasses
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.estimation.estimator import Estimator, time_first
from twin.estimation.learned import scale
from twin.estimation.learned.recurrent import Array32, RecurrentNetwork, read_network
from twin.estimation.registry import MethodSpec, Training, register_method

Array = NDArray[np.float64]
STATES = 2  # hidden and cell state


class LstmState(NamedTuple):
    """State of B filters.

    Attributes:
        bend_deg: (B,) estimate [deg].
        pull_mm: (B,) pull at the last measurement [mm].
        measurement_deg: (B,) last measurement, zero before the first [deg].
        seen: (B,) whether there has been one.
        memory: (2, B, hidden) of the network.
    """

    bend_deg: Array
    pull_mm: Array
    measurement_deg: Array
    seen: NDArray[np.bool_]
    memory: Array32


@dataclasses.dataclass(frozen=True)
class LstmEstimator(Estimator[LstmState]):
    """The network sample by sample; it is told nothing and takes no initial estimate.

    Attributes:
        network: says the (N, B) noise [deg] for (N, B, 2) increments of pull [mm] and measurement [deg].
        sample_time: T that it was trained at [s].
    """

    network: RecurrentNetwork
    sample_time: float

    def start(self, pull_mm: Array, bend_deg: Array) -> LstmState:
        """Return a network that has seen nothing; the initial estimate is shown until a measurement comes."""
        none, unseen = np.zeros(bend_deg.size), np.zeros(bend_deg.size, dtype=bool)
        return LstmState(bend_deg.copy(), pull_mm.copy(), none, unseen, self._nothing(bend_deg.size))

    def step(
        self, state: LstmState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> LstmState:
        """Return the state one sample later."""
        first, missing = ~state.seen, np.isnan(measurement_deg)
        pull = np.where(first, 0, pull_mm - state.pull_mm)
        measured = np.where(first | missing, 0, measurement_deg - state.measurement_deg)
        increments = np.stack([pull, measured], axis=-1)
        noise, memory = self.network(increments[None], state.memory)
        return LstmState(
            np.where(missing, state.bend_deg, measurement_deg - noise[0]),
            np.where(missing, state.pull_mm, pull_mm),
            np.where(missing, state.measurement_deg, measurement_deg),
            state.seen | ~missing,
            np.where(missing[:, None], state.memory, memory),
        )

    def bend_deg(self, state: LstmState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    def estimate(self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike) -> Array:
        """Filter whole records (see `Estimator.estimate`), many samples in one pass where none is missing."""
        if np.isnan(measurement_deg[..., 1:]).any():
            return super().estimate(pull_mm, measurement_deg, initial_bend_deg)
        pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
        estimate = np.empty_like(measurement)
        estimate[0] = initial
        memory = self._nothing(measurement.shape[1])
        for part in scale.chunks(*measurement.shape):
            # With the sample before, except at the first, whose measurement is not used.
            before = slice(max(part.start - 1, 1), part.stop)
            seen = increments(pull[before], measurement[before])[part.start - before.start :]
            noise, memory = self.network(seen, memory)
            estimate[part] = measurement[part] - noise
        return estimate.T

    def _nothing(self, batch: int) -> Array32:
        return np.zeros((STATES, batch, self.network.hidden), dtype=np.float32)


def increments(pull_mm: Array, measurement_deg: Array) -> Array:
    """Return (N, B, 2) increments of (N, B) pull and measurement from sample to sample, zero at the first."""
    both = np.stack([pull_mm, measurement_deg], axis=-1)
    return np.diff(both, axis=0, prepend=both[:1])


def load(path: Path) -> LstmEstimator:
    """Read a trained network.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    network, _, sample_time = read_network(path, TRAINING.agent, states=STATES, seen=(3, 2, 2), said=(3, 2))
    return LstmEstimator(network, sample_time)


TRAINING = Training("lstm", "lstm.onnx", load, "LSTM, without a model")
LSTM = register_method(
    MethodSpec(
        name="LSTM",
        noise_information="nothing",
        build=lambda known: load(known.file_of(TRAINING.agent)),
        training=TRAINING,
    )
)
