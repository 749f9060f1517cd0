"""Estimators whose trained graph is one whole sample beside a model of Coleman and Hodgdon.

They learned on simulated twins (`rl/twins`), of which their file holds no more than the model. The initial
estimate is not used: where an endoscope stands is known better from the first measurements.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.learned.step_network import (
    SAMPLE_TIME,
    UNKNOWN_DEG,
    Memory,
    StepNetwork,
    step_network,
)
from twin.estimation.learned.surprise import affine_step
from twin.estimation.learned.trained_file import read_trained_file
from twin.files.shown import shown
from twin.hysteresis import ColemanHodgdon, model_from_dict

Array = NDArray[np.float64]
PREDICTED_BY: dict[str, tuple[int, ...]] = {"keep": (), "drive_deg": (), "increment_mm": ()}
"""Inputs that a graph predicts by: what a step of the model keeps of the angle, what it adds, and the way."""


class ModelStepState(NamedTuple):
    """State of B filters.

    Attributes:
        memory: arrays of the graph, in the order of its state.
        bend_deg: (B,) estimate [deg].
        half_width_deg: (B,) half of its 95 % interval [deg].
    """

    memory: Memory
    bend_deg: Array
    half_width_deg: Array


@dataclasses.dataclass(frozen=True)
class ModelStep(Estimator[ModelStepState]):
    """A trained step, the model that it predicts by, and what it is told.

    Attributes:
        network: graph of the trained file.
        model: of hysteresis.
        sample_time: T [s].
        measurement_variance: R, one for all or (B,) [deg^2].
    """

    network: StepNetwork
    model: ColemanHodgdon
    sample_time: float = SAMPLE_TIME
    measurement_variance: ArrayLike = 0.1

    def with_sensor(self, sensor: Sensor) -> Self:
        """Return the estimator that takes the sensor's variance as R."""
        return dataclasses.replace(self, measurement_variance=sensor.variance)

    def at(self, sample_time: float) -> Self:
        """Return the estimator for another T [s]."""
        return dataclasses.replace(self, sample_time=sample_time)

    def start(self, pull_mm: Array, bend_deg: Array) -> ModelStepState:
        """Return the state at the first sample; the initial estimate is given back there and not used."""
        batch = len(pull_mm)
        return ModelStepState(self.network.start(batch), bend_deg.copy(), np.full(batch, UNKNOWN_DEG))

    def step(
        self, state: ModelStepState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> ModelStepState:
        """Step the graph with what the model says of the command."""
        nothing = self.model.start(pull_mm)  # the angle is its whole state
        keep, drive, _ = affine_step(self.model, nothing, pull_mm, previous_pull_mm)
        bend, half_width, memory = self.network.step(
            state.memory,
            measurement_deg,
            self.measurement_variance,
            self.sample_time,
            keep=keep,
            drive_deg=drive,
            increment_mm=pull_mm - previous_pull_mm,
        )
        return ModelStepState(memory, bend, half_width)

    def bend_deg(self, state: ModelStepState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    @property
    def states_interval(self) -> bool:
        """True: it states a 95 % interval with every estimate."""
        return True

    def half_width_deg(self, state: ModelStepState) -> Array:
        """Return half of the (B,) 95 % intervals about the estimates [deg]."""
        return state.half_width_deg


AnyStep = TypeVar("AnyStep", bound=ModelStep)


def load_model_step(path: Path, agent: str, state: Mapping[str, int], kind: type[AnyStep]) -> AnyStep:
    """Read a trained step and its model.

    Args:
        path: of the file.
        agent: that it must be of.
        state: axes of each array of the state of one filter, by name.
        kind: what it is an estimator of.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    file = read_trained_file(path, agent)
    try:
        network = step_network(file, PREDICTED_BY, state)
        model = model_from_dict(file.description.get("model", {}))
        if not isinstance(model, ColemanHodgdon):
            raise InputError(f"model = {shown(model)}: must be one of Coleman and Hodgdon")
        return kind(network, model)
    except ValueError as error:
        raise InputError(f"{path} is not a policy of the agent {agent!r}: {error}") from error
