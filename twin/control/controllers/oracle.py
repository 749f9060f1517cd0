"""Oracle: inverse of the endoscope itself, whose state it knows. No device can have it.

Its error is due to the speed limit of the motor alone; it knows the reference as far ahead as others do.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from twin.control.anticipation import Anticipation, Array
from twin.control.controller import ControlKnowledge, Controller, ControllerSpec, Sensed, register_controller
from twin.control.trial import Plant
from twin.errors import InputError
from twin.estimation.registry import Style

ENOUGH_DEG = 0.2  # error that it does not turn round for by itself: its copy of a plant in MuJoCo is as exact


class Oracle(Controller):
    """A reduced copy of the endoscope is driven along; each command brings its true bend to the reference."""

    def __init__(self, knowledge: ControlKnowledge, settings: Mapping[str, float]) -> None:
        super().__init__(knowledge.limits, knowledge.sample_time)
        self._plant: Plant | None = None
        self._copy: Plant

    def observe(self, plant: Plant) -> None:
        """Give it the endoscope, whose parameters, true bend and sheath it sees from now on."""
        self._plant = plant
        self._copy = Plant(plant.preset, self.sample_time, "reduced")

    def _start(self, reference_deg: float) -> None:
        if self._plant is None:
            raise InputError("an oracle has no endoscope to observe: it runs only in trials")
        self._copy.start(self.pull_mm)
        self._anticipation = Anticipation(self.limits, self.sample_time)
        self._direction = 0.0  # of the latest command

    def _wanted_mm(self, sensed: Sensed) -> float:
        assert self._plant is not None
        plant, copy = self._plant, self._copy
        copy.step(plant.pull_mm, plant.sheath_bend)
        self.estimate_deg = plant.bend_deg()
        ahead = self._anticipation.wanted_mm(
            self.pull_mm, self.estimate_deg, sensed.reference_deg, sensed.reference_preview_deg, self._along
        )
        if not math.isnan(ahead):
            self._direction = ahead - self.pull_mm or self._direction
            return ahead
        moved, of_reference = sensed.next_deg - self.estimate_deg, sensed.next_deg - sensed.reference_deg
        if moved * self._direction < 0 <= of_reference * self._direction and abs(moved) < ENOUGH_DEG:
            return self.pull_mm
        self._direction = moved
        wanted = copy.bend_deg() + moved
        low, high = self.limits.reach(self.pull_mm, self.sample_time)
        stroke = (low * 1e-3, high * 1e-3)
        pull, _ = copy.endoscope.twins.common_pull(np.ones(1), float(np.radians(wanted)), stroke)
        return float(pull) * 1e3

    def _along(self, pulls_mm: Array, samples: NDArray[np.int64]) -> Array:
        """Return how far its copy moves along pulls; it is put back."""
        state, now = self._copy.save_state(), self._copy.bend_deg()
        twins, ways = self._copy.endoscope.twins, zip(pulls_mm, samples, strict=True)
        bends = [float(twins.step(pull * 1e-3, samples=int(took))[0]) for pull, took in ways]
        self._copy.restore_state(state)
        return np.degrees(bends) - now


ORACLE = register_controller(
    ControllerSpec(
        "oracle",
        9,
        "everything: the endoscope itself, without noise",
        Oracle,
        oracle=True,
        leads=False,
        style=Style("#1c1f24", "dotted", 1.2),
    )
)
