"""RAM (eq. 10) and direct RL (Fig. 4) as modules of torch: what their policies see, and what an action does.

`observe` takes the inputs and the state of a sample up to what the policy sees of it, `act` continues with
the action. PPO acts in between; the deployed graph is both with the trained policy in the middle.
"""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import torch

from twin.estimation.active_model import ActiveModel
from twin.estimation.learned.methods import ACTIONS, ANGLE_LIMIT_DEG, ERROR_GAIN_LIMIT, OBSERVATIONS
from twin.estimation.learned.step import check_affine

Tensor = torch.Tensor
NOTHING_MEASURED = 1e30  # variance of a measurement that is missing [deg^2]


class PolicyStep(torch.nn.Module):
    """One sample of B estimators that a policy steers, (B,) tensors by name."""

    agent: ClassVar[str]  # word of the command line
    inputs: ClassVar[tuple[str, ...]]  # names of what it takes, in the order of its graph
    state: ClassVar[tuple[str, ...]]  # names of its state

    def __init__(self, active_model: ActiveModel, policy: torch.nn.Module | None = None):
        super().__init__()
        self.policy = policy  # (B, observations) to (B, actions) in [-1, 1], for the deployed graph
        self.start: dict[str, float] = {}  # numbers that do not start at zero, but for `previous_deg`

    @property
    def observations(self) -> int:
        """How many numbers the policy sees."""
        return len(OBSERVATIONS[self.agent])

    @property
    def actions(self) -> int:
        """How many numbers an action has."""
        return len(ACTIONS[self.agent])

    def observe(self, inputs: Mapping[str, Tensor], state: Mapping[str, Tensor]) -> Any:
        """Return what is known before the policy acts; its `observation` is (B, observations)."""
        raise NotImplementedError

    def act(self, observed: Any, action: Tensor) -> tuple[Tensor, ...]:
        """Return the state after an action (B, actions) in [-1, 1], in the order of `state`."""
        raise NotImplementedError

    def forward(self, *arguments: Tensor) -> tuple[Tensor, ...]:
        """Return the state after a sample, the estimate first; arguments are the inputs, then the state.

        The memory of a policy that has one, (B, size) arrays, follows the state.
        """
        assert self.policy is not None
        first, last = len(self.inputs), len(self.inputs) + len(self.state)
        inputs = dict(zip(self.inputs, arguments[:first], strict=True))
        state = dict(zip(self.state, arguments[first:last], strict=True))
        observed = self.observe(inputs, state)
        answer = self.policy(observed.observation, *arguments[last:])
        action, *memory = answer if isinstance(answer, tuple) else (answer,)
        return (*self.act(observed, action.clamp(-1, 1)), *memory)

    @property
    def memory(self) -> dict[str, tuple[int, ...]]:
        """Shape for one filter of each array of the policy's memory, by its name in the graph."""
        sizes = getattr(self.policy, "memory", ())
        return {f"memory_{number}": (size,) for number, size in enumerate(sizes)}


class RamObserved(NamedTuple):
    """Active model after its update: angle and error, their covariance p, r, q, and phi [deg]."""

    observation: Tensor
    bend_deg: Tensor
    error: Tensor
    p: Tensor
    r: Tensor
    q: Tensor
    phi: Tensor


