"""Reinforcement active modeling (RAM, eq. 10): a policy sets a second gain on the active model's residual."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel
from twin.estimation.gaussian import Belief
from twin.estimation.knowledge import CaseEstimator, Knowledge
from twin.estimation.learned.policy import (
    POLICY_FILE,
    Agent,
    OracleRun,
    Policy,
    PolicyEstimator,
    build_steered,
    load_steered,
)
from twin.estimation.learned.scale import to_log_scale
from twin.estimation.learned.single_ram import RamForm
from twin.estimation.registry import MethodSpec, Training, register_method
from twin.estimation.single import SingleForm
from twin.estimation.two_states import TwoStatesForm
from twin.hysteresis import ColemanHodgdon

Array = NDArray[np.float64]
ERROR_GAIN_LIMIT = 1.0  # largest K_RAM of the model error f [1 / s]


class ReinforcementActiveModel(Agent):
    """RAM (eq. 10): after the active model's update the policy sets a second gain on the residual.

        phi = y - theta_AM(k|k),    X_RAM = X_AM + K_RAM phi

    phi is the *measured* residual, the only one that a deployed estimator has. The policy sees it in units of
    the standard deviation sqrt(R) that the filter is told: what is large for one sensor is noise for another.
    It says the two numbers of K_RAM: of the angle, in [0, 1], so that the update is a convex step towards the
    measurement, and of the model's error, in [0, 1] per second. X_RAM feeds the next prediction.
    """

    sensed: ClassVar[Mapping[str, str]] = {"phi": "sqrt(R)"}
    applied: ClassVar[Mapping[str, str]] = {"K_RAM of the angle": "1", "K_RAM of the model's error": "1/s"}

    def __init__(self, active_model: ActiveModel):
        self.active_model = active_model
        self.residual: Array = np.zeros(1)
        self._noise_deg = np.sqrt(active_model.measurement_variance)

    @property
    def bend_deg(self) -> Array:
        """(B,) estimates [deg]."""
        bend: Array = self.belief.mean[0].copy()
        return bend

    def reset(self, pull_mm: Array, initial_bend_deg: Array, which: NDArray[np.bool_] | bool = True) -> None:
        """Start those of B estimators at the first (B,) pull [mm], at their (B,) initial estimates [deg]."""
        begun = self.active_model.start(pull_mm, initial_bend_deg)
        if which is True:
            self.belief = begun
        else:
            self.belief = Belief(
                *(np.where(which, new, old) for new, old in zip(begun, self.belief, strict=True))
            )

    def sense(
        self,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        oracle_deg: Array | None = None,
    ) -> Array:
        """Run the active model by one sample; returns phi / sqrt(R): (B, 1).

        Without a measurement there is no residual: phi is zero.
        """
        self.belief = self.active_model.step(self.belief, pull_mm, previous_pull_mm, measurement_deg)
        reference = measurement_deg if oracle_deg is None else oracle_deg
        self.residual = np.nan_to_num(reference - self.belief.mean[0])
        sensed: Array = (self.residual / self._noise_deg)[:, None]
        return sensed

    @staticmethod
    def scaled(sensed: Array) -> Array:
        """Return phi / sqrt(R) on a symmetric log scale."""
        return to_log_scale(sensed)

    @staticmethod
    def amounts(action: Array) -> Array:
        """Return K_RAM = [(a0 + 1) / 2, (a1 + 1) / 2 per second]."""
        gains: Array = (np.clip(action, -1, 1) + 1) / 2 * np.array([1.0, ERROR_GAIN_LIMIT])
        return gains

    def apply(self, amounts: Array) -> Array:
        """Apply K_RAM and return the (B,) estimates [deg]."""
        self.belief = self.belief._replace(mean=self.belief.mean + amounts.T * self.residual)
        return self.bend_deg

    @staticmethod
    def single(active_model: ActiveModel, policy: Callable[[Array], Array]) -> SingleForm[Any] | None:
        """Return RAM on one stream, where the filter has a plain form and the policy a graph."""
        form = active_model.single()
        if isinstance(form, TwoStatesForm) and isinstance(policy, Policy):
            return RamForm(form, policy.network)
        return None


AGENT = "ram"


def load(path: Path) -> PolicyEstimator:
    """Read a trained policy; see `load_steered`."""
    return load_steered(path, AGENT, ReinforcementActiveModel)


def _build(knowledge: Knowledge) -> PolicyEstimator:
    return build_steered(knowledge, AGENT, ReinforcementActiveModel)


def _build_oracle(knowledge: Knowledge) -> CaseEstimator:
    return OracleRun(_build(knowledge))


RAM = register_method(
    MethodSpec(
        name="RAM",
        noise_information="R",
        build=_build,
        models=(ColemanHodgdon.name,),
        training=Training(
            AGENT, POLICY_FILE, load, "reinforcement active modeling, by PPO", same_filter=True
        ),
    )
)
"""With the measured residual, the only one that a deployed estimator has."""

register_method(
    MethodSpec(
        name="RAM (oracle)",
        noise_information="R, and the truth in its residual, as the paper's text reads",
        build=_build_oracle,
        models=(ColemanHodgdon.name,),
        trained_as=AGENT,
        oracle=True,
    )
)
