"""RAM (memory): eq. 10 on the paper's active model, with a recurrent policy that learned on simulated twins.

For whom no twin may run beside the endoscope: it predicts by the model of Coleman and Hodgdon of its trained
file. The whole step of filter and policy is the graph of that file (`rl/twins/memory_step.py` says what it
does).

The initial estimate is not used: where an endoscope stands is known better from the first measurements.
"""

import dataclasses
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.errors import InputError
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.knowledge import Knowledge
from twin.estimation.learned.policy import POLICY_FILE
from twin.estimation.learned.step_network import (
    SAMPLE_TIME,
    UNKNOWN_DEG,
    Memory,
    StepNetwork,
    step_network,
)
from twin.estimation.learned.surprise import affine_step
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.registry import MethodSpec, Training, register_method
from twin.files.shown import shown
from twin.hysteresis import ColemanHodgdon, model_from_dict

Array = NDArray[np.float64]
AGENT = "ram-memory"
PREDICTED_BY: dict[str, tuple[int, ...]] = {"keep": (), "drive_deg": (), "increment_mm": ()}
STATE = {"mean": 1, "covariance": 1, "hidden": 1, "innovation": 0, "samples": 0}
"""Axes of each array of the state of one filter."""


class RamMemoryState(NamedTuple):
    """State of B filters.

    Attributes:
        memory: arrays of the graph, in the order of `STATE`.
        bend_deg: (B,) estimate [deg].
        half_width_deg: (B,) half of its 95 % interval [deg].
    """

    memory: Memory
    bend_deg: Array
    half_width_deg: Array


@dataclasses.dataclass(frozen=True)
class RamMemory(Estimator[RamMemoryState]):
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

    def start(self, pull_mm: Array, bend_deg: Array) -> RamMemoryState:
        """Return the state at the first sample; the initial estimate is given back there and not used."""
        batch = len(pull_mm)
        return RamMemoryState(self.network.start(batch), bend_deg.copy(), np.full(batch, UNKNOWN_DEG))

    def resume(self, trusted: RamMemoryState, pull_mm: Array, bend_deg: Array) -> RamMemoryState:
        """Return the state of a stream that begins anew: the angle is moved, all else stays."""
        off = bend_deg - trusted.bend_deg
        mean, covariance, *rest = (of.copy() for of in trusted.memory)
        begun = covariance.any(axis=1)  # a state of zeros is one that has seen nothing: it stays so
        mean[:, 0] += off * begun
        covariance[:, 0] += off**2 * begun
        return RamMemoryState((mean, covariance, *rest), bend_deg.copy(), trusted.half_width_deg)

    def step(
        self, state: RamMemoryState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> RamMemoryState:
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
        return RamMemoryState(memory, bend, half_width)

    def bend_deg(self, state: RamMemoryState) -> Array:
        """Return the (B,) estimate [deg]."""
        return state.bend_deg

    @property
    def states_interval(self) -> bool:
        """True: it states a 95 % interval with every estimate."""
        return True

    def half_width_deg(self, state: RamMemoryState) -> Array:
        """Return half of the (B,) 95 % intervals about the estimates [deg]."""
        return state.half_width_deg


def load(path: Path) -> RamMemory:
    """Read a trained step and its model.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    file = read_trained_file(path, AGENT)
    try:
        network = step_network(file, PREDICTED_BY, STATE)
        model = model_from_dict(file.description.get("model", {}))
        if not isinstance(model, ColemanHodgdon):
            raise InputError(f"model = {shown(model)}: must be one of Coleman and Hodgdon")
        return RamMemory(network, model)
    except ValueError as error:
        raise InputError(f"{path} is not a policy of the agent {AGENT!r}: {error}") from error


def _build(known: Knowledge) -> RamMemory:
    return load(known.file_of(AGENT)).at(known.sample_time)


TRAINING = Training(
    AGENT, POLICY_FILE, load, "RAM with a recurrent policy, trained on simulated twins", on_twins=True
)
RAM_MEMORY = register_method(
    MethodSpec(name="RAM (memory)", rank=57, family="learned", told="R", build=_build, training=TRAINING)
)
