"""How a learned policy estimates the bending angle: RAM, and direct RL without the active model.

An agent is a batch of B running estimators. Training, evaluation and the online form all drive the same two
calls per sample: `observe` takes the command and the measurement and returns what the policy sees, `act`
takes what the policy says and returns the estimate. No agent sees the true angle, but in an oracle run.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from twin.estimation.active_model import ActiveModel

Array = NDArray[np.float64]
ANGLE_LIMIT_DEG = 25.0  # largest change of the angle that direct RL can make in one sample
AGENTS = ("ram", "direct")
ERROR_GAIN_LIMIT = 1.0  # largest K_RAM of the model error f [1 / s]


class Agent(Protocol):
    """A batch of estimators that a policy steers."""

    observation_size: int
    action_size: int

    @property
    def bend_deg(self) -> Array:
        """(B,) estimates [deg]."""

    def reset(self, pull_mm: Array, initial_bend_deg: Array) -> None:
        """Start B estimators at the first (B,) pull [mm], at their (B,) initial estimates [deg]."""

    def observe(
        self,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        oracle_deg: Array | None = None,
    ) -> Array:
        """Take in one sample and return the (B, observation_size) observation.

        `oracle_deg` replaces the measurement in the residual by the truth: only an oracle run gives it.
        """

    def act(self, action: Array) -> Array:
        """Apply (B, action_size) actions in [-1, 1] and return the (B,) estimates [deg]."""


class ReinforcementActiveModel:
    """RAM (eq. 10): after the active model's update the policy sets a second gain on the residual.

        phi = y - theta_AM(k|k),    X_RAM = X_AM + K_RAM phi

    phi is the *measured* residual, the only one that a deployed estimator has. The policy sees it in units of
    the standard deviation sqrt(R) that the filter is told: what is large for one sensor is noise for another.
    The action holds the two numbers of K_RAM: of the angle, in [0, 1], so that the update is a convex step
    towards the measurement, and of the model's error, in [0, 1] per second. X_RAM feeds the next prediction.
    """

    observation_size = 1
    action_size = 2

    def __init__(self, active_model: ActiveModel):
        self.active_model = active_model
        self.residual: Array = np.zeros(1)
        self._noise_deg = np.sqrt(active_model.measurement_variance)

    @property
    def bend_deg(self) -> Array:
        """(B,) estimates [deg]."""
        return self.belief.mean[0].copy()

    def reset(self, pull_mm: Array, initial_bend_deg: Array) -> None:
        """Start B estimators at the first (B,) pull [mm], at their (B,) initial estimates [deg]."""
        self.belief = self.active_model.start(pull_mm, initial_bend_deg)

    def observe(
        self,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        oracle_deg: Array | None = None,
    ) -> Array:
        """Run the active model by one sample; returns phi / sqrt(R) on a symmetric log scale: (B, 1).

        Without a measurement there is no residual: phi is zero.
        """
        self.belief = self.active_model.step(self.belief, pull_mm, previous_pull_mm, measurement_deg)
        reference = measurement_deg if oracle_deg is None else oracle_deg
        self.residual = np.nan_to_num(reference - self.belief.mean[0])
        return to_log_scale(self.residual / self._noise_deg)[:, None]

    def act(self, action: Array) -> Array:
        """Apply K_RAM = [(a0 + 1) / 2, (a1 + 1) / 2 per second] and return the (B,) estimates [deg]."""
        gain = (np.clip(action, -1, 1) + 1) / 2 * np.array([1.0, ERROR_GAIN_LIMIT])
        self.belief = self.belief._replace(mean=self.belief.mean + gain.T * self.residual)
        return self.bend_deg


class DirectEstimator:
    """Direct RL (Fig. 4): the policy replaces the active model and predicts the change of the angle itself.

    It sees y_k - theta_(k-1) and the increment of the pulling distance, and has no model and no covariance.
    """

    observation_size = 2
    action_size = 1

    def __init__(self) -> None:
        self._bend: Array = np.zeros(1)

    @property
    def bend_deg(self) -> Array:
        """(B,) estimates [deg]."""
        return self._bend.copy()

    def reset(self, pull_mm: Array, initial_bend_deg: Array) -> None:
        """Start B estimators at their (B,) initial estimates [deg]."""
        self._bend = np.array(initial_bend_deg, dtype=float)

    def observe(
        self,
        pull_mm: Array,
        previous_pull_mm: Array,
        measurement_deg: Array,
        oracle_deg: Array | None = None,
    ) -> Array:
        """Return y - theta on a symmetric log scale, and the increment of the pull [0.1 mm]: (B, 2)."""
        reference = measurement_deg if oracle_deg is None else oracle_deg
        residual = np.nan_to_num(reference - self._bend)
        return np.stack([to_log_scale(residual), (pull_mm - previous_pull_mm) * 10], axis=-1)

    def act(self, action: Array) -> Array:
        """Move the angle by (B, 1) actions, on the logarithmic scale of the residual, and return it [deg]."""
        change = from_log_scale(np.clip(action[:, 0], -1, 1) * np.log1p(ANGLE_LIMIT_DEG))
        self._bend = self._bend + change
        return self.bend_deg


def to_log_scale(angle_deg: Array) -> Array:
    """Return sign(x) log(1 + |x|): noise of 0.3 deg and a first error of 20 deg are both resolved."""
    return np.sign(angle_deg) * np.log1p(np.abs(angle_deg))


def from_log_scale(value: Array) -> Array:
    """Return the angle whose `to_log_scale` is `value` [deg]."""
    return np.sign(value) * np.expm1(np.abs(value))


def make_agent(name: str, active_model: ActiveModel) -> Agent:
    """Return an agent by its name on the command line.

    Raises:
        ValueError: the name is unknown.
    """
    check_agent_name(name)
    return ReinforcementActiveModel(active_model) if name == "ram" else DirectEstimator()


def check_agent_name(name: str) -> None:
    """Refuse an agent that there is not.

    Raises:
        ValueError: the name is unknown.
    """
    if name not in AGENTS:
        raise ValueError(f"unknown agent {name!r}; valid: {', '.join(AGENTS)}")
