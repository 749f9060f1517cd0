"""A model of hysteresis alone, from the given first estimate, without measurements."""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.estimation.estimator import Estimator, hold
from twin.estimation.registry import MethodSpec, register_method
from twin.hysteresis import BoucWen, ColemanHodgdon, HysteresisModel, PrandtlIshlinskii

Array = NDArray[np.float64]
MONOTONE = f"{ColemanHodgdon.name}, monotone"
"""Name of the Coleman-Hodgdon model that is constrained to monotone loops."""


class OpenLoopState(NamedTuple):
    """Angle (B,) [deg] and memory (m, B) of the model."""

    bend: Array
    memory: Array


@dataclasses.dataclass(frozen=True)
class OpenLoop(Estimator[OpenLoopState]):
    """The static model of the paper's comparison: its row is the same under every noise."""

    model: HysteresisModel

    def start(self, pull_mm: Array, bend_deg: Array) -> OpenLoopState:
        """Return the state at the first sample."""
        return OpenLoopState(bend_deg, self.model.start(pull_mm))

    def step(
        self, state: OpenLoopState, pull_mm: Array, previous_pull_mm: Array, measurement_deg: Array
    ) -> OpenLoopState:
        """Follow the command by one sample."""
        return OpenLoopState(*self.model.step(state.bend, state.memory, pull_mm, previous_pull_mm))

    def bend_deg(self, state: OpenLoopState) -> Array:
        """Return the (B,) angle [deg]."""
        return state.bend

    def estimate(self, pull_mm: Array, measurement_deg: Array, initial_bend_deg: ArrayLike) -> Array:
        """Return the (B, N) response of the model [deg]; see `Estimator.estimate`."""
        shape = np.atleast_2d(measurement_deg).shape
        pull = np.broadcast_to(hold(np.asarray(pull_mm, dtype=float)), shape)
        return self.model.response(pull, np.broadcast_to(initial_bend_deg, shape[:1]))


def _register(name: str, model: str) -> None:
    register_method(
        MethodSpec(
            name=name,
            build=lambda known: OpenLoop(known.models[model]),
            given=(),
            models=(model,),
        )
    )


_register("C-H", ColemanHodgdon.name)
_register("C-H (monotone)", MONOTONE)
_register("Bouc-Wen", BoucWen.name)
_register("P-I", PrandtlIshlinskii.name)
