"""RAM (memory): eq. 10 on the paper's active model, with a recurrent policy that learned on simulated twins.

For whom no twin may run beside the endoscope: it predicts by the model of Coleman and Hodgdon of its trained
file. The whole step of filter and policy is the graph of that file (`rl/twins/memory_step.py` says what it
does).
"""

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.estimation.knowledge import Knowledge
from twin.estimation.learned.model_step import ModelStep, ModelStepState, load_model_step
from twin.estimation.learned.policy import POLICY_FILE
from twin.estimation.registry import MethodSpec, Training, register_method

Array = NDArray[np.float64]
AGENT = "ram-memory"
STATE = {"mean": 1, "covariance": 1, "hidden": 1, "innovation": 0, "samples": 0}
"""Axes of each array of the state of one filter."""


@dataclasses.dataclass(frozen=True)
class RamMemory(ModelStep):
    """The trained filter and policy; its state's mean and covariance are those of the active model."""

    def resume(self, trusted: ModelStepState, pull_mm: Array, bend_deg: Array) -> ModelStepState:
        """Return the state of a stream that begins anew: the angle is moved, all else stays."""
        off = bend_deg - trusted.bend_deg
        mean, covariance, *rest = (of.copy() for of in trusted.memory)
        begun = covariance.any(axis=1)  # a state of zeros is one that has seen nothing: it stays so
        mean[:, 0] += off * begun
        covariance[:, 0] += off**2 * begun
        return ModelStepState((mean, covariance, *rest), bend_deg.copy(), trusted.half_width_deg)


def load(path: Path) -> RamMemory:
    """Read a trained step and its model.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or holds something else.
    """
    return load_model_step(path, AGENT, STATE, RamMemory)


def _build(known: Knowledge) -> RamMemory:
    return load(known.file_of(AGENT)).at(known.sample_time)


TRAINING = Training(
    AGENT, POLICY_FILE, load, "RAM with a recurrent policy, trained on simulated twins", on_twins=True
)
RAM_MEMORY = register_method(
    MethodSpec(name="RAM (memory)", noise_information="R", build=_build, training=TRAINING)
)
