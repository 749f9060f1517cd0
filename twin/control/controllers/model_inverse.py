"""Inverse of the identified Coleman-Hodgdon model as feed-forward. It asks no sensor."""

import math
from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from twin.control.controller import Controller, Sensed
from twin.control.knowledge import ControlKnowledge
from twin.control.registry import ControllerSpec, register_controller
from twin.estimation.registry import Style
from twin.hysteresis import ColemanHodgdon

CLOSE_MM = 1e-6


class ModelInverse(Controller):
    """The model is driven along with the endoscope; each command is the root of its next step."""

    def __init__(self, model: ColemanHodgdon, knowledge: ControlKnowledge) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self.model = model

    def _start(self, reference_deg: float) -> None:
        self._bend, self._before = np.array([reference_deg]), self.pull_mm
        self._memory = self.model.start(np.array([self.pull_mm]))

    def _wanted_mm(self, sensed: Sensed) -> float:
        low, high = self.limits.reach(self.pull_mm, self.sample_time)

        def missing(pull_mm: float) -> float:
            return float(self._after(pull_mm)[0][0]) - sensed.next_deg

        if math.isnan(sensed.next_deg):
            return math.nan
        of_low, of_high = missing(low), missing(high)
        if of_low >= 0 or of_high <= 0:
            return low if of_low >= 0 else high
        return float(brentq(missing, low, high, xtol=CLOSE_MM))

    def _commanded(self) -> None:
        self._bend, self._memory = self._after(self.pull_mm)
        self._before = self.pull_mm

    def _after(self, pull_mm: float) -> tuple[np.ndarray, np.ndarray]:
        return self.model.step(self._bend, self._memory, np.array([pull_mm]), np.array([self._before]))


def build(knowledge: ControlKnowledge, settings: Mapping[str, float]) -> ModelInverse:
    """Return the controller of a run."""
    return ModelInverse(knowledge.model, knowledge)


MODEL_INVERSE = register_controller(
    ControllerSpec(
        "model-inverse",
        1,
        "the identified Coleman-Hodgdon model",
        build,
        style=Style("#8c6d31", "dashed", ""),
    )
)
