"""A recurrent network that filters (GRU: Cho et al. 2014), told the noise and the model of hysteresis.

It sees, sample by sample, the part of the measurement that the model does not predict,

    s_k = (y_k - step(y_{k-1})) / sqrt(R),

with R as told and `step` the model's step from the previous *measurement*, and the increment of the pull. It
predicts the noise in y_k in units of sqrt(R). No absolute value enters, so that another stroke is nothing
new, and no estimate, so that a whole record is one pass. Where noise and model error grow together with
sqrt(R), so does the error of the estimate. It takes no initial estimate: it begins at the first measurement.

A missing measurement leaves the network as it is. The estimate, and the last measurement too, are moved along
by the model, so that the next surprise spans the gap.
"""

import dataclasses
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.estimation.estimator import Estimator, Sensor, time_first
from twin.estimation.learned import scale
from twin.estimation.learned.recurrent import Array32, RecurrentNetwork, read_network
from twin.estimation.learned.surprise import surprises
from twin.estimation.registry import MethodSpec, Training, register_method
from twin.hysteresis import HysteresisModel

Array = NDArray[np.float64]


class GruState(NamedTuple):
    """State of B filters.

    Attributes:
        bend_deg: (B,) estimate [deg].
        measurement_deg: (B,) last measurement, moved along by the model over gaps; zero at first [deg].
        seen: (B,) whether there has been one.
        memory: (m, B) of the model of hysteresis.
        hidden: (1, B, hidden) of the network.
    """

    bend_deg: Array
    measurement_deg: Array
    seen: NDArray[np.bool_]
    memory: Array
    hidden: Array32


@dataclasses.dataclass(frozen=True)
class Gru(Estimator[GruState]):
    """A trained network, the model that it was trained with, and what it is told of the noise.

    Attributes:
        network: says the (N, B) noise in units of sqrt(R) for (N, B, 2) surprises, in those units, and
            increments of the pull [mm].
        model: of hysteresis.
        sample_time: T that it was trained at [s].
        measurement_variance: R, one for all or (B,) [deg^2].
    """

    network: RecurrentNetwork
    model: HysteresisModel
    sample_time: float
    measurement_variance: ArrayLike = 0.1

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the filter that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def start(self, pull_mm: Array, bend_deg: Array) -> GruState:
        """Return a network that has seen nothing; the initial estimate is shown until a measurement comes."""
        size = bend_deg.size
        unseen = np.zeros(size, dtype=bool)
        memory, hidden = self.model.start(pull_mm), self._nothing(size)
        return GruState(bend_deg.copy(), np.zeros(size), unseen, memory, hidden)

    def step(
        self, state: GruState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> GruState:
        """Return the state one sample later."""
        unit = scale.deviation(self.measurement_variance)
        first, missing = ~state.seen, np.isnan(measurement_deg)
        moved, memory = self.model.step(state.bend_deg, state.memory, pull_mm, previous_pull_mm)
        last = np.where(first, state.bend_deg, state.measurement_deg)
        foretold, _ = self.model.step(last, state.memory, pull_mm, previous_pull_mm)
        surprise = np.where(first | missing, 0, (measurement_deg - foretold) / unit)
        increment = np.broadcast_to(pull_mm - previous_pull_mm, surprise.shape)
        noise, hidden = self.network(np.stack([surprise, increment], axis=-1)[None], state.hidden)
        return GruState(
            np.where(missing, moved, measurement_deg - unit * noise[0]),
            np.where(missing, np.where(first, 0, foretold), measurement_deg),
            state.seen | ~missing,
            memory,
            np.where(missing[:, None], state.hidden, hidden),
        )

    def bend_deg(self, state: GruState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    def estimate(self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike) -> Array:
        """Filter whole records (see `Estimator.estimate`), many samples in one pass where none is missing."""
        if np.isnan(measurement_deg[..., 1:]).any():
            return super().estimate(pull_mm, measurement_deg, initial_bend_deg)
        pull, measurement, initial = time_first(pull_mm, measurement_deg, initial_bend_deg)
        samples, batch = measurement.shape
        unit = scale.deviation(self.measurement_variance)
        estimate = np.empty_like(measurement)
        estimate[0] = initial
        memory, hidden = self.model.start(pull[0]), self._nothing(batch)
        for part in scale.chunks(samples, batch):
            before = slice(part.start - 1, part.stop)  # increments are against the sample before
            surprise, memory = surprises(self.model, pull[before], measurement[before], memory)
            if part.start == 1:
                surprise[0] = 0  # the measurement before it is not used
            seen = np.stack([surprise / unit, np.diff(pull[before], axis=0)], axis=-1)
            noise, hidden = self.network(seen, hidden)
            estimate[part] = measurement[part] - unit * noise
        return estimate.T

    def _nothing(self, batch: int) -> Array32:
        return np.zeros((1, batch, self.network.hidden), dtype=np.float32)


def load(path: Path) -> Gru:
    """Read a trained network.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    return Gru(*read_network(path, TRAINING.agent, states=1, seen=(3, 2, 2), said=(3, 2)))


TRAINING = Training("gru", "gru.onnx", load, "GRU that knows the noise and the model")
GRU = register_method(
    MethodSpec(
        name="GRU",
        noise_information="R",
        build=lambda known: load(known.file_of(TRAINING.agent)),
        training=TRAINING,
    )
)
