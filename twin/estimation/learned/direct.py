"""Direct RL (Fig. 4 of the RAM paper): a policy takes the place of the active model."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Knowledge
from twin.estimation.learned.policy import POLICY_FILE, Agent, PolicyEstimator, build_steered, load_steered
from twin.estimation.learned.scale import from_log_scale, to_log_scale
from twin.estimation.registry import MethodSpec, Training, register_method
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]
ANGLE_LIMIT_DEG = 25.0  # largest change of the angle that it can make in one sample


class DirectEstimator(Agent):
    """Direct RL (Fig. 4): the policy replaces the active model and predicts the change of the angle itself.

    It sees y_k - theta_(k-1) and the increment of the pulling distance, and has no model and no covariance.
    """

    sensed: ClassVar[Mapping[str, str]] = {"y - theta": "deg", "increment of the pull": "mm"}
    applied: ClassVar[Mapping[str, str]] = {"change of theta": "deg"}

    def __init__(self, active_model: ActiveModel | None = None):
        self._bend: Array = np.zeros(1)

    @property
    def bend_deg(self) -> Array:
        """(B,) estimates [deg]."""
        return self._bend.copy()

    def reset(self, pull_mm: Array, initial_bend_deg: Array, which: NDArray[np.bool_] | bool = True) -> None:
        """Start those of B estimators at their (B,) initial estimates [deg]."""
        self._bend = np.where(which, np.asarray(initial_bend_deg, dtype=float), self._bend)

    def sense(
        self,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        oracle_deg: Array | None = None,
    ) -> Array:
        """Return y - theta [deg], zero without a measurement, and the increment of the pull [mm]: (B, 2)."""
        reference = measurement_deg if oracle_deg is None else oracle_deg
        return np.stack([np.nan_to_num(reference - self._bend), pull_mm - previous_pull_mm], axis=-1)

    @staticmethod
    def scaled(sensed: Array) -> Array:
        """Return y - theta on a symmetric log scale, and the increment [0.1 mm]."""
        return np.stack([to_log_scale(sensed[:, 0]), sensed[:, 1] * 10], axis=-1)

    @staticmethod
    def amounts(action: Array) -> Array:
        """Return the change of the angle [deg]: actions are on the logarithmic scale of the residual."""
        return from_log_scale(np.clip(action, -1, 1) * np.log1p(ANGLE_LIMIT_DEG))

    def apply(self, amounts: Array) -> Array:
        """Move the angle by (B, 1) amounts [deg] and return it [deg]."""
        self._bend = self._bend + amounts[:, 0]
        return self.bend_deg


AGENT = "direct"


def load(path: Path) -> PolicyEstimator:
    """Read a trained policy; see `load_steered`."""
    return load_steered(path, AGENT, DirectEstimator)


def _build(knowledge: Knowledge) -> PolicyEstimator:
    return build_steered(knowledge, AGENT, DirectEstimator)


DIRECT = register_method(
    MethodSpec(
        name="Direct RL",
        noise_information="nothing",
        build=_build,
        models=(ColemanHodgdon.name,),
        training=Training(AGENT, POLICY_FILE, load, "direct RL, without the active model, by PPO"),
    )
)