class RamStep(PolicyStep):
    """RAM (eq. 10): after the active model's update the policy sets a second gain on the residual.

        phi = y - theta_AM(k|k),    X_RAM = X_AM + K_RAM phi

    phi is the *measured* residual, the only one that a deployed estimator has. The policy sees it in units of
    the given sqrt(R), on a symmetric logarithmic scale: what is large for one sensor is noise for another.
    Its action is K_RAM: of the angle, in [0, 1], so that the update is a convex step towards the measurement,
    and of the model's error, in [0, 1] per second. X_RAM feeds the next prediction. The active model is that
    of `twin.estimation.active_model` (eqs. 4-9); without a measurement there is no residual.
    """

    agent = "ram"
    inputs = ("keep", "drive_deg", "measurement_deg", "reference_deg", "variance", "sample_time")
    state = ("previous_deg", "error", "p", "r", "q")

    def __init__(self, active_model: ActiveModel, policy: torch.nn.Module | None = None):
        super().__init__(active_model, policy)
        check_affine(active_model.model)
        self.process = active_model.process_variance
        self.start = dict(zip(("p", "q"), active_model.initial_variance, strict=True))

    def observe(self, inputs: Mapping[str, Tensor], state: Mapping[str, Tensor]) -> RamObserved:
        """Predict and update by one sample, and take phi / sqrt(R)."""
        keep, R, T, y = (inputs[name] for name in ("keep", "variance", "sample_time", "measurement_deg"))
        error, p, r, q = (state[name] for name in ("error", "p", "r", "q"))
        bend = keep * state["previous_deg"] + inputs["drive_deg"] + T * error
        p, r = keep * p + T * r, keep * r + T * q
        p, q = keep * p + T * r + self.process[0], q + self.process[1]
        missing = torch.isnan(y)
        innovation = torch.where(missing, bend, y) - bend
        expected = p + torch.where(missing, NOTHING_MEASURED, R)
        of_bend, of_error = p / expected, r / expected
        bend, error = bend + of_bend * innovation, error + of_error * innovation
        q, p, r = q - of_error * r, p - of_bend * p, r - of_bend * r
        residual = inputs["reference_deg"] - bend
        phi = torch.where(torch.isnan(residual), 0.0, residual)
        return RamObserved(log_scale(phi / torch.sqrt(R))[:, None], bend, error, p, r, q, phi)

    def act(self, observed: RamObserved, action: Tensor) -> tuple[Tensor, ...]:
        """Add K_RAM phi."""
        step = (action + 1) * (0.5 * observed.phi)[:, None]
        bend, error = observed.bend_deg + step[:, 0], observed.error + ERROR_GAIN_LIMIT * step[:, 1]
        return bend, error, observed.p, observed.r, observed.q


class DirectObserved(NamedTuple):
    """Estimate before the action [deg]."""

    observation: Tensor
    bend_deg: Tensor


class DirectStep(PolicyStep):
    """Direct RL (Fig. 4): the policy replaces the active model and predicts the change of the angle itself.

    It sees y_k - theta_(k-1), zero without a measurement, on a symmetric logarithmic scale, and the increment
    of the pull [0.1 mm]. It has no model and no covariance. Its action is the change on that same scale.
    """

    agent = "direct"
    inputs = ("increment_mm", "measurement_deg")
    state = ("previous_deg",)

    def observe(self, inputs: Mapping[str, Tensor], state: Mapping[str, Tensor]) -> DirectObserved:
        """Return what the policy sees of a sample."""
        y, bend = inputs["measurement_deg"], state["previous_deg"]
        residual = torch.where(torch.isnan(y), 0.0, y - bend)
        seen = torch.stack([log_scale(residual), 10 * inputs["increment_mm"]], dim=1)
        return DirectObserved(seen, bend)

    def act(self, observed: DirectObserved, action: Tensor) -> tuple[Tensor, ...]:
        """Move the angle."""
        change = action[:, 0] * math.log1p(ANGLE_LIMIT_DEG)
        return (observed.bend_deg + torch.sign(change) * (torch.exp(torch.abs(change)) - 1),)


POLICY_STEPS: dict[str, type[PolicyStep]] = {kind.agent: kind for kind in (RamStep, DirectStep)}
"""By agent."""


def log_scale(angle: Tensor) -> Tensor:
    """Return sign(x) log(1 + |x|): noise of 0.3 deg and a first error of 20 deg are both resolved."""
    return torch.sign(angle) * torch.log1p(torch.abs(angle))
